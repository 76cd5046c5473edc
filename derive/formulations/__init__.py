"""Equations of motion: formulations and choices of quasi-velocities, System → Equations."""

from derive.formulations.equations import FORMULATIONS, choices, equations, misfits, source

__all__ = ["FORMULATIONS", "choices", "equations", "misfits", "source"]
