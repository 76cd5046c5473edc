"""What the model file says, a table for each kind of thing."""
