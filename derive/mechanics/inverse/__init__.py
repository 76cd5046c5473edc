"""Inverse dynamics of a tree in few operations: where points and axes sit, what bodies are left."""
