"""The augmented system [M Aᵀ; A 0] [q̈; −λ] = [f; γ] by Lagrange's equations in CasADi, derived
here and not by hamel.

Written as C by CasADi's generator: with an LDLᵀ unrolled over the structural nonzeros, or with
CasADi's own sparse one (MX).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from peers.casadi_c import Read, of_function
from peers.contest import Contender

G = 9.81


@dataclass(frozen=True)
class Lagrangian:
    """Kinetic and potential energy, forces, and rows A(q) q̇ = 0; `order`: of elimination,
    coordinates then rows numbered on."""

    name: str
    q: ca.SX
    qd: ca.SX
    u: ca.SX
    T: ca.SX
    V: ca.SX
    Q: ca.SX
    A: ca.SX
    order: tuple[int, ...]
    relative: ca.SX | None = None  # angles and rates between neighbours, in place of absolute ones

    def function(self, name: str, found: ca.SX) -> ca.Function:
        """q̈ from (q, q̇, u)."""
        if self.relative is None:
            return ca.Function(name, [ca.vertcat(self.q, self.qd, self.u)], [found])
        n = self.q.numel()
        sums = [ca.cumsum(self.relative[:n]), ca.cumsum(self.relative[n:])]
        absolute = ca.substitute(found, ca.vertcat(self.q, self.qd), ca.vertcat(*sums))
        return ca.Function(name, [self.relative], [ca.vertcat(absolute[0], ca.diff(absolute))])

    def parts(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """M, f and γ."""
        momentum = ca.gradient(self.T, self.qd)
        M = ca.jacobian(momentum, self.qd)
        f = self.Q - ca.jtimes(momentum, self.q, self.qd) + ca.gradient(self.T - self.V, self.q)
        return M, f, -ca.jtimes(ca.mtimes(self.A, self.qd), self.q, self.qd)

    @property
    def input(self) -> ca.SX:
        return ca.vertcat(self.q, self.qd, self.u)


def rod(m: float, J: float, at: ca.SX, turn: ca.SX, q: ca.SX, qd: ca.SX) -> ca.SX:
    """Kinetic energy of a body in the plane."""
    v = ca.jtimes(at, q, qd)
    return (m * ca.dot(v, v) + J * ca.jtimes(turn, q, qd) ** 2) / 2


def four_bar() -> Lagrangian:
    l1, l2, l3, l4, m1, m2, m3 = 0.20, 0.50, 0.40, 0.55, 1.0, 2.5, 2.0
    q, qd, u = ca.SX.sym("q", 3), ca.SX.sym("qd", 3), ca.SX.sym("u")
    turns = (q[0], q[0] + q[1], q[2])
    B = l1 * _along(turns[0])
    centres = (
        l1 / 2 * _along(turns[0]),
        B + l2 / 2 * _along(turns[1]),
        ca.vertcat(l4, 0) + l3 / 2 * _along(turns[2]),
    )
    masses, lengths = (m1, m2, m3), (l1, l2, l3)
    T = sum(
        rod(m, m * l**2 / 12, c, turn, q, qd)
        for m, l, c, turn in zip(masses, lengths, centres, turns)
    )
    V = sum(m * G * c[1] for m, c in zip(masses, centres))
    closing = B + l2 * _along(turns[1]) - ca.vertcat(l4, 0) - l3 * _along(turns[2])
    Q = ca.vertcat(u, 0, -0.01 * qd[2])
    return Lagrangian("four_bar", q, qd, u, T, V, Q, ca.jacobian(closing, q), (0, 1, 2, 3, 4))


def snake3() -> Lagrangian:
    l, m, J = 0.3, 1.0, 0.0075
    q, qd, u = ca.SX.sym("q", 5), ca.SX.sym("qd", 5), ca.SX.sym("u", 2)
    turns = (q[2], q[2] + q[3], q[2] + q[3] + q[4])
    centres = [q[:2]]
    for before, after in itertools.pairwise(turns):
        centres.append(centres[-1] - l / 2 * (_along(before) + _along(after)))
    T = sum(rod(m, J, c, turn, q, qd) for c, turn in zip(centres, turns))
    A = ca.vertcat(
        *[
            ca.mtimes(ca.horzcat(-ca.sin(turn), ca.cos(turn)), ca.jacobian(c, q))
            for c, turn in zip(centres, turns)
        ]
    )
    return Lagrangian("snake3", q, qd, u, T, ca.SX(0), ca.vertcat(0, 0, 0, u), A, tuple(range(8)))


def four_bars(n: int) -> Lagrangian:
    """IFToMM A02 with n four-bars; coordinates crank 0, then rod and crank of each four-bar."""
    q, qd = ca.SX.sym("q", 2 * n + 1), ca.SX.sym("qd", 2 * n + 1)
    T, V, rows, order = 0, 0, [], []
    for i in range(n + 1):
        crank, centre = q[2 * i], ca.vertcat(i, 0) + _along(q[2 * i]) / 2
        T, V = T + rod(1.0, 1 / 12, centre, crank, q, qd), V + G * centre[1]
        if i == n:
            break
        B, turn = ca.vertcat(i, 0) + _along(crank), crank + q[2 * i + 1]
        T, V = (
            T + rod(1.0, 1 / 12, B + _along(turn) / 2, turn, q, qd),
            V + G * (B + _along(turn) / 2)[1],
        )
        rows.append(B + _along(turn) - ca.vertcat(i + 1, 0) - _along(q[2 * i + 2]))
        order += [2 * i, 2 * i + 1, 2 * n + 1 + 2 * i, 2 * n + 2 + 2 * i]
    A = ca.jacobian(ca.vertcat(*rows), q)
    return Lagrangian(
        f"four_bars{n}", q, qd, ca.SX(0, 1), T, V, ca.SX.zeros(2 * n + 1), A, (*order, 2 * n)
    )


def chain(n: int) -> Lagrangian:
    """A planar pendulum of n equal links; solved in absolute angles, the cheapest, with relative
    ones in and out."""
    q, qd, relative = ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("in", 2 * n)
    T, V, tip = 0, 0, ca.SX.zeros(2)
    for i in range(n):
        centre, tip = tip + _along(q[i]) / 2, tip + _along(q[i])
        T, V = T + rod(1.0, 0.08, centre, q[i], q, qd), V + G * centre[1]
    return Lagrangian(
        f"chain{n}",
        q,
        qd,
        ca.SX(0, 1),
        T,
        V,
        ca.SX.zeros(n),
        ca.SX(0, n),
        tuple(reversed(range(n))),
        relative,
    )


def bodies(n: int, inputs: np.ndarray, read: Read) -> list[Contender]:
    """The same chain with three coordinates for every link and multipliers at every joint: more
    unknowns, but no fill-in."""
    q, qd, relative = ca.SX.sym("q", 3 * n), ca.SX.sym("qd", 3 * n), ca.SX.sym("in", 2 * n)
    T, V, tip, rows, order = 0, 0, ca.SX.zeros(2), [], []
    for i in range(n):
        centre, half = q[3 * i + 1 : 3 * i + 3], 0.5 * _along(q[3 * i])
        T, V = T + rod(1.0, 0.08, centre, q[3 * i], q, qd), V + G * centre[1]
        rows.append(centre - half - tip)
        tip = centre + half
        order = [3 * i + 1, 3 * i + 2, 3 * i, 3 * n + 2 * i, 3 * n + 2 * i + 1, *order]
    A = ca.jacobian(ca.vertcat(*rows), q)
    found = _accelerations(
        Lagrangian("bodies", q, qd, ca.SX(0, 1), T, V, ca.SX.zeros(3 * n), A, tuple(order))
    )[::3]
    angles = ca.vertcat(q[::3], qd[::3])
    absolute = ca.substitute(
        found, angles, ca.vertcat(ca.cumsum(relative[:n]), ca.cumsum(relative[n:]))
    )
    out = ca.cse(ca.vertcat(absolute[0], ca.diff(absolute)))
    return of_function(
        "augmented, CasADi SX", f"chain{n}", ca.Function("bodies", [relative], [out]), inputs, read
    )


def _along(angle: ca.SX) -> ca.SX:
    return ca.vertcat(ca.cos(angle), ca.sin(angle))


def unrolled(
    of: Lagrangian, inputs: np.ndarray, read: Read, shared: bool = False
) -> list[Contender]:
    """LDLᵀ without its zeros; `shared`: after CasADi's elimination of common subexpressions."""
    out = _accelerations(of)
    name = "augmented_cse" if shared else "augmented"
    function = of.function(name, ca.cse(out) if shared else out)
    return of_function("augmented, CasADi SX", of.name, function, inputs, read)


def _accelerations(of: Lagrangian) -> ca.SX:
    M, f, gamma = of.parts()
    K = ca.vertcat(ca.horzcat(M, of.A.T), ca.horzcat(of.A, ca.SX(of.A.size1(), of.A.size1())))
    return ca.vertcat(*solution(K, ca.vertcat(f, gamma), of.order)[: of.q.numel()])


def solution(K: ca.SX, b: ca.SX, order: Sequence[int]) -> list[ca.SX]:
    """K⁻¹ b for a symmetric K, pivots in the given order."""
    n = len(order)
    rows = [
        {j: K[order[i], order[j]] for j in range(i + 1) if K.sparsity().has_nz(order[i], order[j])}
        for i in range(n)
    ]
    y, inverse, factors = [b[row] for row in order], [], []
    for k in range(n):
        inverse.append(1 / rows[k][k])
        below = [i for i in range(k + 1, n) if k in rows[i]]
        factors.append({i: rows[i][k] * inverse[k] for i in below})
        for i in below:
            for j in [j for j in below if j <= i]:
                rows[i][j] = rows[i].get(j, 0) - factors[k][i] * rows[j][k]
            y[i] = y[i] - factors[k][i] * y[k]
    x = [y[k] * inverse[k] for k in range(n)]
    for k in reversed(range(n)):
        for i, factor in factors[k].items():
            x[k] = x[k] - factor * x[i]
    return [x[order.index(row)] for row in range(n)]


def sparse(of: Lagrangian, inputs: np.ndarray, read: Read) -> list[Contender]:
    """The parts as one SX function, solved by CasADi's own sparse LDLᵀ in an MX function."""
    M, f, gamma = of.parts()
    size = of.A.size1()
    K = ca.vertcat(ca.horzcat(M, of.A.T), ca.horzcat(of.A, ca.SX(size, size)))
    parts = ca.Function("parts", [of.input], [K, ca.vertcat(f, gamma)])
    given = ca.MX.sym("in", of.input.numel())
    matrix, right = parts(given)
    order = list(of.order)
    solver = ca.Linsol(
        "solver", "ldl", matrix[order, order].sparsity(), {"preordering": False}
    )  # its own order meets pivots of zero
    found = solver.solve(matrix[order, order], right[order])
    function = ca.Function(
        "augmented_mx", [given], [ca.vertcat(*[found[order.index(i)] for i in range(of.q.numel())])]
    )
    return of_function("augmented, CasADi MX", of.name, function, inputs, read)
