"""The product of `modelgen`: compiled regressors, fast to import and to evaluate."""
