"""Equations → linear equations in minimal states, steady motions, spectra."""

from derive.linearize.minimal import linear
from derive.linearize.study import study

__all__ = ["linear", "study"]
