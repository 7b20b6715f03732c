"""Rows that a diagnosis reads: fitted, judging or left out, whitened, with dry friction's turn-over."""
