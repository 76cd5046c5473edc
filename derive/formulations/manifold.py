"""What keeps a simulation on the constraints, on its branch and within one piece of the forces, on
request: the constraints with their Jacobians, guards, and kinks."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.choices.survey import Survey
from derive.expressions.scalars import Scalar, Vector
from derive.formulations.multipliers import bordered_solution
from derive.formulations.records import Argument, Equations, Function, Pattern, Request, Result
from derive.joints.rotations import dot, is_zero
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.kinks import kinks

CLOSURE = (
    "position constraints with Jacobian: [ψ, ∂ψ/∂q] row by row, ψ = independent φ and "
    "lengths of quaternions"
)
SLIP = "velocity constraints with Jacobian: [A v − c, A] row by row, independent rows"
PULL = (
    "what, added to q̇, takes violations of positions to zero at the rate 1/s: N R (−φ), R "
    "from v = S w + R c"
)
ROWS = (
    "entries of A that are not zero by structure, independent rows of A v = c, row by row, over "
    "the usual length of each"
)
GUARDS = (
    "what must not change its sign or vanish on the way: pivots, and how independent the "
    "rows of A are"
)

KINKS = "what changes its sign where forces go on to another piece: a step ends there"


def manifold(equations: Equations, survey: Survey) -> tuple[Request, ...]:
    """Requests for what is there."""
    kept, closing, x = survey.kept, survey.closing, equations.argument("x")
    requests: list[Request] = []
    if closing or equations.system.quaternions:
        requests.append(Request("closure", CLOSURE, lambda: _closure(equations, closing)))
    if kept and keeps_velocities(equations):
        requests.append(Request("slip", SLIP, lambda: _slip(equations, kept, x)))
    if closing and not keeps_velocities(equations):
        requests.append(Request("pull", PULL, lambda: _pull(equations, survey)))
    dynamics = equations.function("dynamics") if equations.has("dynamics") else None
    if dynamics is not None and (dynamics.guards or (kept and keeps_velocities(equations))):
        requests.append(Request("guards", GUARDS, lambda: _guards(equations, kept, dynamics)))
    if kept:
        requests.append(Request("constraint_rows", ROWS, lambda: _rows(equations, survey)))
    if found := kinks(equations.system):
        requests.append(Request("kinks", KINKS, lambda: _kinks(equations, found)))
    return tuple(requests)


def keeps_velocities(equations: Equations) -> bool:
    """The state holds all generalized velocities although they are constrained, so that A v = c can
    drift. In quasi-velocities it holds identically and only φ = 0 can."""
    return bool(equations.system.rows) and equations.generalized_velocities


def _closure(equations: Equations, closing: Sequence[int]) -> Function:
    """[ψ, ∂ψ/∂q], ψ all that ties coordinates to each other: φ and the lengths of quaternions."""
    system = equations.system
    lengths = [ca.sumsqr(system.q[i : i + 4]) - 1 for i in system.quaternions]
    psi = ca.vertcat(*[system.phi[system.rows[i].position] for i in closing], *lengths)
    labels = (
        *(system.rows[i].name for i in closing),
        *(f"quaternion at {i}" for i in system.quaternions),
    )
    return Function("closure", CLOSURE, Result("psi", _with_jacobian(psi, system.q), labels, ()))


def _slip(equations: Equations, kept: Sequence[int], x: Argument) -> Function:
    """[A v − c, A] of the independent rows, rates of φ before nonholonomic rows."""
    system = equations.system
    order = sorted(kept, key=lambda i: system.rows[i].position < 0)  # holonomic rows first
    w = x.symbols[equations.speeds, 0]
    violation = ca.substitute(
        ca.mtimes(system.A[order, :], system.v) - system.c[order], system.v, w
    )
    value = ca.densify(ca.horzcat(violation, system.A[order, :]))
    return Function(
        "slip", SLIP, Result("slip", value, tuple(system.rows[i].name for i in order), ())
    )


def _rows(equations: Equations, survey: Survey) -> Function:
    kept, sizes = survey.kept, _usual_lengths(survey)
    A = ca.sparsify(ca.mtimes(ca.diag(ca.DM(1.0 / sizes)), equations.system.A[list(kept), :]))
    columns, rows = A.T.sparsity().get_triplet()
    names = [equations.system.rows[i].name for i in kept]
    velocities = [velocity.name for velocity in equations.system.model.velocities]
    labels = tuple(f"{names[i]} by {velocities[j]}" for i, j in zip(rows, columns))
    pattern = Pattern(A.shape, tuple(rows), tuple(columns))
    value = ca.densify(ca.vertcat(*[A[i, j] for i, j in zip(rows, columns)]))
    return Function("constraint_rows", ROWS, Result("A", value, labels, (), pattern=pattern))


def _usual_lengths(survey: Survey) -> np.ndarray:
    """The median length of each independent row of A over sampled states, as a power of two:
    dividing by it rounds nothing. A row that vanishes at a singular position stays short beside
    it."""
    s = survey.sampled
    if survey.without_zeros is None:
        rows = survey.solver.rows(s.t, s.q, s.p)[0][:, list(survey.kept)]
        lengths = np.median(np.linalg.norm(rows, axis=2), axis=0)
    else:
        lengths = np.median(survey.solver.velocity_rows(s.t, s.q, s.p)[0].lengths(), axis=0)
    return 2.0 ** np.round(np.log2(np.where(lengths > 0, lengths, 1.0)))


def _pull(equations: Equations, survey: Survey) -> Function:
    """Δ of A Δ = −φ, B Δ = 0 as the least of |A Δ|² + |B Δ|² with A Δ = −φ. Where rows that say
    more than the rates of φ are kept in their place, A Δ = −φ of the latter alone.

    Rows are over their usual lengths: of millions of metres beside radians the squares would leave
    nothing.
    """
    system, kept, closing = equations.system, list(survey.kept), list(survey.closing)
    whole = 1.0 / _usual_lengths(survey)
    A, B = ca.mtimes(ca.diag(ca.DM(whole)), system.A[kept, :]), speed_rows(equations)
    met = kept if set(closing) <= set(kept) else closing
    side = [
        -system.phi[system.rows[i].position] if system.rows[i].position >= 0 else 0.0 for i in met
    ]
    weight = ca.mtimes(B.T, B) + ca.mtimes(A.T, A)
    delta = bordered_solution(weight, system.A[met, :], [0.0] * system.v.numel(), side)
    value = ca.substitute(system.qdot, system.v, ca.vertcat(*delta.x))
    return Function(
        "pull", PULL, Result("pull", value, tuple(c.name for c in system.model.coordinates), ())
    )


def speed_rows(equations: Equations) -> ca.SX:
    """B (nw × nv) of w = B v, from the function that makes states; the unit matrix where no choice
    was made."""
    state = equations.function("state")
    assert state.x is not None
    nq, nv = equations.system.q.numel(), equations.system.v.numel()
    return ca.jacobian(state.result.value[equations.speeds, 0], state.x.symbols[nq : nq + nv, 0])


def _with_jacobian(psi: ca.SX, q: ca.SX) -> ca.SX:
    return ca.densify(ca.horzcat(psi, ca.jacobian(psi, q)))


def _guards(equations: Equations, kept: Sequence[int], dynamics: Function) -> Function:
    values = [guard.value / guard.tolerance for guard in dynamics.guards]
    names = [guard.name for guard in dynamics.guards]
    if keeps_velocities(equations):
        values += [
            ca.SX(x) for x in _independence(scalars(ca.SX(equations.system.A)[list(kept), :]))
        ]
        names += [f"independence of {equations.system.rows[i].name}" for i in kept]
    return Function(
        "guards", GUARDS, Result("guards", ca.densify(ca.vertcat(*values)), tuple(names), ())
    )


def _kinks(equations: Equations, found: Sequence[ca.SX]) -> Function:
    """Over w; neither guarded nor looked at for infinities: a place without a value is no kink."""
    v = equations.function("velocity").result.value
    value = ca.substitute(ca.densify(ca.vertcat(*found)), equations.system.v, v)
    labels = tuple(f"kink {i}" for i in range(1, len(found) + 1))
    return Function("kinks", KINKS, Result("g", value, labels, ("",) * len(found)))


def _independence(rows: list[Vector]) -> list[Scalar]:
    """Of each row from those before it: the length of what is left of it by Gram–Schmidt."""
    done: list[Vector] = []
    ratios: list[Scalar] = []
    for row in rows:
        rest = row
        for unit in done:
            along = dot(unit, rest)
            if not is_zero(along):
                rest = [x if is_zero(e) else x - along * e for x, e in zip(rest, unit)]
        length = ca.sqrt(dot(rest, rest))
        ratios.append(length)
        done.append([0.0 if is_zero(x) else x / length for x in rest])
    return ratios
