"""Error against run time of every method that fits a model: planned, run by worker processes,
judged, and laid out as a page."""
