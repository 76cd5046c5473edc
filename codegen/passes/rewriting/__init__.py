"""Passes over the graph of one function: the same results in fewer operations."""
