"""Least squares on the equations: weights, noise, gains, reduction, the fit."""
