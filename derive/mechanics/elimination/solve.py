"""Linear systems written out: no loops, no pivoting at run time, structural zeros skipped.

`ldl_solution` for symmetric positive (or quasi-) definite matrices in a given order; `lu_solution`
with pivot blocks that `pivoting` finds beforehand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations, islice

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import cross, dot, is_zero, minus, plus, times
from derive.mechanics.limits import (
    ALONE,
    BETTER,
    COFACTORS,
    GROWTH,
    MOST,
    MOST_REFLECTED,
    SAFE,
    SAME,
    VANISHES,
)
from derive.numerics import NONZERO


def scalars(matrix: ca.SX) -> Matrix:
    """Rows of scalars; entries that are not stored, and constants, are floats. So a structural zero
    is known as one, and no operation is spent on it."""
    rows: Matrix = [[0.0] * matrix.size2() for _ in range(matrix.size1())]
    for i, j in zip(*matrix.sparsity().get_triplet()):
        x = matrix[i, j]
        rows[i][j] = float(x) if x.is_constant() else x
    return rows


SparseRow = dict[int, Scalar]  # column → entry that is no exact zero


def sparse_rows(matrix: ca.SX) -> list[SparseRow]:
    """The same without the zeros: of large matrices nothing else can be afforded."""
    rows: list[SparseRow] = [{} for _ in range(matrix.size1())]
    places = zip(*matrix.sparsity().get_triplet(), ca.vertsplit(ca.vec(matrix.nz[:])))
    for i, j, x in places if matrix.nnz() else ():
        entry = float(x) if x.is_constant() else x
        if not is_zero(entry):
            rows[i][j] = entry
    return rows


def _without_zeros(rows: Sequence[Sequence[Scalar]] | Sequence[SparseRow]) -> list[SparseRow]:
    return [
        dict(row) if isinstance(row, dict) else {j: x for j, x in enumerate(row) if not is_zero(x)}
        for row in rows
    ]


@dataclass(frozen=True)
class Solution:
    """x of M x = b or A x = b, and what was divided by on the way: guards watch it."""

    x: list[Vector]  # one vector per right-hand side
    pivots: Vector  # in elimination order


def ldl_solution(
    M: Matrix | Sequence[SparseRow], sides: Sequence[Vector], order: Sequence[int]
) -> Solution:
    """M x = b by M = L D Lᵀ, eliminating unknowns in `order`; D are the `pivots` of the solution.

    Tip to base on a tree there is no fill: M couples links on one path alone, and the tips go first
    (Featherstone 2008, chapter 6). No square roots and no pivoting, which a positive definite or
    quasi-definite M does not need. Each of `sides` is one b.
    """
    A = _without_zeros(M)
    place = {k: step for step, k in enumerate(order)}
    right = [list(b) for b in sides]
    weights: list[dict[int, Scalar]] = []
    for k in order:
        # structural zeros alone: what vanishes at some states is not known here
        rest = sorted((i for i in A[k] if place[i] > place[k]), key=place.__getitem__)
        factors = {i: A[i][k] / A[k][k] for i in rest}
        for a, i in enumerate(rest):
            for j in rest[a:]:
                change = minus(A[i].get(j, 0.0), times(factors[i], A[j][k]))
                _put(A, i, j, change)
        for b in right:
            for i in rest:
                if not is_zero(b[k]):
                    b[i] = minus(b[i], times(factors[i], b[k]))
        weights.append(factors)
    pivots = [A[k].get(k, 0.0) for k in order]
    for b in right:
        _back(b, pivots, order, weights)
    return Solution(right, pivots)


def _put(A: list[SparseRow], i: int, j: int, x: Scalar) -> None:
    """A symmetric pair of entries; a zero is taken out."""
    if is_zero(x):
        A[i].pop(j, None)
        A[j].pop(i, None)
    else:
        A[i][j] = A[j][i] = x


def _back(
    b: Vector, pivots: Vector, order: Sequence[int], weights: Sequence[dict[int, Scalar]]
) -> None:
    for k, pivot, factors in reversed(list(zip(order, pivots, weights))):
        b[k] = 0.0 if is_zero(b[k]) else b[k] / pivot
        for i, factor in factors.items():
            if not is_zero(b[i]):
                b[k] = minus(b[k], times(factor, b[i]))


@dataclass(frozen=True)
class Block:
    """A pivot of one to three rows and columns, or all that is left, with |determinant| over the
    samples; `grade` 0: numbers, 1: the same at every sample, 2: varying."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    least: float
    largest: float
    grade: int

    @property
    def quality(self) -> float:
        """Least over largest size of the pivot block at the sampled states, in 0 … 1: near 0 it
        comes near to singular, 1 it never moves."""
        return self.least / self.largest


def lu_solution(
    A: Matrix | Sequence[SparseRow], sides: Sequence[Vector], pivots: Sequence[Block]
) -> Solution:
    """A x = b by Gauss elimination with the given pivot blocks; the `pivots` of the solution are
    their determinants, in the order of the blocks, which guards watch."""
    rows = _without_zeros(A)
    of_column: dict[int, set[int]] = {}
    for i, row in enumerate(rows):
        for j in row:
            of_column.setdefault(j, set()).add(i)
    row_place, place = (_places(x) for x in ([y.rows for y in pivots], [y.columns for y in pivots]))
    right = [list(b) for b in sides]
    inverses: list[Matrix] = []
    determinants: Vector = []
    for block in pivots:
        last = place[block.columns[-1]]
        inverted, determinant = small_inverse(
            [[rows[r].get(c, 0.0) for c in block.columns] for r in block.rows]
        )
        moving = [b for b in right if not all(is_zero(b[r]) for r in block.rows)]
        reached = {j for r in block.rows for j in rows[r] if place[j] > last}
        columns = sorted(reached, key=place.__getitem__)
        touched = {i for c in block.columns for i in of_column[c] if row_place[i] > last}
        for i in sorted(touched, key=row_place.__getitem__):
            factors = [dot(x, [rows[i].get(c, 0.0) for c in block.columns]) for x in zip(*inverted)]
            for j in columns:
                change = dot(factors, [rows[r].get(j, 0.0) for r in block.rows])
                _set(rows, of_column, (i, j), minus(rows[i].get(j, 0.0), change))
            for b in moving:
                b[i] = minus(b[i], dot(factors, [b[r] for r in block.rows]))
        inverses.append(inverted)
        determinants.append(determinant)
    above = [_later_columns(rows, block, place) for block in pivots]
    return Solution([_substituted(rows, b, pivots, inverses, above) for b in right], determinants)


def _places(groups: Sequence[tuple[int, ...]]) -> dict[int, int]:
    """When each row, or column, is eliminated."""
    return {i: k for k, i in enumerate(i for group in groups for i in group)}


def _set(
    rows: list[SparseRow], of_column: dict[int, set[int]], place: tuple[int, int], x: Scalar
) -> None:
    i, j = place
    if is_zero(x):
        rows[i].pop(j, None)
        of_column[j].discard(i)
    else:
        rows[i][j] = x
        of_column[j].add(i)


def _later_columns(
    rows: Sequence[SparseRow], block: Block, place: dict[int, int]
) -> list[list[int]]:
    """For each row of a pivot block, where it still has entries once it is eliminated."""
    last = place[block.columns[-1]]
    return [
        sorted((j for j in rows[r] if place[j] > last), key=place.__getitem__) for r in block.rows
    ]


def _substituted(
    rows: Sequence[SparseRow],
    b: Vector,
    pivots: Sequence[Block],
    inverses: Sequence[Matrix],
    above: Sequence[list[list[int]]],
) -> Vector:
    x: Vector = [0.0] * len(b)
    for block, inverted, later in reversed(list(zip(pivots, inverses, above))):
        rest = [
            minus(b[r], dot([rows[r][j] for j in js], [x[j] for j in js]))
            for r, js in zip(block.rows, later)
        ]
        for c, row in zip(block.columns, inverted):
            x[c] = dot(row, rest)
    return x


def small_inverse(A: Matrix) -> tuple[Matrix, Scalar]:
    """Inverse and determinant of a 1 × 1, 2 × 2 or 3 × 3 matrix, by cofactors; of a larger one by
    reflections, and what `reflected_solution` has in place of the determinant. Regular wherever
    that is, while single pivots may vanish."""
    if len(A) > COFACTORS:
        return _inverse_by_reflections(A)
    if len(A) == 1:
        return [[1.0 / A[0][0]]], A[0][0]
    if len(A) == 2:
        (a, b), (c, d) = A
        determinant = dot([a, b], [d, -c])
        weight = 1.0 / determinant
        return [
            [dot([d], [weight]), dot([-b], [weight])],
            [dot([-c], [weight]), dot([a], [weight])],
        ], determinant
    columns = [cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1])]
    determinant = dot(A[0], columns[0])
    weight = 1.0 / determinant
    return [[dot([columns[j][i]], [weight]) for j in range(3)] for i in range(3)], determinant


def _inverse_by_reflections(A: Matrix) -> tuple[Matrix, Scalar]:
    n = len(A)
    identity: Matrix = [[1.0 if i == k else 0.0 for k in range(n)] for i in range(n)]
    return reflected_solution(A, identity)


def reflected_solution(A: Matrix, sides: Matrix) -> tuple[Matrix, Scalar]:
    """X of A X = sides, by Householder's QR factorisation written out: stable for every regular
    matrix without any choice of pivots. With more rows than columns X is the least squares
    solution.

    With it, and with the sign of the determinant, the least of the diagonal of R: what is left of a
    column beside those before it, an estimate of how near A is to a singular matrix. The
    determinant itself is a product of so many that it says nothing of that.

    Columns with few entries come first, so that reflections touch few rows.
    Source: A. S. Householder, J. ACM 5 (1958) 339–342.
    """
    n = len(A[0])
    rows = [[*row, *side] for row, side in zip(A, sides)]
    order = list(range(n))
    determinant: Scalar = 1.0
    for k in range(n):
        determinant = times(_sparsest_first(rows, order, k), determinant)
        if any(not is_zero(row[k]) for row in rows[k + 1 :]):
            _reflect(rows, k)
            determinant = -determinant
        determinant = times(rows[k][k], determinant)
    X = _upper_solution(rows[:n], n)
    least = reduce(ca.fmin, [ca.fabs(rows[k][k]) for k in range(n)])
    return [X[order.index(j)] for j in range(n)], ca.copysign(least, determinant)


def _sparsest_first(rows: Matrix, order: list[int], k: int) -> float:
    """Bring the column with the fewest entries below row k − 1 to place k, and a row with an entry
    in it to row k. Returns the sign of the exchange."""
    n = len(order)
    counts = {j: sum(not is_zero(row[j]) for row in rows[k:]) for j in range(k, n)}
    column = min(counts, key=lambda j: (counts[j], j))
    entries = [i for i in range(k, len(rows)) if not is_zero(rows[i][column])] or [k]
    pivot = min(entries, key=lambda i: sum(not is_zero(x) for x in rows[i][k:n]))
    for row in rows:
        row[k], row[column] = row[column], row[k]
    order[k], order[column] = order[column], order[k]
    rows[k], rows[pivot] = rows[pivot], rows[k]
    return (1.0 if column == k else -1.0) * (1.0 if pivot == k else -1.0)


def _reflect(rows: Matrix, k: int) -> None:
    """Reflect rows k, k + 1, … so that column k vanishes below row k; the sign of what is left in
    it is chosen so that nothing cancels."""
    below = range(k, len(rows))
    column = [rows[i][k] for i in below]
    left = -ca.copysign(ca.sqrt(dot(column, column)), column[0])
    normal = [minus(column[0], left), *column[1:]]
    weight = 1.0 / (left * normal[0])  # −2 / |normal|²
    for j in range(k + 1, len(rows[0])):
        along = dot(normal, [rows[i][j] for i in below])
        if is_zero(along):
            continue
        share = times(weight, along)
        for i, entry in zip(below, normal):
            if not is_zero(entry):
                rows[i][j] = plus(rows[i][j], times(share, entry))
    for i in below:
        rows[i][k] = left if i == k else 0.0


def _upper_solution(rows: Matrix, n: int) -> Matrix:
    """X of R X = C, the rows being [R, C] with R upper triangular, n × n."""
    X: Matrix = [[0.0] * (len(rows[0]) - n) for _ in range(n)]
    for i in reversed(range(n)):
        inverse = 1.0 / rows[i][i]
        for k in range(len(X[i])):
            known = dot(rows[i][i + 1 : n], [X[j][k] for j in range(i + 1, n)])
            rest = minus(rows[i][n + k], known)
            X[i][k] = 0.0 if is_zero(rest) else times(inverse, rest)
    return X


def growth(
    values: NDArray[np.float64], block: Block, largest: NDArray[np.float64] | None = None
) -> float:
    """How much the entries of matrices (samples, rows, columns) may grow when the block is
    eliminated: the largest weight of another unknown in what is solved for, columns compared by
    their `largest` entries over the samples, and over further rows where it is given."""
    over = np.max(np.abs(values), axis=(0, 1)) if largest is None else largest
    sizes = np.maximum(over, np.finfo(float).tiny)
    every, rows, columns = range(len(values)), list(block.rows), list(block.columns)
    others = [j for j in range(values.shape[2]) if j not in columns]
    if not others:
        return 1.0
    scaled = values / sizes
    inside: NDArray[np.float64] = scaled[np.ix_(every, rows, columns)]
    solved = np.linalg.pinv(inside)
    return float(np.max(np.abs(solved @ scaled[np.ix_(every, rows, others)]), initial=1.0))


def steady(values: np.ndarray, fixed: np.ndarray, best: Block) -> Block:
    """The best block, unless digits may be lost by it: then all that is left, to be solved by
    reflections.

    With up to three unknowns left the cofactors are regular wherever the matrix is.
    """
    _, m, n = values.shape
    if m != n or not COFACTORS < n <= MOST_REFLECTED or growth(values, best) <= GROWTH:
        return best
    everything = tuple(range(n))
    scale = float(np.max(np.abs(values)))
    return _block(values, fixed, everything, everything, scale) or best


@dataclass(frozen=True)
class Part:
    """Some rows and columns of matrices: `values` (samples, rows, columns), which entries are not
    zero by structure, which are numbers; and of the whole matrices the largest entry and those of
    these columns."""

    values: np.ndarray
    pattern: np.ndarray
    fixed: np.ndarray
    scale: float
    largest: np.ndarray  # (columns,)


def or_larger(single: Block, around: Callable[[], Part]) -> Block:
    """The best single pivot, or a larger one around it that stays farther from zero: a rotation
    between two unknowns is inverted as a whole and not divided by its cosine."""
    best = single
    for size in (2, 3):
        safe = best.quality >= SAFE
        if best.grade < 2 or (safe and size > 2):
            break
        part = around()
        larger = _best_of_size(part, single, size)
        if larger is None:
            continue
        if larger.grade < 2 if safe else _is_better(part, best, larger):
            best = larger
    return best


def _is_better(part: Part, best: Block, larger: Block) -> bool:
    return larger.quality > BETTER * best.quality or _vanishes_alone(part.values, best, larger)


def _vanishes_alone(values: np.ndarray, small: Block, large: Block) -> bool:
    """Whether `small` comes near zero where `large` does not: then the ratio of their determinants
    runs away there."""
    if not set(small.rows) <= set(large.rows) or not set(small.columns) <= set(large.columns):
        return False
    ratio = _sizes(values, large.rows, large.columns) / np.maximum(
        _sizes(values, small.rows, small.columns), NONZERO
    )
    return float(np.max(ratio)) > ALONE * float(np.median(ratio))


def _sizes(values: np.ndarray, rows: tuple[int, ...], columns: tuple[int, ...]) -> np.ndarray:
    """|determinant| of a block at every sample."""
    entries = values[np.ix_(range(len(values)), rows, columns)]
    return np.abs(np.linalg.det(entries)) if len(rows) > 1 else np.abs(entries[:, 0, 0])


def _best_of_size(part: Part, around: Block, size: int) -> Block | None:
    """The best block of that size with the row of a poor single pivot, among rows and columns that
    touch it."""
    candidates = [
        block
        for rows, columns in islice(_neighbours(part.pattern, around.rows[0], size), MOST)
        if (block := _block(part.values, part.fixed, rows, columns, part.scale)) is not None
    ]
    safest = [block for block in candidates if block.grade < 2]
    if len(safest) > 1:  # none can vanish: what is left to choose is how digits fare
        return min(
            safest,
            key=lambda block: (block.grade, round(growth(part.values, block, part.largest), 1)),
        )
    return min(candidates, key=lambda block: (block.grade, -block.quality), default=None)


def _neighbours(
    pattern: np.ndarray, row: int, size: int
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Row sets that share columns with `row`, with the column sets they could be solved for."""
    touching = [i for i in np.nonzero((pattern & pattern[row]).any(axis=1))[0].tolist() if i != row]
    for others in combinations(touching, size - 1):
        rows = tuple(sorted((row, *others)))
        columns = np.nonzero(pattern[list(rows)].any(axis=0))[0].tolist()
        for chosen in combinations(columns, size):
            inside = pattern[np.ix_(rows, chosen)]
            if inside.any(axis=0).all() and inside.any(axis=1).all():
                yield rows, chosen


def _block(
    values: np.ndarray,
    fixed: np.ndarray,
    rows: tuple[int, ...],
    columns: tuple[int, ...],
    scale: float,
) -> Block | None:
    size = _sizes(values, rows, columns)
    least, largest = float(np.min(size)), float(np.max(size))
    if not np.isfinite(largest) or largest <= VANISHES * scale ** len(rows):
        return None
    numbers = bool(fixed[np.ix_(rows, columns)].all())
    grade = 0 if numbers else 1 if largest - least <= SAME * largest else 2
    return Block(tuple(int(r) for r in rows), tuple(int(c) for c in columns), least, largest, grade)
