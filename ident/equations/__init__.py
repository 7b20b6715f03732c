"""Y = W chi + rho of a study: columns, decimated rows, triangular factors, the comparison of torques."""
