"""What moves and what is asked of it: choices, states, initial values, events, steady motions,
extreme cases, published values."""
