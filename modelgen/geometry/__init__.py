"""A robot as a value: its MDH table, where it comes from, where its frames are."""
