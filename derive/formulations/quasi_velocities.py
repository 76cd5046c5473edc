"""Equations of motion in quasi-velocities, without multipliers (Mirtaheri & Zohoor; Maggi; Kane).

With v = S w + v₀ and v̇ = S ẇ + σ, projecting M v̇ + h = Q + Aᵀ λ on the columns of S (A S = 0) leaves
    (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ).
Both sides can be gathered link by link, from the links' twists as forms in w (Kane's partial velocities), or joint by joint
(composite bodies, Newton–Euler from tip to base, then Sᵀ). Which is cheaper depends on the model: both are counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product as combinations

import casadi as ca

from derive.expressions.counting import operations
from derive.formulations.reduction import Reduction
from derive.joints.records import Matrix, Scalar, Vector
from derive.joints.rotations import dot
from derive.mechanics.forms import Form
from derive.mechanics.motion import Numbers
from derive.mechanics.records import Named, System
from derive.mechanics.solve import ldl_solution, scalars
from derive.mechanics.system import bias_rates
from derive.mechanics.tree import Wrench, gravities, ground_rotations, inertia_force, joint_forces, momentum, twists


@dataclass(frozen=True)
class Explicit:
    """q̇, ẇ and v̇ over (t, q, w, u, p), with the reduced mass matrix and force they come from."""

    qdot: ca.SX
    wdot: ca.SX
    vdot: ca.SX
    mass: ca.SX
    force: ca.SX
    operations: int
    gathered: str

    def named(self, reduction: Reduction) -> tuple[Named, ...]:
        """What the generated code names its sections after."""
        return (
            Named("S", "base velocities per quasi-velocity, v = S w + R c", reduction.S),
            Named("v", "base velocities", reduction.v),
            Named("sigma", "v̇ where ẇ = 0", reduction.sigma),
            Named("M_w", "mass matrix of the quasi-velocities, Sᵀ M S", self.mass),
            Named("f_w", "right-hand side, Sᵀ (Q − h − M σ)", self.force),
        )


def explicit(system: System, reduction: Reduction) -> Explicit:
    """The explicit equations, gathered in the way that needs the fewest operations."""
    masses, forces = _masses(system, reduction), _forces(system, reduction)
    found = [_solved(system, reduction, f"{a}, {b}", masses[a], forces[b]) for a, b in combinations(masses, forces)]
    return min(found, key=lambda x: x.operations)


def _solved(system: System, reduction: Reduction, gathered: str, mass: Matrix, force: Vector) -> Explicit:
    nw = len(force)
    wdot = _column(ldl_solution(mass, [force], list(reversed(range(nw)))).x[0])
    qdot = ca.substitute(system.qdot, system.v, reduction.v)
    symbols = [system.t, system.q, reduction.w, system.u, system.p]
    return Explicit(
        qdot=qdot,
        wdot=wdot,
        vdot=ca.mtimes(reduction.S, wdot) + reduction.sigma,
        mass=_sparse(mass),
        force=_column(force),
        operations=operations(symbols, [qdot, wdot]),
        gathered=gathered,
    )


def _column(entries: Vector) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)


def _sparse(rows: Matrix) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows]) if rows else ca.SX(0, 0)


def _masses(system: System, reduction: Reduction) -> dict[str, Matrix]:
    """Sᵀ M S, by joints and, where the walk gave twists as forms, by links."""
    result = {"mass matrix by joints": scalars(_symmetric_product(reduction.S, system.M))}
    if reduction.walked is not None and system.links:
        result["mass matrix by links"] = _mass_by_links(system, reduction)
    return result


def _symmetric_product(S: ca.SX, M: ca.SX) -> ca.SX:
    return ca.mtimes(S.T, ca.mtimes(M, S))


def _forces(system: System, reduction: Reduction) -> dict[str, Vector]:
    """Sᵀ (Q − h − M σ), likewise."""
    motion = _motion(system, reduction)
    wrenches = _wrenches(system, *motion)
    Q = _at(system, reduction, system.Q - system.h_extra) - ca.mtimes(system.M_extra, reduction.sigma)
    inertial = _column(joint_forces(system.links, wrenches, system.v.numel()))
    by_joints = ca.mtimes(reduction.S.T, Q - inertial)
    result = {"forces by joints": [by_joints[k] for k in range(by_joints.numel())]}
    if reduction.walked is not None and system.links:
        applied = ca.mtimes(reduction.S.T, Q)
        by_links = _force_by_links(reduction, wrenches)
        result["forces by links"] = [applied[k] - by_links[k] for k in range(len(by_links))]
    return result


def _at(system: System, reduction: Reduction, expression: ca.SX) -> ca.SX:
    return ca.substitute(expression, system.v, reduction.v)


def _motion(system: System, reduction: Reduction) -> tuple[list[Numbers], list[Numbers]]:
    """Twists and their rates at ẇ = 0 of all links."""
    if reduction.walked is not None:
        return reduction.walked.numbers, reduction.walked.rates
    v = [reduction.v[j] for j in range(reduction.v.numel())]
    sigma = [reduction.sigma[j] for j in range(reduction.sigma.numel())]
    numbers = twists(system.links, v)
    return numbers, bias_rates(system.links, numbers, v, sigma)


def _wrenches(system: System, numbers: list[Numbers], rates: list[Numbers]) -> list[Wrench]:
    down = gravities(system.links, ground_rotations(system.links), system.gravity)
    return [inertia_force(link.inertia, twist, rate, g) for link, twist, rate, g in zip(system.links, numbers, rates, down)]


def _columns(reduction: Reduction, i: int) -> list[Numbers]:
    """Link i's partial velocities: its twist per unit of each quasi-velocity."""
    assert reduction.walked is not None
    omega, velocity = reduction.walked.twists[i]
    return [(_coefficients(omega, k), _coefficients(velocity, k)) for k in range(len(reduction.names))]


def _coefficients(forms: list[Form], k: int) -> Vector:
    return [form.get(("w", k), 0.0) for form in forms]


def _mass_by_links(system: System, reduction: Reduction) -> Matrix:
    nw = len(reduction.names)
    extra = scalars(_symmetric_product(reduction.S, system.M_extra))
    for i, link in enumerate(system.links):
        columns = _columns(reduction, i)
        for a in range(nw):
            n, f = momentum(link.inertia, columns[a])
            for b in range(a + 1):
                extra[a][b] = extra[a][b] + _power(columns[b], (n, f))
    return [[extra[max(a, b)][min(a, b)] for b in range(nw)] for a in range(nw)]


def _force_by_links(reduction: Reduction, wrenches: list[Wrench]) -> Vector:
    result: Vector = [0.0] * len(reduction.names)
    for i, wrench in enumerate(wrenches):
        for k, column in enumerate(_columns(reduction, i)):
            result[k] = result[k] + _power(column, wrench)
    return result


def _power(twist: Numbers, wrench: Wrench) -> Scalar:
    return dot(twist[0], wrench[0]) + dot(twist[1], wrench[1])
