"""From somebody's table to a surveyed recording: studies, tables, time stamps, remarks."""
