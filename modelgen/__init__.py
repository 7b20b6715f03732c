"""From a robot's geometry to symbolic base parameters, regressors and C code.

Symbols, their names in code and their units: the table at the end of README.md.
"""
