"""Equations of motion: formulations and choices of quasi-velocities, System → Equations."""

from derive.formulations.equations import FORMULATIONS, choices, equations, misfits

__all__ = ["FORMULATIONS", "choices", "equations", "misfits"]
