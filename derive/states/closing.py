"""φ(q, t) = 0 met by Gauss–Newton: for one configuration with some coordinates held, and for many
at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from derive.expressions.evaluate import number
from derive.mechanics.records import System
from derive.numerics import NONZERO
from derive.states.limits import (
    CLOSED,
    EVEN,
    GUESSES,
    LEAP,
    MANY_ROWS,
    MANY_VELOCITIES,
    NEWTON,
    NUDGES,
    REPEATS,
    ROUNDED,
)
from derive.states.sparse import Sparse, squares


@dataclass(frozen=True)
class Kinematics:
    """φ, A, c and N of a system, evaluated by CasADi; what is compiled is kept."""

    system: System

    def positions(self, t: float, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """φ (m,), as loops are closed by from afar, and its Jacobian ∂φ/∂q (m, nq). In q and not
        along v: single coordinates can be held."""
        phi, jacobian = self._positions(t, q, p)
        return phi.full().ravel(), jacobian.full()

    def position_rows(
        self, t: float, q: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | Sparse]:
        """`positions`, without zeros where there are many rows."""
        if not self.many_rows:
            return self.positions(t, q, p)
        phi, jacobian = self._positions(t, q, p)
        pattern = self._positions.sparsity_out(1)
        return phi.full().ravel(), Sparse(pattern, _entries(jacobian, pattern, 1))

    def velocities(
        self, t: float, q: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A (nc × nv), c (nc,), N (nq × nv) at one state: A v = c, q̇ = N v."""
        A, c, N = self._velocities(t, q, p)
        return A.full(), c.full().ravel(), N.full()

    def velocity_terms(
        self, t: float, q: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray | Sparse, np.ndarray, np.ndarray | Sparse]:
        """`velocities`, without zeros where there are many rows or velocities."""
        if not (self.many_rows or self.system.v.numel() >= MANY_VELOCITIES):
            return self.velocities(t, q, p)
        values = self._velocities(t, q, p)
        patterns = [self._velocities.sparsity_out(i) for i in range(3)]
        A, N = (Sparse(patterns[i], _entries(values[i], patterns[i], 1)) for i in (0, 2))
        return A, values[1].full().ravel(), N

    def rows(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A (k, nc, nv) and c (k, nc) at k states."""
        if not self.system.rows:  # N has an entry for each pair of velocities, here for nothing
            return np.zeros((len(t), 0, self.system.v.numel())), np.zeros((len(t), 0))
        A, c, _ = self._many(self._velocities, t, q, p)
        return A, c[:, :, 0]

    def closing(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """φ (k, m) and its derivative J N along the generalized velocities (k, m, nv) at k
        states."""
        phi, J = self._many(self._closing, t, q, p)
        return phi[:, :, 0], J

    @property
    def many_rows(self) -> bool:
        """Whether there are so many rows that their zeros are better left out."""
        return len(self.system.rows) >= MANY_ROWS

    def closing_rows(
        self, t: np.ndarray, q: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, Sparse]:
        """`closing` without zeros."""
        phi, J = self._closing.call([t.reshape(1, -1), q.T, p.T])
        pattern = self._closing.sparsity_out(1)
        return phi.full().T[: len(t)], Sparse(pattern, _entries(J, pattern, len(t)))

    def velocity_rows(
        self, t: np.ndarray, q: np.ndarray, p: np.ndarray
    ) -> tuple[Sparse, np.ndarray]:
        """`rows` without zeros."""
        A, c, _ = self._velocities.call([t.reshape(1, -1), q.T, p.T])
        pattern = self._velocities.sparsity_out(0)
        return Sparse(pattern, _entries(A, pattern, len(t))), c.full().T[: len(t)]

    def rates(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> Sparse | None:
        """N at k states; None where it is one everywhere."""
        return None if self.plain else self.value_rows(self.system.N, t, q, p)

    def values(self, matrix: ca.SX, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """A matrix over (t, q, p) at k states."""
        return self._many(self._function("values", matrix), t, q, p)[0]

    def value_rows(self, matrix: ca.SX, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> Sparse:
        """`values` without zeros."""
        function = self._function("values", matrix)
        (found,) = function.call([t.reshape(1, -1), q.T, p.T])
        pattern = function.sparsity_out(0)
        return Sparse(pattern, _entries(found, pattern, len(t)))

    def carried(self, t: np.ndarray, q: np.ndarray, p: np.ndarray, along: np.ndarray) -> np.ndarray:
        """q + N · along with unit quaternions, at k states: `along` (k, nv) is a displacement over
        v."""
        N = self.rates(t, q, p)
        moved = q + (along if N is None else N.applied(along))
        return normalised(self.system, moved) if self.system.quaternions else moved

    def _many(
        self, function: ca.Function, t: np.ndarray, q: np.ndarray, p: np.ndarray
    ) -> list[np.ndarray]:
        """The results of a function at k states, k × rows × columns each."""
        k = len(t)
        values = function.call([t.reshape(1, k), q.T, p.T])
        return [_unpacked(x, function.sparsity_out(i), k) for i, x in enumerate(values)]

    def _function(self, name: str, *results: ca.SX) -> ca.Function:
        s = self.system
        return ca.Function(name, [s.t, s.q, s.p], list(results))

    @cached_property
    def plain(self) -> bool:
        """Whether q̇ = v."""
        N = self.system.N
        return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())

    @cached_property
    def _positions(self) -> ca.Function:
        closing = self.system.assembly
        return self._function("positions", closing, ca.jacobian(closing, self.system.q))

    @cached_property
    def _velocities(self) -> ca.Function:
        return self._function("velocities", self.system.A, self.system.c, self.system.N)

    @cached_property
    def _closing(self) -> ca.Function:
        slopes = ca.jacobian(self.system.phi, self.system.q)
        along = slopes if self.plain else ca.mtimes(slopes, self.system.N)
        return self._function("closing", self.system.phi, along)


def _unpacked(found: ca.DM, pattern: ca.Sparsity, k: int) -> np.ndarray:
    """k matrices of one pattern that stand side by side."""
    result = np.zeros((k, pattern.size1(), pattern.size2()))
    rows, columns = pattern.get_triplet()
    if rows and k:
        result[:, rows, columns] = _entries(found, pattern, k)
    return result


def _entries(found: ca.DM, pattern: ca.Sparsity, k: int) -> np.ndarray:
    """The entries of k matrices of one pattern that stand side by side, (k, number of entries)."""
    if not k:
        return np.zeros((0, pattern.nnz()))
    return np.array(found.nonzeros(), dtype=float).reshape(k, pattern.nnz())


def nominal(system: System) -> np.ndarray:
    """The coordinates the model file starts from, guesses included, zero where nothing is said."""
    names = {x.name: x.value for x in system.model.parameters} | {"t": 0.0}
    given = {x.name: number(x.value, names) for x in system.model.initial}
    return normalised(system, np.array([given.get(c.name, 0.0) for c in system.model.coordinates]))


class Turning(Protocol):
    """What has quaternions among its coordinates: where each starts."""

    @property
    def quaternions(self) -> tuple[int, ...]: ...


def normalised(system: Turning, q: np.ndarray) -> np.ndarray:
    """q, one or many in rows, with its quaternions divided by their length; a zero one becomes (1,
    0, 0, 0), no rotation."""
    result = q.copy()
    for i in system.quaternions:
        part = q[..., i : i + 4]
        length = np.linalg.norm(part, axis=-1, keepdims=True)
        result[..., i : i + 4] = np.where(
            length > 0, part / np.where(length > 0, length, 1.0), (1.0, 0.0, 0.0, 0.0)
        )
    return result


def _sizes(J: np.ndarray | Sparse, q: np.ndarray) -> np.ndarray:
    """Σ |∂φ/∂q| (1 + |q|) of each row, in its own unit, whatever those of the coordinates are."""
    sizes = abs(J) @ (1.0 + np.abs(q))
    largest = float(np.max(sizes, initial=0.0))
    return np.maximum(sizes, EVEN * largest) if largest > 0.0 else np.ones(len(sizes))


def _is_finite(J: np.ndarray | Sparse) -> bool:
    return bool(np.all(np.isfinite(J.entries if isinstance(J, Sparse) else J)))


def shortest(A: np.ndarray | Sparse, b: np.ndarray) -> np.ndarray:
    """The shortest x of A x = b, or nearest to it where rows repeat others."""
    if not len(b):
        return np.zeros(A.shape[-1])
    if isinstance(A, Sparse):
        return squares(A.pattern).shortest(A, b[None])[0]
    return np.linalg.lstsq(A, b, rcond=REPEATS)[0]


def nudges(n: int) -> list[np.ndarray]:
    """What a start is moved by until it closes: first by nothing. Where a row has no slope, as a
    distance of two points that coincide or an angle half a turn off, any way out will do."""
    ways = np.random.default_rng(0).uniform(-1.0, 1.0, (len(NUDGES), n))
    return [size * way for size, way in zip(NUDGES, ways)]


def angles(system: System) -> np.ndarray:
    """Which coordinates are angles."""
    return np.array([c.unit == "rad" for c in system.model.coordinates])


def turned(which: np.ndarray) -> list[np.ndarray]:
    """By what these angles are moved to be guessed anew, anywhere on a turn; nothing of none."""
    rng = np.random.default_rng(0)
    ways = rng.uniform(-np.pi, np.pi, (GUESSES, len(which)))
    return [way * which for way in ways] if which.any() else []


def closed(
    solver: Kinematics,
    t: float,
    q: np.ndarray,
    p: np.ndarray,
    free: np.ndarray | None = None,
    by_row: bool = False,
    steps: int = NEWTON,
) -> np.ndarray | None:
    """q moved onto φ = 0 by damped Gauss–Newton in the `free` coordinates, or None where that
    fails.

        q ← q − W (J W)⁺ φ,   J = ∂φ/∂q,   W = diag(free)

    The pseudo-inverse takes the shortest step, and bears rows that repeat others. `by_row`: each
    row is judged in its own unit, which need not be that of the coordinates.
    """
    weights = np.ones(len(q)) if free is None else free.astype(float)
    for _ in range(steps):
        phi, J = solver.position_rows(t, q, p)
        if not (np.all(np.isfinite(phi)) and _is_finite(J)):
            return None
        scale = 1.0 + float(np.max(np.abs(q), initial=0.0))
        allowed = np.maximum(CLOSED * _sizes(J, q), ROUNDED * scale) if by_row else CLOSED * scale
        if np.all(np.abs(phi) <= allowed):
            return q
        step = -weights * shortest(J * weights, phi)
        q = q + step * min(1.0, LEAP * scale / (NONZERO + float(np.max(np.abs(step), initial=0.0))))
    return None
