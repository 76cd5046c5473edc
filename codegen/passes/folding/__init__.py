"""Long code made short: loops over links, statements written once, functions in parts."""
