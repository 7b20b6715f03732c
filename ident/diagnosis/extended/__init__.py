"""The study with what was found in it, fitted whole."""
