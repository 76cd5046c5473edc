"""The balance of energy along a motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hamel.simulate.limits import ROUNDING


def total_energy(energies: np.ndarray) -> np.ndarray:
    """What the power changes, of rows of the function `energy`: Jacobi's integral T₂ − T₀ + V where
    it is there, else T + V."""
    return energies[:, 2] if energies.shape[1] > 2 else energies[:, 0] + energies[:, 1]


def energy_error(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Energy − (energy at 0) − work in every row, relative to the largest energy exchanged (V
    counts from wherever it likes)."""
    T, V, work = columns["T"], columns["V"], columns["work"]
    total = columns.get("jacobi", T + V)
    return (total - total[0] - work) / exchanged(T, V, work)


def exchanged(T: np.ndarray, V: np.ndarray, work: np.ndarray) -> np.ndarray:
    """The largest energy exchanged along the last axis (J); ∞ where that is nothing but the
    rounding of V, as of a structure at rest, so that errors in terms of it are 0."""
    sizes = (np.max(np.abs(T), axis=-1), np.ptp(V, axis=-1), np.max(np.abs(work), axis=-1))
    largest = np.maximum.reduce(sizes)
    moves = largest > ROUNDING * np.max(np.abs(V), axis=-1)
    return np.where(moves, largest, np.inf)


def largest_error(columns: Mapping[str, np.ndarray]) -> float:
    """The largest of all rows: energy that came from nowhere, relative to the largest energy
    exchanged."""
    return float(np.max(np.abs(energy_error(columns))))
