"""choices: which quasi-velocities w = B v: candidates, their pivots, and v = S w + R c carried
through."""
