"""Positions that are other signals than the study says: in other units, in each other's place."""
