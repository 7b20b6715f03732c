"""Which sums of standard parameters a model sees: exact regrouping and its rules."""
