"""The linear equations [A B; C D] in minimal states: against differences along the constraints, and
against the unreduced ones.

The equations hold along every motion, so they are looked at wherever the states are. Tangents of
the constraint surface are the reference's, and the functions that are differentiated are held to
the reference by the other checks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations.records import Equations, Function
from derive.linearize import linear, study
from derive.linearize.minimal import linearization
from derive.linearize.records import Linear
from derive.linearize.steady import motion_of
from derive.linearize.unreduced import constraint_counts, unreduced
from derive.states.initial import initial_state
from hamel.verify.checks.check import Check
from hamel.verify.checks.code import NEARLY
from hamel.verify.checks.compare import slope, worst
from hamel.verify.checks.evidence import Evidence, Row, Sample
from hamel.verify.checks.motion import best_conditioned
from hamel.verify.limits import FLOOR
from hamel.verify.reference.vectors import Array

NAME = "linearization"
JACOBIANS = {
    "jacobian_t": 0,
    "jacobian": 1,
    "jacobian_u": 2,
    "jacobian_p": 3,
}  # of ẋ by which argument
MOST = 80  # states of a model that is linearised without being asked
SEEN = 5  # of the sampled states
STEP = 1e-3  # in the model's own units
# tolerance of what is differentiated by differences; ten times what two step sizes disagree by is
# no error
DIFFERENCES = 1e-7
NEXT_TO_NOTHING = 1e-3
# in the model's own units: a steady motion there says nothing, for rounding is all that is left of
# a length
FAR = 1e3
FREE = 1.0  # what a free name of a steady motion is, where nothing says what


def with_linearization(equations: Equations) -> Equations:
    """The equations with `linearization` among the functions, where they are minimal and not too
    many."""
    known = {function.name for function in equations.functions}
    if (
        NAME in known
        or equations.formulation != "quasi_velocities"
        or equations.arguments[1].symbols.numel() > MOST
    ):
        return equations
    try:
        return replace(equations, functions=(*equations.functions, linearization(equations)))
    except (
        AssumptionError,
        ModelError,
    ):  # no initial configuration to choose the dependent coordinates at
        return equations


def along_constraints(e: Evidence) -> float | None:
    """Each column of [A B; C D] against differences of (ẋ, y) along the tangent that moves one
    state, or one input."""
    if not e.graph.has(NAME):
        return None
    errors = [error for k in _regular(e, NAME) for error in _columns(e, k)]
    return worst(errors) if errors else None


def _regular(e: Evidence, name: str) -> list[int]:
    """Some states that no guard refuses, the best conditioned ones."""
    margins = e.graph.margins(name, e.rows_of(name), e.real)
    return [k for k in best_conditioned(e) if margins[k] > NEARLY][:SEEN]


def _columns(e: Evidence, k: int) -> Iterator[float]:
    function, s, x = _function(e), e.samples[k], e.x[k]
    argument = e.graph.equations.arguments[1]
    independent = [argument.labels.index(name) for name in _states(function, argument.labels)]
    directions = [
        (_tangent(e, s, independent, j), np.zeros_like(s.u), e.units.x[j]) for j in independent
    ]
    directions += [
        (np.zeros_like(x), row, unit) for row, unit in zip(np.eye(len(s.u)), _input_units(e))
    ]
    found = np.array(e.graph.functions[NAME](s.t, x, s.u, s.p))
    rows = np.concatenate([e.units.x[independent] / e.units.time, _output_units(e)])

    def values(dx: Array, du: Array) -> Array:
        xdot = e.graph("dynamics", s.t, x + dx, s.u + du, s.p)[independent]
        return np.append(
            xdot, e.graph("outputs", s.t, x + dx, s.u + du, s.p) if e.graph.has("outputs") else []
        )

    here = values(np.zeros_like(x), np.zeros_like(s.u))
    for column, (dx, du, unit) in zip(found.T, directions):
        wanted, doubt = slope(
            lambda h, dx=dx, du=du, unit=unit: values(h * unit * dx, h * unit * du), STEP
        )
        yield _error(column * unit / rows, wanted / rows, doubt / rows, here / rows)


def _error(got: Array, wanted: Array, doubt: Array, here: Array) -> float:
    """Against the size of the column or, where that is next to nothing, of what is differentiated:
    `here`."""
    size = (
        np.abs(wanted)
        + FLOOR * np.max(np.abs(wanted), initial=0.0)
        + NEXT_TO_NOTHING * (1.0 + np.abs(here))
    )
    return worst((got - wanted) / (size + 10.0 * doubt / DIFFERENCES))


def _function(e: Evidence) -> Function:
    return next(f for f in e.graph.equations.functions if f.name == NAME)


def _states(function: Function, labels: tuple[str, ...]) -> list[str]:
    """The minimal states by name: rows of A are their rates."""
    rates = {f"der({name})": name for name in labels}
    count = function.result.value.size1()
    return [rates[label] for label in function.result.labels[:count] if label in rates]


def _input_units(e: Evidence) -> Array:
    return e.units.own.all_of(x.unit for x in e.reference.model.inputs)


def _output_units(e: Evidence) -> Array:
    function = next((f for f in e.graph.equations.functions if f.name == "outputs"), None)
    return np.zeros(0) if function is None else e.units.of(function)


def _tangent(e: Evidence, s: Sample, independent: list[int], j: int) -> Array:
    """δx that moves the independent state j by one and no other, on the constraints by the
    reference: δq = N δv, A_h δv = 0."""
    nq, k = len(s.q), s.outcome.kinematics
    result = np.zeros(nq + len(e.units.w))
    if j >= nq:
        result[j] = 1.0
        return result
    positions = [i for i in independent if i < nq]
    holonomic = [row for row, about in enumerate(e.system.rows) if about.position >= 0]
    system = np.vstack([(k.A / e.units.A)[holonomic], (k.N / e.units.N)[positions]])
    wanted = np.concatenate([np.zeros(len(holonomic)), [float(i == j) for i in positions]])
    dv = np.linalg.lstsq(system, wanted, rcond=None)[0]
    result[:nq] = (k.N / e.units.N) @ dv * e.units.q / e.units.q[j]
    return result


def along_axes(e: Evidence) -> float | None:
    """Jacobians of ẋ by t, x, u and p, where the module has them, against differences."""
    names = [name for name in JACOBIANS if e.graph.has(name)]
    errors = [_jacobian(e, name, k) for name in names for k in _regular(e, name)]
    return worst(errors) if errors else None


def _jacobian(e: Evidence, name: str, k: int) -> float:
    s, x = e.samples[k], e.x[k]
    place = [np.array([s.t]), x, s.u, s.p]
    slot = JACOBIANS[name]
    units = (
        np.array([e.units.time]),
        e.units.x,
        _input_units(e),
        np.where(s.p == 0.0, 1.0, np.abs(s.p)),
    )[slot]
    found = e.graph(name, s.t, x, s.u, s.p).reshape(len(x), -1)
    rows = e.units.x / e.units.time

    def values(direction: Array) -> Array:
        moved = [*place[:slot], place[slot] + direction, *place[slot + 1 :]]
        return e.graph("dynamics", float(moved[0][0]), *moved[1:])

    errors, here = [], values(np.zeros_like(units))
    for column, direction, unit in zip(found.T, np.diag(units), units):
        wanted, doubt = slope(lambda h, direction=direction: values(h * direction), STEP)
        errors.append(_error(column * unit / rows, wanted / rows, doubt / rows, here / rows))
    return worst(errors)


def unreduced_form(e: Evidence) -> float | None:
    """Along a steady motion: A T = T A_min with A of the multiplier equations.

    Its other eigenvalues are zero, 2 m_h + m_n of them and one per quaternion.
    """
    equations = e.graph.equations
    if not e.graph.has(NAME) or equations.charts:
        return None
    motion = motion_of(equations, None)
    given = {name for name, *_ in motion.ranges}
    try:
        found = study(
            equations, motion, {name: FREE for name in motion.sweepable if name not in given}
        )
        along = found.motions({})
        place = (0.0, along.x[0], along.u[0], along.p[0])
        if (
            e.graph.margins(NAME, [place], e.real)[0] <= NEARLY
            or worst(along.x[0] / e.units.x) > FAR
        ):
            return None
        form = _with_numbers(
            linear(equations, initial_state(e.system).q, np.array(equations.parameters)), e, place
        )
        cyclic = {found.linear.independent[k] for k in found.cyclic}
        other = unreduced(form, along, tuple(j for j in form.independent if j in cyclic))
    except AssumptionError:  # no steady motion, or one where no velocity is constant
        return None
    m_h, m_n = constraint_counts(e.system, place[1][: e.system.q.numel()], place[3])
    return max(
        other.difference, float(abs(other.spurious - 2 * m_h - m_n - len(e.system.quaternions)))
    )


def _with_numbers(form: Linear, e: Evidence, place: Row) -> Linear:
    """The linear form with A as the function says it there."""
    n = len(form.states)
    return replace(form, A=ca.SX(ca.DM(np.array(e.graph.functions[NAME](*place))[:n, :n])))


CHECKS = (
    Check(
        "linearization",
        DIFFERENCES,
        "differences of (ẋ, y) along the reference's tangents, of fourth order",
        along_constraints,
    ),
    Check(
        "linearization, unreduced",
        1e-7,
        "the multiplier equations linearised, 2 m_h + m_n more zeros",
        unreduced_form,
    ),
    Check(
        "Jacobians", DIFFERENCES, "differences of ẋ by t, x, u and p, of fourth order", along_axes
    ),
)
