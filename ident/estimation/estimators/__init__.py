"""Estimators beside weighted least squares, one a file."""
