"""The formulations, one file each; none knows another."""

from __future__ import annotations

from derive.formulations.formulation import Formulation
from derive.formulations.methods import (
    augmented,
    maggi,
    quasi_velocities,
    recursive,
    udwadia_kalaba,
    udwadia_phohomsiri,
)

FORMULATIONS: tuple[Formulation, ...] = (
    quasi_velocities.FORMULATION,
    maggi.FORMULATION,
    udwadia_kalaba.FORMULATION,
    udwadia_phohomsiri.FORMULATION,
    recursive.FORMULATION,
    augmented.FORMULATION,
)
