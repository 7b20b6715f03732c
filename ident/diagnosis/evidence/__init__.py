"""What one model says for itself against another, and what functions without a name say."""
