"""The catalogue: one effect a file, each named as its effect."""
