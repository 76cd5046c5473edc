"""The linear equations [A B; C D] in minimal states: against derivatives along the constraints, and
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

from codegen.reals import FLOAT64
from derive.diagnostics import AssumptionError, ModelError
from derive.expressions.roots import with_finite_slopes
from derive.formulations.evaluate import slots_of
from derive.formulations.records import Equations, Function
from derive.linearize import linear, study
from derive.linearize.minimal import linearization
from derive.linearize.records import Linear
from derive.linearize.steady import motion_of
from derive.linearize.unreduced import constraint_counts, unreduced
from derive.states.initial import initial_state
from hamel.verify.checks.check import Check
from hamel.verify.checks.code import MANY, NEARLY
from hamel.verify.checks.compare import worst
from hamel.verify.checks.duals import tangents
from hamel.verify.checks.evidence import Evidence, Row, margins, roundoff
from hamel.verify.checks.motion import best_conditioned
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import FLOOR
from hamel.verify.reference.vectors import Array

NAME = "linearization"
JACOBIANS = {
    "jacobian_t": 0,
    "jacobian": 1,
    "jacobian_u": 2,
    "jacobian_p": 3,
}  # of ẋ by which argument
ALL, SECOND = "derivatives", "contraction"
FORWARD, ADJOINT = "dynamics_forward", "dynamics_adjoint"
HESSIAN, OF_FORWARD = "dynamics_hessian", "jacobian_forward"
MOST = 80  # states of a model that is linearised without being asked
SEEN = 5  # of the sampled states
# Relative to the column or to a thousandth of what is differentiated: both sides are exact
# derivatives, and rounding is all that they differ by.
EXACT = 1e-9
PER_CONDITION = 1e-3  # … for a condition number of a thousand, and in proportion beyond …
LOOSEST = 1e4  # … up to this factor: an error of 1e-5 is one whatever the condition
UNREDUCED = 1e-7  # two eliminations of the multipliers, each with the condition of M and A in it
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
    """Each column of [A B; C D] against the derivative of (ẋ, y) along the tangent that moves one
    state, or one input."""
    if not e.graph.has(NAME):
        return None
    errors = [error for k in _regular(e, NAME) for error in _columns(e, k)]
    return worst(errors) if errors else None


def _growth(e: Evidence, k: int) -> float:
    """How much rounding may grow beyond what the tolerance is given for: derivatives of what is
    solved for, −M⁻¹ M′ M⁻¹ f, have the condition in them twice."""
    condition = e.conditions[k]
    twice = np.finfo(float).eps * condition**2 / EXACT
    return min(max(1.0, condition * PER_CONDITION, twice), LOOSEST)


def _regular(e: Evidence, name: str) -> list[int]:
    """Some states that no guard refuses, the best conditioned ones."""
    left = margins(e.graph, name, e.rows_of(name), e.real)
    return [k for k in best_conditioned(e) if left[k] > NEARLY][:SEEN]


def _columns(e: Evidence, k: int) -> Iterator[float]:
    """Per column of [A B; C D] its error at one state, rounding allowed for by the condition
    there."""
    function, s, x = _function(e), e.samples[k], e.x[k]
    argument = e.graph.equations.arguments[1]
    independent = [argument.labels.index(name) for name in _states(function, argument.labels)]
    moves = [_tangent(e, s, independent, j) * e.units.x[j] for j in independent]
    inputs = np.diag(_input_units(e))
    directions = np.zeros((len(moves) + len(inputs), 1 + len(x) + len(s.u) + len(s.p)))
    directions[: len(moves), 1 : 1 + len(x)] = np.reshape(moves, (len(moves), len(x)))
    directions[len(moves) :, 1 + len(x) : 1 + len(x) + len(s.u)] = inputs
    rates, results = _along(e, "dynamics", k, directions), _along(e, "outputs", k, directions)
    wanted = np.vstack([rates[independent], results])
    here = e.graph("dynamics", s.t, x, s.u, s.p)[independent]
    if e.graph.has("outputs"):
        here = np.append(here, e.graph("outputs", s.t, x, s.u, s.p))
    rows = np.concatenate([e.units.x[independent] / e.units.time, _output_units(e)])
    units = np.concatenate([e.units.x[independent], _input_units(e)])
    columns = np.array(e.graph.functions[NAME](s.t, x, s.u, s.p))
    told = np.concatenate([np.ones(len(independent), bool), _slopes_exist(e, k)])
    rows, here, columns, wanted = (part[told] for part in (rows, here, columns, wanted))
    for ours, column, unit in zip(columns.T, wanted.T, units):
        yield _error(ours * unit / rows, column / rows, here / rows) / _growth(e, k)


def _slopes_exist(e: Evidence, k: int) -> Array:
    """Which outputs are more than rounding at a state. A distance of points that a closure holds
    together is not, and has no slope there: d√x is dx / (2 √x)."""
    if not e.graph.has("outputs"):
        return np.zeros(0, bool)
    values, lost = (part[k] for part in e.expected["outputs"])
    return (lost == 0.0) | (np.abs(values) > MANY * lost)


def _along(e: Evidence, name: str, k: int, directions: Array) -> Array:
    """The exact derivative of a function of (t, x, u, p) along each direction, one per column."""
    if not e.graph.has(name):
        return np.zeros((0, len(directions)))
    s, equations = e.samples[k], e.graph.equations
    function = equations.function(name)
    place = (np.array([s.t]), e.x[k], s.u, s.p)
    return tangents(slots_of(equations, function), function.result.value, place, directions)


def _error(got: Array, wanted: Array, here: Array, doubt: Array | float = 0.0) -> float:
    """Against the size of the column or, where that is next to nothing, of what is differentiated:
    `here`. What is in `doubt` is no error: sharp bends cancel in their second derivatives."""
    largest = np.max(np.abs(wanted), initial=0.0)
    size = np.abs(wanted) + FLOOR * largest + NEXT_TO_NOTHING * (1.0 + np.abs(here))
    return worst((got - wanted) / (size + doubt / EXACT))


def _function(e: Evidence) -> Function:
    return e.graph.equations.function(NAME)


def _states(function: Function, labels: tuple[str, ...]) -> list[str]:
    """The minimal states by name: rows of A are their rates."""
    rates = {f"der({name})": name for name in labels}
    count = function.result.value.size1()
    return [rates[label] for label in function.result.labels[:count] if label in rates]


def _input_units(e: Evidence) -> Array:
    return e.units.own.all_of(x.unit for x in e.reference.model.inputs)


def _output_units(e: Evidence) -> Array:
    equations = e.graph.equations
    return e.units.of(equations.function("outputs")) if equations.has("outputs") else np.zeros(0)


def _tangent(e: Evidence, s: Sample, independent: list[int], j: int) -> Array:
    """δx that moves the independent state j by one and no other, on the constraints by the
    reference: δq = N δv, A_h δv = 0."""
    nq, k = len(s.q), s.outcome.kinematics
    result = np.zeros(len(e.units.x))
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
    """Jacobians of ẋ by t, x, u and p, where the module has them, against dual numbers."""
    errors = [_own_jacobian(e, name, k) for name in JACOBIANS for k in _states_of(e, name)]
    pairs = [(name, f"{name}_values") for name in JACOBIANS]
    errors += [_own_values(e, *pair, k) for pair in pairs for k in _states_of(e, pair[1])]
    if e.graph.has(ALL):
        errors += [_all_at_once(e, k) for k in _regular(e, ALL)]
    return worst(errors) if errors else None


def _own_jacobian(e: Evidence, name: str, k: int) -> float:
    s, x = e.samples[k], e.x[k]
    ours = e.graph(name, s.t, x, s.u, s.p).reshape(len(x), -1)
    return _jacobian(e, ours, JACOBIANS[name], k)


def _own_values(e: Evidence, name: str, values: str, k: int) -> float:
    """The entries that may differ from zero, put in their places: the others have to be zero."""
    s, x = e.samples[k], e.x[k]
    pattern = e.graph.equations.function(values).result.pattern
    assert pattern is not None, values
    whole = np.zeros(pattern.shape)
    whole[list(pattern.rows), list(pattern.columns)] = e.graph(values, s.t, x, s.u, s.p)
    return _jacobian(e, whole, JACOBIANS[name], k)


def _all_at_once(e: Evidence, k: int) -> float:
    """[ẋ ∂ẋ/∂x ∂ẋ/∂u]: its three parts."""
    s, x = e.samples[k], e.x[k]
    ours = e.graph(ALL, s.t, x, s.u, s.p).reshape(len(x), -1)
    rates, by_x, by_u = np.split(ours, [1, 1 + len(x)], axis=1)
    here = e.graph("dynamics", s.t, x, s.u, s.p)
    unit = e.units.x / e.units.time
    errors = [_error(rates[:, 0] / unit, here / unit, here / unit) / _growth(e, k)]
    errors += [_jacobian(e, part, slot, k) for slot, part in ((1, by_x), (2, by_u)) if part.size]
    return worst(errors)


def _jacobian(e: Evidence, found: Array, slot: int, k: int) -> float:
    s, x = e.samples[k], e.x[k]
    parameters = np.where(s.p == 0.0, 1.0, np.abs(s.p))
    units = (np.array([e.units.time]), e.units.x, _input_units(e), parameters)
    first = sum(len(each) for each in units[:slot])
    directions = np.zeros((len(units[slot]), sum(map(len, units))))
    directions[:, first : first + len(units[slot])] = np.diag(units[slot])
    wanted, rows = _along(e, "dynamics", k, directions), e.units.x / e.units.time
    here = e.graph("dynamics", s.t, x, s.u, s.p) / rows
    errors = zip((found * units[slot]).T, wanted.T)
    worst_error = worst([_error(ours / rows, column / rows, here) for ours, column in errors])
    return worst_error / _growth(e, k)


def products(e: Evidence) -> float | None:
    """∂ẋ/∂(x, u) times a direction and its transpose times a covector, where the module has them,
    against dual numbers."""
    errors = [_forward(e, k) for k in _states_of(e, FORWARD)]
    errors += [_adjoint(e, k) for k in _states_of(e, ADJOINT)]
    return worst(errors) if errors else None


def _states_of(e: Evidence, name: str) -> list[int]:
    """Where that function is looked at; nowhere, if the module is without it."""
    return _regular(e, name) if e.graph.has(name) else []


def _forward(e: Evidence, k: int) -> float:
    s, x = e.samples[k], e.x[k]
    d, _ = _random(e, k)
    wanted = _along(e, "dynamics", k, _by_state_and_input(e, k, d[None]))[:, 0]
    ours = e.graph(FORWARD, s.t, np.concatenate([x, d]), s.u, s.p)
    rows = e.units.x / e.units.time
    here = e.graph("dynamics", s.t, x, s.u, s.p) / rows
    return _error(ours / rows, wanted / rows, here) / _growth(e, k)


def _adjoint(e: Evidence, k: int) -> float:
    s, x, units = e.samples[k], e.x[k], _both_units(e)
    _, y = _random(e, k)
    wanted = y @ _along(e, "dynamics", k, _by_state_and_input(e, k, np.diag(units)))
    ours = e.graph(ADJOINT, s.t, np.concatenate([x, y]), s.u, s.p) * units
    here = y @ e.graph("dynamics", s.t, x, s.u, s.p)
    return _error(ours, wanted, np.full(len(units), here)) / _growth(e, k)


def _both_units(e: Evidence) -> Array:
    """Of (x, u)."""
    return np.concatenate([e.units.x, _input_units(e)])


def _random(e: Evidence, k: int) -> tuple[Array, Array]:
    """A direction of (x, u) and a covector of ẋ, in the model's own units."""
    rng = np.random.default_rng(k)
    y = rng.normal(size=len(e.units.x)) / (e.units.x / e.units.time)
    units = _both_units(e)
    return rng.normal(size=len(units)) * units, y


def _by_state_and_input(e: Evidence, k: int, moves: Array) -> Array:
    """Directions of (x, u), one per row, as directions of (t, x, u, p)."""
    width = moves.shape[1]
    result = np.zeros((len(moves), 1 + width + len(e.samples[k].p)))
    result[:, 1 : 1 + width] = moves
    return result


def slopes_of_forward(e: Evidence) -> float | None:
    """∂ẋ/∂x d + ∂ẋ/∂t τ differentiated by the states and inputs, where the module has it."""
    found = _states_of(e, OF_FORWARD)
    if not found:
        return None
    rows = [_in_place_of_x(e, k) for k in found]
    # twice a bound of ours is one of both
    lost = 2.0 * roundoff(e.graph, OF_FORWARD, rows, FLOAT64)
    return worst([_slopes_of_forward(e, k, each) for k, each in zip(found, lost)])


def _in_place_of_x(e: Evidence, k: int) -> Row:
    """(t, (x, d, τ), u, p) at random d and one unit of time."""
    s, x = e.samples[k], e.x[k]
    d, tau = _random(e, k)[0][: len(x)], e.units.time
    return s.t, np.concatenate([x, d, [tau]]), s.u, s.p


def _slopes_of_forward(e: Evidence, k: int, lost: Array) -> float:
    s, x, units = e.samples[k], e.x[k], _both_units(e)
    _, given, _, _ = _in_place_of_x(e, k)
    d, tau = given[len(x) : -1], given[-1]
    slots = [argument.symbols for argument in e.graph.equations.arguments]
    rates = e.graph.equations.function("dynamics").result.value
    seed = ca.SX(ca.DM(np.append(tau, d)))
    along = with_finite_slopes(ca.jtimes(rates, ca.vertcat(slots[0], slots[1]), seed))
    directions = _by_state_and_input(e, k, np.diag(units))
    wanted = tangents(slots, along, (np.array([s.t]), x, s.u, s.p), directions)
    ours = e.graph(OF_FORWARD, s.t, given, s.u, s.p).reshape(len(x), -1) * units
    rows = e.units.x / e.units.time
    value = ca.Function("along", slots, [along])(s.t, x, s.u, s.p)
    here = np.array(value).ravel() / rows
    doubts = lost.reshape(ours.shape) * units
    columns = zip(ours.T, wanted.T, doubts.T)
    errors = [_error(a / rows, b / rows, here, doubt / rows) for a, b, doubt in columns]
    return worst(errors) / _growth(e, k)


def curvature(e: Evidence) -> float | None:
    """The second-order contraction and the whole matrix, where the module has them: (∂ẋ/∂x dx +
    ∂ẋ/∂u du)·y by dual numbers along every state and input."""
    errors = [_curvature(e, k, name) for name in (SECOND, HESSIAN) for k in _states_of(e, name)]
    return worst(errors) if errors else None


def _curvature(e: Evidence, k: int, name: str) -> float:
    """At random y and (dx, du), in the model's own units."""
    s, x, units = e.samples[k], e.x[k], _both_units(e)
    d, y = _random(e, k)
    slots = [argument.symbols for argument in e.graph.equations.arguments]
    rates = e.graph.equations.function("dynamics").result.value
    rate = ca.jtimes(rates, ca.vertcat(slots[1], slots[2]), ca.SX(ca.DM(d)))
    along = with_finite_slopes(ca.dot(rate, ca.SX(ca.DM(y))))
    directions = _by_state_and_input(e, k, np.diag(units))
    wanted = tangents(slots, along, (np.array([s.t]), x, s.u, s.p), directions)[0]
    given = np.concatenate([x, y, d] if name == SECOND else [x, y])
    found = e.graph(name, s.t, given, s.u, s.p)
    ours = (found if name == SECOND else found.reshape(len(d), -1) @ d) * units
    size = float(ca.Function("along", slots, [along])(s.t, x, s.u, s.p))
    return _error(ours, wanted, np.full(len(units), size)) / _growth(e, k)


def of_outputs(e: Evidence) -> float | None:
    """∂y/∂x, where the module has it, against dual numbers."""
    if not e.graph.has("outputs_jacobian"):
        return None
    errors = [_outputs_jacobian(e, k) for k in _regular(e, "outputs_jacobian")]
    return worst(errors)


def _outputs_jacobian(e: Evidence, k: int) -> float:
    s, x, units = e.samples[k], e.x[k], e.units.x
    directions = np.zeros((len(x), 1 + len(x) + len(s.u) + len(s.p)))
    directions[:, 1 : 1 + len(x)] = np.diag(units)
    wanted, rows = _along(e, "outputs", k, directions), _output_units(e)
    ours = e.graph("outputs_jacobian", s.t, x, s.u, s.p).reshape(-1, len(x)) * units
    here = e.graph("outputs", s.t, x, s.u, s.p) / rows
    pairs = zip(ours.T, wanted.T)
    return worst([_error(a / rows, b / rows, here) for a, b in pairs]) / _growth(e, k)


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
        result = study(
            equations, motion, {name: FREE for name in motion.sweepable if name not in given}
        )
        along = result.motions({})
        place = (0.0, along.x[0], along.u[0], along.p[0])
        if (
            margins(e.graph, NAME, [place], e.real)[0] <= NEARLY
            or worst(along.x[0] / e.units.x) > FAR
        ):
            return None
        form = _with_numbers(
            linear(equations, initial_state(e.system).q, np.array(equations.parameters)), e, place
        )
        cyclic = {result.linear.independent[k] for k in result.cyclic}
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
        EXACT,
        "(ẋ, y) differentiated by dual numbers along the reference's tangents",
        along_constraints,
    ),
    Check(
        "linearization, unreduced",
        UNREDUCED,
        "the multiplier equations linearised, 2 m_h + m_n more zeros",
        unreduced_form,
    ),
    Check("Jacobian of outputs", EXACT, "y differentiated by dual numbers by x", of_outputs),
    Check("Jacobians", EXACT, "ẋ differentiated by dual numbers by t, x, u and p", along_axes),
    Check("products of Jacobians", EXACT, "ẋ differentiated by dual numbers", products),
    Check(
        "slopes of a product",
        EXACT,
        "derivatives of ẋ along one direction differentiated by dual numbers",
        slopes_of_forward,
    ),
    Check("contraction", EXACT, "derivatives of ẋ differentiated by dual numbers", curvature),
)
