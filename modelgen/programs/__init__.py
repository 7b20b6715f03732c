"""Expressions with shared intermediate symbols, in as few operations as we know how."""
