"""Where points, frames, paths and surfaces are, and how they move."""
