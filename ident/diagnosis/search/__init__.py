"""The hypotheses of a step: every candidate, weighed against the others, and the best settled whole."""
