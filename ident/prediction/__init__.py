"""Torque of a new log predicted by a kept fit, and where the log leaves what the fit was ever wrong by."""
