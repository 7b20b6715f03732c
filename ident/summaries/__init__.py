"""Recordings as triangular factors of 15 min each: fits, sums and trends without touching rows again."""
