"""Many robots, many days: one table, and what changed in which joint."""
