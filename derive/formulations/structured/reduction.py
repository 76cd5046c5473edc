"""The slopes through constraints and a choice of quasi-velocities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.formulations.limits import BESIDE, EXACT
from derive.formulations.motion import Minimal, Motion, at_motion
from derive.formulations.structured.displacements import displacements
from derive.formulations.structured.factors import (
    by_factors,
    columns_of,
    entries,
    matrix_of,
    of_sides,
)
from derive.formulations.structured.records import Known, Slopes, rest_of, slopes_of
from derive.formulations.structured.tree import tree_of
from derive.joints.rotations import is_zero, times
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.records import Inertia, System
from derive.mechanics.system import inertial_forces
from derive.states.closing import nominal


def of_reduction(system: System, motion: Motion) -> Iterator[Slopes]:
    """The slopes through constraints and a choice, with ∂v and ∂v̇ in closed form and, as the
    second way, differentiated.

    Where rows that repeat others are combined, E A v̇ = E β is the rate of E A v = E c on the
    constraints alone, so that there is no closed form for every choice. None of them is right where
    S is of rows in which something was left out that vanishes on the constraints.
    """
    minimal = motion.minimal
    if minimal is None or not motion.names or not _is_null_space(system, motion, minimal):
        return
    ways = [_carried, _differentiated]
    if minimal.A.size1() != minimal.lam.numel():
        minimal = replace(minimal, lam=_multipliers(system, motion, minimal))
        ways = [_differentiated]
    for way in ways:
        carried = way(system, motion, minimal)
        for inertias in system.inertias:
            yield _through(system, motion, minimal, carried, inertias)


def _is_null_space(system: System, motion: Motion, of: Minimal) -> bool:
    """Whether A S = 0 beside the constraints, too."""
    if motion.frame is not None:  # S is a basis at the frame's own place
        return True
    product = ca.mtimes(of.A, of.S)
    sizes = ca.mtimes(ca.fabs(of.A), ca.fabs(of.S))
    at = ca.Function("AS", [system.t, system.q, system.v, system.p], [product, sizes])
    rng, q = np.random.default_rng(0), nominal(system)
    beside = q + BESIDE * rng.uniform(-1, 1, len(q)) * np.maximum(1.0, np.abs(q))
    v = rng.normal(size=system.v.numel())
    off, size = (x.full() for x in at(0.3, beside, v, system.parameters))
    return not np.max(np.abs(off), initial=0.0) > EXACT * np.max(size, initial=0.0)


def _multipliers(system: System, motion: Motion, of: Minimal) -> ca.SX:
    """λ = Rᵀ (M v̇ + h − Q), of the rows that stand for all."""
    forces = inertial_forces(system, motion.vdot) + ca.mtimes(system.M_extra, motion.vdot)
    missing = forces + system.h_extra - system.Q
    return ca.mtimes(of.R.T, at_motion(system, motion, missing))


@dataclass(frozen=True)
class _Carried:
    """Of v and v̇ at held ẇ: ∂v/∂q, ∂v̇/∂q and ∂v̇/∂w. `along`: what of the last two is S times it,
    which M_w takes off again."""

    v_by_q: ca.SX
    by_q: ca.SX
    by_w: ca.SX
    along_q: ca.SX
    along_w: ca.SX


def _carried(system: System, motion: Motion, of: Minimal) -> _Carried:
    """Y ∂v = [∂c − ∂(A v); −∂(B v)] and the same of Y v̇ = [β; ẇ − Ḃ v]."""
    q, v, vdot = system.q, system.v, ca.SX.sym("vdot", system.v.numel())
    turning = ca.jtimes(ca.mtimes(motion.B, v), ca.vertcat(system.t, q), ca.vertcat(1, system.qdot))

    def at(expression: ca.SX) -> ca.SX:
        there = ca.substitute(expression, vdot, motion.vdot)
        return ca.sparsify(at_motion(system, motion, there))

    Av, Bv = (ca.jacobian(ca.mtimes(x, v), q) for x in (of.A, motion.B))
    Aa, Ba = (ca.jacobian(ca.mtimes(x, vdot), q) for x in (of.A, motion.B))
    v_by_q = ca.mtimes(of.R, at(ca.jacobian(of.c, q) - Av)) - ca.mtimes(of.S, at(Bv))
    beta_v, turning_v = at(ca.jacobian(of.beta, v)), at(ca.jacobian(turning, v))
    across_q = at(ca.jacobian(of.beta, q) - Aa) + ca.mtimes(beta_v, v_by_q)
    along_q = -at(Ba + ca.jacobian(turning, q)) - ca.mtimes(turning_v, v_by_q)
    return _Carried(
        ca.sparsify(v_by_q),
        ca.sparsify(ca.mtimes(of.R, across_q)),
        ca.sparsify(ca.mtimes(of.R, ca.mtimes(beta_v, of.S))),
        ca.sparsify(along_q),
        ca.sparsify(-ca.mtimes(turning_v, of.S)),
    )


def _differentiated(system: System, motion: Motion, of: Minimal) -> _Carried:
    """As S and σ are written."""
    nw = len(motion.names)
    wdot = ca.SX.sym("wdot", nw)
    vdot = ca.mtimes(of.S, wdot) + of.sigma
    by_q, by_w = (
        ca.sparsify(ca.substitute(ca.jacobian(vdot, x), wdot, motion.wdot))
        for x in (system.q, motion.w)
    )
    nothing = ca.SX(nw, system.q.numel()), ca.SX(nw, nw)
    return _Carried(ca.jacobian(motion.v, system.q), by_q, by_w, *nothing)


def _through(
    system: System,
    motion: Motion,
    of: Minimal,
    carried: _Carried,
    inertias: Sequence[Inertia],
) -> Slopes:
    """M_w ∂ẇ = −Sᵀ (∂τ/∂q − ∂(Aᵀλ)/∂q + ∂τ/∂v ∂v + M ∂v̇)."""
    M, by_q, by_v = _tree_slopes(system, motion, inertias)
    rest = rest_of(system, motion, entries(motion.vdot))
    held = ca.SX.sym("lam", of.A.size1())
    turned = ca.jacobian(ca.mtimes(of.A.T, held), system.q)
    turned = at_motion(system, motion, ca.substitute(turned, held, of.lam))
    by_q, by_v = by_q + rest.by_q - turned, by_v + rest.by_v
    r_q = by_q + ca.mtimes(by_v, carried.v_by_q) + ca.mtimes(M, carried.by_q)
    r_w = ca.mtimes(by_v, of.S) + ca.mtimes(M, carried.by_w)
    sides = ca.sparsify(ca.mtimes(of.S.T, -ca.horzcat(r_q, r_w, rest.by_u)))
    solutions = of_sides(scalars(of.mass), columns_of(scalars(sides)), by_factors)
    nq, nw = system.q.numel(), len(motion.names)
    wdot_q, wdot_w = (
        solutions[:, :nq] - carried.along_q,
        solutions[:, nq : nq + nw] - carried.along_w,
    )
    known = Known(motion.wdot, wdot_q, wdot_w, solutions[:, nq + nw :], carried.v_by_q)
    return slopes_of(system, motion, known)


def _tree_slopes(
    system: System, motion: Motion, inertias: Sequence[Inertia]
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M, and of the links alone ∂(M v̇ + h)/∂q and ∂h/∂v."""
    tree = tree_of(system, motion, inertias, ())
    M, H = tree.masses()
    D = tree.displacements(entries(motion.vdot))
    way = at_motion(system, motion, displacements(system))
    doubled = [[0.0 if is_zero(x) else times(2.0, x) for x in row] for row in H]
    nv = system.v.numel()
    mass = matrix_of(M, nv) + at_motion(system, motion, system.M_extra)
    return mass, ca.mtimes(matrix_of(D, nv), way), matrix_of(doubled, nv)
