"""Matrices of one pattern at many states, of which zeros are neither stored nor worked on.

Rows of many loops touch few coordinates each, so that J Jᵀ = L D Lᵀ has factors with few entries in
a good order of rows (J. A. George and W.-H. Liu, SIAM Review 31 (1989) 1–19): solving takes as long
as there are loops, where dense matrices take the cube.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from derive.numerics import NONZERO
from derive.states.limits import GAP, LEFT_OVER, POWERS, REFINED, SQUARES


@dataclass(frozen=True)
class Sparse:
    """k matrices m × n of one pattern, their entries column by column."""

    pattern: ca.Sparsity
    entries: np.ndarray  # (k, number of entries)

    @property
    def shape(self) -> tuple[int, int, int]:
        """k, m, n."""
        return len(self.entries), self.pattern.size1(), self.pattern.size2()

    @cached_property
    def rows(self) -> np.ndarray:
        """The row of each entry."""
        return np.array(self.pattern.row(), dtype=int)

    @cached_property
    def columns(self) -> np.ndarray:
        """The column of each entry."""
        return np.array(self.pattern.get_col(), dtype=int)

    def full(self) -> np.ndarray:
        """The matrices with their zeros, (k, m, n)."""
        result = np.zeros(self.shape)
        result[:, self.rows, self.columns] = self.entries
        return result

    def __abs__(self) -> Sparse:
        return Sparse(self.pattern, np.abs(self.entries))

    def __mul__(self, columns: np.ndarray) -> Sparse:
        """With columns multiplied by numbers."""
        return Sparse(self.pattern, self.entries * columns[self.columns])

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """J x of a single matrix, (n,) → (m,)."""
        return self.applied(x[None])[0]

    def applied(self, x: np.ndarray) -> np.ndarray:
        """J x at each state: (k, n) → (k, m)."""
        return _summed(self.entries * x[:, self.columns], self.rows, self.shape[1])

    def transposed(self, y: np.ndarray) -> np.ndarray:
        """Jᵀ y at each state: (k, m) → (k, n)."""
        return _summed(self.entries * y[:, self.rows], self.columns, self.shape[2])

    def lengths(self) -> np.ndarray:
        """The length of each row at each state, (k, m)."""
        return np.sqrt(_summed(self.entries**2, self.rows, self.shape[1]))

    def largest(self) -> np.ndarray:
        """The largest size of an entry of each row at each state, (k, m); infinite where one is no
        number."""
        result = np.zeros((self.shape[1], len(self.entries)))
        np.maximum.at(result, self.rows, np.nan_to_num(np.abs(self.entries), nan=np.inf).T)
        return result.T

    def scaled(self, rows: np.ndarray, columns: np.ndarray | None = None) -> Sparse:
        """With rows, and columns, multiplied by numbers."""
        by = rows[self.rows] if columns is None else rows[self.rows] * columns[self.columns]
        return Sparse(self.pattern, self.entries * by)

    def finite(self) -> Sparse:
        """With zeros, and the largest numbers, where entries are no numbers."""
        return Sparse(self.pattern, np.nan_to_num(self.entries))

    def at(self, states: np.ndarray) -> Sparse:
        """The matrices at some of the states."""
        return Sparse(self.pattern, self.entries[states])

    def of_rows(self, rows: Sequence[int]) -> Sparse:
        """Some of the rows, in their order."""
        pattern, places = self.pattern.sub(list(rows), list(range(self.pattern.size2())))
        return Sparse(pattern, self.entries[:, list(places)])


def _summed(values: np.ndarray, places: np.ndarray, size: int) -> np.ndarray:
    """Values (k, entries) added up by their places, (k, size)."""
    sums = [np.bincount(places, weights=row, minlength=size) for row in values]
    return np.array(sums).reshape(len(values), size)


def stacked(above: Sparse, below: Sparse) -> Sparse:
    """[above; below] at each state."""
    _, m, n = above.shape
    rows = np.concatenate([above.rows, m + below.rows])
    columns = np.concatenate([above.columns, below.columns])
    order = np.lexsort((rows, columns))
    pattern = ca.Sparsity.triplet(
        m + below.shape[1], n, rows[order].tolist(), columns[order].tolist()
    )
    return Sparse(pattern, np.concatenate([above.entries, below.entries], axis=1)[:, order])


def lengths_over_states(matrices: Sparse) -> np.ndarray:
    """The largest length of each row over the states, (m,); 1 for a row of zeros, or of what
    rounding has left of them."""
    lengths = np.max(matrices.lengths(), axis=0, initial=0.0)
    least = LEFT_OVER * float(np.max(lengths, initial=0.0))
    return np.where(lengths > least, lengths, 1.0)


def unit(n: int) -> Sparse:
    """The unit matrix, as one of one."""
    return Sparse(ca.Sparsity.diag(n), np.ones((1, n)))


def clearly_independent(matrices: Sparse) -> bool:
    """Whether the rows, of length one at most, are so at most states, whatever rounding; where that
    is not clear all entries have to be looked at."""
    _, m, n = matrices.shape
    if m > n:
        return False
    even = matrices.scaled(1 / lengths_over_states(matrices))
    ratios = squares(even.pattern).strength(even) ** 2 / np.sum(even.entries**2, axis=1)
    return bool(np.median(ratios) > GAP)


def with_zeros(matrix: np.ndarray) -> Sparse:
    """A single matrix with an entry at each place."""
    rows, columns = matrix.shape
    return Sparse(ca.Sparsity.dense(rows, columns), matrix.T.reshape(1, -1))


@dataclass(frozen=True)
class Squares:
    """J Jᵀ + ε 1 of matrices of one pattern, factored entry by entry for all states at once; ε is
    far below what counts and keeps the factors finite where rows depend on each other."""

    pattern: ca.Sparsity

    def solution(self, matrices: Sparse, sides: np.ndarray) -> np.ndarray:
        """y of (J Jᵀ + ε 1) y = b at each state, b (k, m)."""
        k = len(sides)
        given = [matrices.entries.T, self.small(matrices).reshape(1, k), sides.T]
        return np.array(self._solution.call([ca.DM(x) for x in given])[0].full()).T

    def shortest(self, matrices: Sparse, sides: np.ndarray) -> np.ndarray:
        """The shortest x (k, n) with J x = b, refined: squares lose digits."""
        x = matrices.transposed(self.solution(matrices, sides))
        for _ in range(REFINED):
            left = sides - matrices.applied(x)
            x = x + matrices.transposed(self.solution(matrices, left))
        return x

    def strength(self, matrices: Sparse) -> np.ndarray:
        """(Σ 1/σ²)^−½ of all singular values at each state, (k,): at most the least of them."""
        k = len(matrices.entries)
        given = [matrices.entries.T, self.small(matrices).reshape(1, k)]
        traces = self._trace.call([ca.DM(x) for x in given])[0].full().ravel()
        return 1 / np.sqrt(np.maximum(traces, NONZERO))

    def extremes(self, matrices: Sparse) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest singular value at each state, each (k,), by iterated powers: of
        the inverse for the least, which is |Jᵀ y| of what they come to, for ε is in the inverse."""
        k, m, _ = matrices.shape
        start = np.random.default_rng(0).normal(size=(1, m)) * np.ones((k, 1))
        least = largest = start / np.linalg.norm(start, axis=1, keepdims=True)
        above = np.zeros(k)
        for _ in range(POWERS):
            inverse, power = self.solution(matrices, least), _squared(matrices, largest)
            above = np.linalg.norm(power, axis=1)
            least = inverse / np.maximum(np.linalg.norm(inverse, axis=1), NONZERO)[:, None]
            largest = power / np.maximum(above, NONZERO)[:, None]
        return np.linalg.norm(matrices.transposed(least), axis=1), np.sqrt(above)

    def small(self, matrices: Sparse) -> np.ndarray:
        """ε at each state, (k,)."""
        return SQUARES * np.sum(matrices.entries**2, axis=1) + NONZERO

    @cached_property
    def _factors(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, list[int]]:
        J, small = ca.SX.sym("J", self.pattern), ca.SX.sym("small")
        squares = ca.mtimes(J, J.T) + small * ca.SX.eye(self.pattern.size1())
        return (J, small, *ca.ldl(squares))

    @cached_property
    def _solution(self) -> ca.Function:
        J, small, D, LT, order = self._factors
        side = ca.SX.sym("b", self.pattern.size1())
        values = [J.nz[:], small, side]
        return ca.Function("solution", values, [ca.densify(ca.ldl_solve(side, D, LT, order))])

    @cached_property
    def _trace(self) -> ca.Function:
        """Of the inverse: the slope of the logarithm of the determinant in ε."""
        J, small, D, _, _ = self._factors
        slope = ca.jtimes(ca.sum1(ca.log(ca.vec(D))), small, ca.SX(1))
        return ca.Function("trace", [J.nz[:], small], [ca.densify(slope)])


def squares(pattern: ca.Sparsity) -> Squares:
    """Those of a pattern, set up once."""
    return _of_pattern(*pattern.shape, tuple(pattern.colind()), tuple(pattern.row()))


@functools.lru_cache(maxsize=8)
def _of_pattern(m: int, n: int, starts: tuple[int, ...], rows: tuple[int, ...]) -> Squares:
    return Squares(ca.Sparsity(m, n, starts, rows))


def _squared(matrices: Sparse, y: np.ndarray) -> np.ndarray:
    """J Jᵀ y at each state."""
    return matrices.applied(matrices.transposed(y))
