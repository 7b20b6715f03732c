"""Filters, derivatives, the sign of dry friction, decimation."""
