"""Eigenvalues without the zeros that say nothing: cyclic coordinates and families of steady motions
taken out exactly.

A steady motion that is one of a family (any speed will do) has directions r with A r = 0. In place
of some coordinates j the state is counted along them; what is left, A − r r_j⁻¹ A_j without rows
and columns j, has the other eigenvalues and keeps the names. Taking zeros out before the
eigenvalues are computed matters: defective zeros come out as large as ε^(1/k), some unstable.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from derive.linearize.limits import AVOIDED, NULL, REAL, VANISHES
from derive.numerics import NONZERO

Stage = tuple[int, ...]  # coordinates in whose place families are counted


def families(samples: np.ndarray, velocity: Sequence[bool]) -> tuple[Stage, ...]:
    """Which coordinates to count along families, stage by stage (indices into what is left), from A
    (N × k × k) at motions chosen at random.

    A single motion may have a null direction by chance; one that all have belongs to a family. What
    a stage leaves may have null directions again: those are Jordan chains of the zero eigenvalue,
    as of a position and its constant speed. `velocity` marks the states that are quasi-velocities:
    families of steady motions are told apart by those where possible.
    """
    stages: list[Stage] = []
    left, marks = samples, np.array(velocity, dtype=bool)
    while left.shape[1] and (count := _nullity(left)):
        stage = _stage(_null_spaces(left, count), marks)
        stages.append(stage)
        left, marks = without(left, stage), np.delete(marks, stage)
    return tuple(stages)


def _nullity(A: np.ndarray) -> int:
    """Null directions that all samples have."""
    values = np.linalg.svd(A, compute_uv=False)
    return int(np.min(np.sum(values <= NULL * (values[:, :1] + NONZERO), axis=1)))


def _null_spaces(A: np.ndarray, count: int) -> np.ndarray:
    """Orthonormal right singular vectors of the smallest singular values, N × k × count."""
    return np.linalg.svd(A)[2][:, A.shape[1] - count :, :].transpose(0, 2, 1)


def _stage(spaces: np.ndarray, velocity: np.ndarray) -> Stage:
    """The coordinates in which the null spaces are best told apart, by a pivoted Cholesky factor of
    their mean projector."""
    weights = np.where(velocity, 1.0, AVOIDED)
    left = np.mean(spaces @ spaces.transpose(0, 2, 1), axis=0) * np.outer(weights, weights)
    members: list[int] = []
    for _ in range(spaces.shape[2]):
        j = int(np.argmax(np.diag(left)))
        members.append(j)
        left = left - np.outer(left[:, j], left[j]) / left[j, j]
    return tuple(sorted(members))


def without(A: np.ndarray, stage: Stage) -> np.ndarray:
    """A (N × k × k) modulo its null directions, counted in place of the coordinates of a stage: A'
    = A_rest − r r_j⁻¹ A_j, (N × k' × k') with the other eigenvalues of A."""
    at = list(stage)
    rest = [i for i in range(A.shape[1]) if i not in stage]
    inner = A[:, rest][:, :, rest]
    if not np.any(A[:, :, at]):  # the coordinates themselves are the families
        return inner
    V = _null_spaces(A, len(at))
    regular = np.abs(np.linalg.det(V[:, at])) > VANISHES
    result = np.empty_like(inner)
    r = V[regular][:, rest] @ np.linalg.inv(V[regular][:, at])
    result[regular] = inner[regular] - r @ A[regular][:, at][:, :, rest]
    result[~regular] = _complement(A[~regular], len(at))
    return result


def _complement(A: np.ndarray, count: int) -> np.ndarray:
    """The same in an orthonormal basis, where the coordinates do not tell the families apart."""
    basis = np.linalg.svd(A)[2][:, : A.shape[1] - count, :]
    return basis @ A @ basis.transpose(0, 2, 1)


def in_units(A: np.ndarray, one: np.ndarray) -> np.ndarray:
    """A (N × k × k) of states counted in units of `one` each (k): what is small is told apart from
    nothing in the model's own units, not in SI, where a fast system of micrometres has both."""
    return A * (one / one[:, np.newaxis])


def deflated(A: np.ndarray, stages: Sequence[Stage], one: np.ndarray) -> np.ndarray:
    """A without the families found at other motions; `one` of each state as of `in_units`."""
    left, kept = in_units(A, one), one
    for stage in stages:
        left, kept = without(left, stage), np.delete(kept, stage)
    return in_units(left, 1.0 / kept)


def eigenvalues(A: np.ndarray) -> NDArray[np.complex128]:
    """(N, k), each row by falling real part, of a pair the one with positive imaginary part
    first."""
    values = np.asarray(np.linalg.eigvals(A), dtype=np.complex128)
    # rounded, so that a pair stays together though its real parts differ in the last digit
    order = (
        np.lexsort((-values.imag, -values.real.round(12)), axis=1)
        if values.shape[1]
        else np.zeros(values.shape, dtype=int)
    )
    return np.take_along_axis(values, order, axis=1)


def signature(values: NDArray[np.complex128]) -> tuple[int, int, int]:
    """Of one spectrum: how many are real, how many of those unstable, how many unstable ones are
    not real. Along a parameter it changes exactly at critical values."""
    real = np.abs(values.imag) <= REAL * (NONZERO + np.abs(values))
    unstable = is_unstable(values)
    return int(np.sum(real)), int(np.sum(real & unstable)), int(np.sum(~real & unstable))


def is_unstable(values: NDArray[np.complex128]) -> np.ndarray:
    """Which eigenvalues have a real part above what rounding leaves of an imaginary pair, relative
    to the largest |λ| of the spectrum."""
    return values.real > REAL * np.max(np.abs(values), axis=-1, keepdims=True, initial=0.0)
