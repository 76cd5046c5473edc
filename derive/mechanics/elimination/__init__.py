"""Linear systems of constrained motion, solved symbolically."""
