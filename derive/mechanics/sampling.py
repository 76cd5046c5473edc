"""Random admissible states: φ(q, t) = 0 by Gauss–Newton from a random start, then v on A v = c, at random t, u, p."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.expressions.evaluate import number
from derive.mechanics.records import System

TRIES = 40  # random starts per state before giving up, and states passed over for want of rank
CLOSED = 1e-12
NEWTON = 30  # iterations after which a start counts as hopeless
WEAK = 1e-4  # a relative singular value of A below this belongs to a redundant row or a nearly singular position
PILOTS = 8  # states looked at to learn the rank of A


@dataclass(frozen=True)
class States:
    """Arrays with one row per state."""

    t: np.ndarray  # (k,)
    q: np.ndarray  # (k, nq)
    v: np.ndarray
    u: np.ndarray
    p: np.ndarray


@dataclass(frozen=True)
class Kinematics:
    """φ, A, c and N as compiled CasADi functions of (t, q, p)."""

    phi: ca.Function
    rows: ca.Function

    def positions(self, t: float, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """φ and its Jacobian in q."""
        phi, jacobian = self.phi(t, q, p)
        return np.asarray(phi).ravel(), np.asarray(jacobian)

    def velocities(self, t: float, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A (nc × nv), c, N (nq × nv)."""
        A, c, N = self.rows(t, q, p)
        return np.asarray(A), np.asarray(c).ravel(), np.asarray(N)


def kinematics(system: System) -> Kinematics:
    arguments = [system.t, system.q, system.p]
    phi = ca.Function("phi", arguments, [ca.densify(system.phi), ca.densify(ca.jacobian(system.phi, system.q))])
    rows = ca.Function("rows", arguments, [ca.densify(x) for x in (system.A, system.c, system.N)])
    return Kinematics(phi, rows)


def states(system: System, count: int, seed: int = 0, spread: float = 1.0, parameters: float = 0.0) -> States:
    """`count` admissible states around the model's initial values; fewer where the constraints cannot be met.

    Angles vary by ±spread·π, lengths by ±spread·(½ + |value|/2) m; parameters by the relative amount `parameters`. States in
    which A has not the rank it has elsewhere, or all but loses it, are left out.
    """
    rng = np.random.default_rng(seed)
    search = _search(system, rng, spread, parameters)
    pilots = [search.rows(s) for s in (search.closed_state() for _ in range(PILOTS)) if s is not None]
    lengths = np.max([np.linalg.norm(A, axis=1) for A in pilots], axis=0) if pilots else np.zeros(0)
    rank = max((_rank(A, lengths) for A in pilots), default=0)
    found = [s for s in (search.regular_state(lengths, rank) for _ in range(count)) if s is not None]
    columns = list(zip(*found)) if found else [[] for _ in range(5)]
    sizes = (system.q.numel(), system.v.numel(), system.u.numel(), system.p.numel())
    arrays = [np.array(x, dtype=float).reshape(len(found), n) for x, n in zip(columns[1:], sizes)]
    return States(np.array(columns[0], dtype=float), *arrays)


def _search(system: System, rng: np.random.Generator, spread: float, vary: float) -> Search:
    moving = ca.depends_on(_everything(system), system.t)
    spread = spread / (1 + system.phi.numel() / 8) ** 0.5  # far starts of many loops end where loops lie flat
    return Search(system, kinematics(system), nominal(system), rng, spread, vary, moving)


Sample = tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Search:
    """Everything a random state is drawn from."""

    system: System
    solver: Kinematics
    centre: np.ndarray
    rng: np.random.Generator
    spread: float
    vary: float
    moving: bool

    def closed_state(self) -> Sample | None:
        """The first of a few random starts that can be closed, nearer to the centre with every failure."""
        for attempt in range(TRIES):
            found = self.attempt(self.spread * 0.8 ** (attempt // 4))
            if found is not None:
                return found
        return None

    def regular_state(self, lengths: np.ndarray, rank: int) -> Sample | None:
        """A closed state in which A has the given rank."""
        for _ in range(TRIES):
            found = self.closed_state()
            if found is None or _rank(self.rows(found), lengths) == rank:
                return found
        return None

    def rows(self, sample: Sample) -> np.ndarray:
        """A at a state."""
        t, q, _, _, p = sample
        return self.solver.velocities(t, q, p)[0]

    def attempt(self, spread: float) -> Sample | None:
        system, rng = self.system, self.rng
        t = rng.uniform(0.0, 2.0) if self.moving else 0.0
        p = np.array(system.parameters) * (1 + self.vary * rng.uniform(-1, 1, len(system.parameters)))
        start = normalised(system, self.centre + _scatter(system, self.centre, rng, spread))
        q = closed(self.solver, t, start, p)
        if q is not None and system.quaternions:  # a constraint may speak of a quaternion's components
            q = closed(self.solver, t, normalised(system, q), p)
        if q is None:
            return None
        return t, q, _velocity(self.solver, t, q, p, rng), rng.normal(size=system.u.numel()), p


def _rank(A: np.ndarray, lengths: np.ndarray) -> int:
    """Directions of A that are there with some strength, rows measured by their usual lengths."""
    return int(np.linalg.matrix_rank(A / np.where(lengths > 0, lengths, 1.0)[:, None], tol=WEAK)) if A.size else 0


def nominal(system: System) -> np.ndarray:
    """The coordinates the model file starts from, guesses included, zero where nothing is said."""
    names = {x.name: x.value for x in system.model.parameters} | {"t": 0.0}
    given = {x.name: number(x.value, names) for x in system.model.initial}
    return normalised(system, np.array([given.get(c.name, 0.0) for c in system.model.coordinates]))


def normalised(system: System, q: np.ndarray) -> np.ndarray:
    """q with its quaternions divided by their length; a zero one becomes (1, 0, 0, 0)."""
    result = q.copy()
    for i in system.quaternions:
        length = float(np.linalg.norm(q[i : i + 4]))
        result[i : i + 4] = q[i : i + 4] / length if length > 0 else (1.0, 0.0, 0.0, 0.0)
    return result


def _everything(system: System) -> ca.SX:
    return ca.vertcat(system.phi, system.c, ca.vec(ca.densify(system.A)), system.h, system.Q, system.V, system.qdot)


def _scatter(system: System, centre: np.ndarray, rng: np.random.Generator, spread: float) -> np.ndarray:
    width = np.array([np.pi if c.unit == "rad" else 0.5 + abs(x) / 2 for c, x in zip(system.model.coordinates, centre)])
    return spread * width * rng.uniform(-1, 1, len(centre)) if len(centre) else np.zeros(0)


def closed(solver: Kinematics, t: float, q: np.ndarray, p: np.ndarray, free: np.ndarray | None = None) -> np.ndarray | None:
    """q moved onto φ = 0 by damped Gauss–Newton in the `free` coordinates, or None where that fails."""
    weights = np.ones(len(q)) if free is None else free.astype(float)
    for _ in range(NEWTON):
        phi, J = solver.positions(t, q, p)
        if not np.all(np.isfinite(phi)):
            return None
        scale = 1.0 + float(np.max(np.abs(q), initial=0.0))
        if np.max(np.abs(phi), initial=0.0) <= CLOSED * scale:
            return q
        step = -weights * np.linalg.lstsq(J * weights, phi, rcond=1e-10)[0]
        q = q + step * min(1.0, 0.7 * scale / (1e-300 + float(np.max(np.abs(step), initial=0.0))))
    return None


def _velocity(solver: Kinematics, t: float, q: np.ndarray, p: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    A, c, _ = solver.velocities(t, q, p)
    v = rng.normal(size=A.shape[1])
    return v - np.linalg.lstsq(A, A @ v - c, rcond=1e-10)[0] if len(c) else v
