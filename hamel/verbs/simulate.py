"""simulate: integrate the compiled module from the consistent initial state and say how far the motion can be trusted."""

from __future__ import annotations
