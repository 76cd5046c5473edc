"""Which velocities are dependent: columns of A that make a regular A₁ at sampled states."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

import numpy as np

from derive.states.closing import Kinematics
from derive.states.sampling import states
from derive.textbook.manuscript import Manuscript

SAMPLES = 12
MOST_SUBSETS = 300  # sets of columns that are all tried
LEAST_LENGTH = 1e-12  # of a row or column that is scaled to length one
DIGITS = 3  # to which singular values of different sets are compared
FINER_DIGITS = 6  # to which lengths of columns are


def dependent_columns(doc: Manuscript) -> list[int]:
    """Those the speeds leave over, else the best conditioned ones."""
    rows, columns = doc.terms.named("A").shape
    speeds = [doc.v.index(symbol) for symbol in doc.w if symbol in doc.v]
    if len(speeds) == columns - rows:
        return [j for j in range(columns) if j not in speeds]
    matrices = _sampled(doc)
    if comb(columns, rows) > MOST_SUBSETS:
        return _greedy(matrices, rows)

    def regularity(subset: tuple[int, ...]) -> tuple[float, list[int]]:
        """How far columns stay from singular: the smallest singular value of A₁ over the samples,
        rounded so that ties go to the first columns."""
        return round(_smallest(matrices, subset), DIGITS), [-j for j in subset]

    return list(max(combinations(range(columns), rows), key=regularity))


def _sampled(doc: Manuscript) -> list[np.ndarray]:
    """A at consistent states, rows scaled to length one."""
    kinematics, sample = Kinematics(doc.system), states(doc.system, SAMPLES)
    matrices: list[np.ndarray] = []
    for t, q, p in zip(sample.t, sample.q, sample.p):
        A = kinematics.velocities(t, q, p)[0][doc.terms.independent]
        lengths = np.linalg.norm(A, axis=1, keepdims=True)
        matrices.append(A / np.maximum(lengths, LEAST_LENGTH))
    return matrices


def _smallest(matrices: Sequence[np.ndarray], columns: Sequence[int]) -> float:
    """The smallest singular value of these columns in the worst sample."""
    return min(float(np.linalg.svd(A[:, list(columns)])[1][-1]) for A in matrices)


def _greedy(matrices: Sequence[np.ndarray], count: int) -> list[int]:
    """Column by column, the one whose remainder is largest in the worst sample."""
    rest = [A.copy() for A in matrices]
    columns: list[int] = []
    for _ in range(count):
        columns.append(_longest(rest, columns))
        rest = [_without(A, A[:, columns[-1]]) for A in rest]
    return sorted(columns)


def _longest(matrices: Sequence[np.ndarray], taken: Sequence[int]) -> int:
    lengths = np.min([np.linalg.norm(A, axis=0) for A in matrices], axis=0)
    others = [j for j in range(len(lengths)) if j not in taken]
    return max(others, key=lambda j: (round(float(lengths[j]), FINER_DIGITS), -j))


def _without(A: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Its columns less what they share with the given one."""
    unit = column / max(float(np.linalg.norm(column)), LEAST_LENGTH)
    return A - np.outer(unit, unit @ A)
