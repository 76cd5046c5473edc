"""states: consistent states of a system: closing positions, initial states, random admissible samples, scales."""
