"""Quick fits on some thousand samples, and what they say for one explanation against another."""
