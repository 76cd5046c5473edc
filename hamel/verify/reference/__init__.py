"""reference: the mechanics of a model, worked out numerically a second time, from nothing that it
judges."""
