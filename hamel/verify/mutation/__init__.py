"""mutation: errors planted in the equations of a model, and which checks see each of them."""
