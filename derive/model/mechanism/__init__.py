"""The mechanism: bodies, frames, joints and paths, and where they sit."""
