"""The balance of energy along a motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def total_energy(energies: np.ndarray) -> np.ndarray:
    """What the power changes, of rows of the function `energy`: Jacobi's integral T₂ − T₀ + V where
    it is there, else T + V."""
    return energies[:, 2] if energies.shape[1] > 2 else energies[:, 0] + energies[:, 1]


def energy_error(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Energy − (energy at 0) − work in every row, relative to the largest energy exchanged (V
    counts from wherever it likes)."""
    T, V, work = columns["T"], columns["V"], columns["work"]
    total = columns.get("jacobi", T + V)
    scale = max(np.max(np.abs(T)), np.ptp(V), np.max(np.abs(work)))
    return (total - total[0] - work) / scale if scale > 0 else np.zeros_like(total)


def largest_error(columns: Mapping[str, np.ndarray]) -> float:
    """The largest of all rows: energy that came from nowhere, relative to the largest energy
    exchanged."""
    return float(np.max(np.abs(energy_error(columns))))
