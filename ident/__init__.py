"""Identification on top of the compiled regressor: fit, simulate, diagnose, report.

Symbols, their names in code and their units: the table at the end of README.md.
"""
