"""Functions of a tree as loops over its links: which links are of one kind, in what order they
stand, and the tables of their numbers."""
