"""φ = 0 and its derivative along the velocities at many configurations at once.

How far each is from closed, which steps close it, and how independent the rows are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from derive.numerics import NONZERO
from derive.states.limits import GAP, REFINED, ROUNDS, SQUARES
from derive.states.sparse import Sparse, Squares


class View(Protocol):
    """φ and its derivative J along v at many configurations, rows divided by their usual lengths,
    columns times the widths."""

    @property
    def off(self) -> np.ndarray: ...
    @property
    def ranks(self) -> np.ndarray: ...
    def along(self, x: np.ndarray) -> np.ndarray: ...
    def chosen(self, good: np.ndarray, other: View) -> View: ...
    def solved(self, right: np.ndarray, rank: int) -> np.ndarray: ...
    def strength(self, rank: int) -> np.ndarray: ...
    @property
    def phi(self) -> np.ndarray: ...
    @property
    def rounds(self) -> int: ...


def _off(phi: np.ndarray) -> np.ndarray:
    size = np.max(np.abs(phi), axis=1, initial=0.0)
    return np.where(np.isfinite(size), size, np.inf)


@dataclass(frozen=True)
class DenseView:
    """With all entries of J."""

    phi: np.ndarray  # (k, m)
    J: np.ndarray  # (k, m, nv)

    @property
    def rounds(self) -> int:
        """After how many steps what is linear is solved but for rounding."""
        return ROUNDS

    @property
    def off(self) -> np.ndarray:
        """How far each configuration is from closed; infinite where φ is not a number."""
        return _off(self.phi)

    def along(self, x: np.ndarray) -> np.ndarray:
        """J x (k, m), the rates of φ at the velocities x (k, nv)."""
        return (self.J @ x[:, :, None])[:, :, 0]

    def chosen(self, good: np.ndarray, other: View) -> View:
        """This one at the `good` states, the other elsewhere."""
        assert isinstance(other, DenseView)
        return DenseView(
            np.where(good[:, None], self.phi, other.phi),
            np.where(good[:, None, None], self.J, other.J),
        )

    def solved(self, right: np.ndarray, rank: int) -> np.ndarray:
        """J⁺ right (k, nv), with the `rank` strongest directions: the least step that meets all
        rows, also where some repeat others."""
        if rank == self.J.shape[1]:
            along = self.inverse @ right[:, :, None]
        else:
            squares, vectors = self.parts
            vectors, squares = vectors[:, :, -rank:], squares[:, -rank:, None]
            weights = np.where(squares > SQUARES * squares[:, -1:], 1.0, 0.0) / np.maximum(
                squares, NONZERO
            )
            along = vectors @ (weights * (vectors.transpose(0, 2, 1) @ right[:, :, None]))
        return (self.J.transpose(0, 2, 1) @ along)[:, :, 0]

    def strength(self, rank: int) -> np.ndarray:
        """(Σ 1/σ²)^−½ of the `rank` largest singular values: near zero where the least of them
        is."""
        if rank == self.J.shape[1]:
            return 1 / np.sqrt(np.maximum(np.trace(self.inverse, axis1=1, axis2=2), NONZERO))
        return 1 / np.sqrt(np.sum(1 / np.maximum(self.parts[0][:, -rank:], NONZERO), axis=1))

    @property
    def ranks(self) -> np.ndarray:
        """The rank of J at each state, (n,): singular values over the gap, relative to the largest.

        The eigenvalues of J Jᵀ are needed only where a cheap bound does not already show full rank
        everywhere.
        """
        m = self.J.shape[1]
        if np.all(self.strength(m) ** 2 > GAP * np.trace(self.gram, axis1=1, axis2=2)):
            return np.full(len(self.J), m)
        squares = self.parts[0]
        return np.sum(squares > GAP * squares[:, -1:], axis=1)

    @cached_property
    def gram(self) -> np.ndarray:
        """J Jᵀ at each state, (n, m, m): its eigenvalues are the squared singular values of J."""
        return self.J @ self.J.transpose(0, 2, 1)

    @cached_property
    def inverse(self) -> np.ndarray:
        """(J Jᵀ)⁻¹, kept finite where rows depend on each other."""
        m = self.J.shape[1]
        # far below GAP, so that it changes no direction that counts
        small = SQUARES * np.trace(self.gram, axis1=1, axis2=2)[:, None, None] + NONZERO
        regular: NDArray[np.float64] = self.gram + small * np.eye(m)
        return np.linalg.inv(regular)

    @cached_property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues of J Jᵀ, ascending, and eigenvectors."""
        return np.linalg.eigh(self.gram)


@dataclass(frozen=True)
class SparseView:
    """Without the zeros of J, which has many rows that touch few columns each. Where some rows
    repeat others, all entries are looked at."""

    phi: np.ndarray  # (k, m)
    J: Sparse  # m × nv
    squares: Squares

    @property
    def rounds(self) -> int:
        """After how many steps what is linear is solved but for rounding: more, where the least
        singular values are those of a long row of loops."""
        return ROUNDS + REFINED

    @property
    def off(self) -> np.ndarray:
        """How far each configuration is from closed; infinite where φ is not a number."""
        return _off(self.phi)

    def along(self, x: np.ndarray) -> np.ndarray:
        """J x (k, m), the rates of φ at the velocities x (k, nv)."""
        return self.J.applied(x)

    def chosen(self, good: np.ndarray, other: View) -> View:
        """This one at the `good` states, the other elsewhere."""
        assert isinstance(other, SparseView)
        return SparseView(
            np.where(good[:, None], self.phi, other.phi),
            Sparse(self.J.pattern, np.where(good[:, None], self.J.entries, other.J.entries)),
            self.squares,
        )

    def solved(self, right: np.ndarray, rank: int) -> np.ndarray:
        """J⁺ right (k, nv), with the `rank` strongest directions."""
        if rank < self.J.shape[1]:
            return self._dense.solved(right, rank)
        return self.J.transposed(self.squares.solution(self.J, right))

    def strength(self, rank: int) -> np.ndarray:
        """(Σ 1/σ²)^−½ of the `rank` largest singular values."""
        if rank < self.J.shape[1]:
            return self._dense.strength(rank)
        return self.squares.strength(self.J)

    @property
    def ranks(self) -> np.ndarray:
        """The rank of J at each state, (k,)."""
        m = self.J.shape[1]
        if np.all(self.strength(m) ** 2 > GAP * np.sum(self.J.entries**2, axis=1)):
            return np.full(len(self.phi), m)
        return self._dense.ranks

    @cached_property
    def _dense(self) -> DenseView:
        return DenseView(self.phi, self.J.full())
