"""Exact numbers and linear algebra over them."""
