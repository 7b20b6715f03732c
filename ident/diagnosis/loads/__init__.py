"""Loads that come and go, and what else they could be."""
