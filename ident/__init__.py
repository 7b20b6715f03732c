"""Identification on top of the compiled regressor: fit, simulate, diagnose, report."""
