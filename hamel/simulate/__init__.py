"""simulate: motions of a model: by its compiled module, by library solvers, with many digits."""
