"""What a model file is composed of: repetitions, submodels, other files."""
