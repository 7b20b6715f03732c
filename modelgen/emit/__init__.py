"""Derived models as CasADi functions, C and descriptions."""
