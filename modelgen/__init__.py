"""From a robot's geometry to symbolic base parameters, regressors and C code."""
