"""Gravity, the robot file's table with bodies of their own, and terms that a study leaves out."""
