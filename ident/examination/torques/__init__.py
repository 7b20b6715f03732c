"""Torques that are other signals than the study says: turned, late, without gravity, without a sign."""
