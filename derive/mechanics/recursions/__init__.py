"""Sweeps over the tree of links: poses, motion, mass, and the equations solved link by link."""
