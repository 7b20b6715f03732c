"""The Newton-Euler regressor of all standard parameters, and the four models' rows of it."""
