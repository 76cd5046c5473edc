"""What the checks look at: at each random admissible state the reference, the system's terms and
the equations' functions."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import ModuleType

import casadi as ca
import numpy as np

from codegen.reals import FLOAT64, Real, real_of
from derive.expressions.deferred import OnDemand
from derive.formulations.evaluate import Evaluator, evaluator, slots_of
from derive.formulations.records import Equations
from derive.mechanics.records import System
from hamel.verify.checks.compare import Sums, worst
from hamel.verify.checks.roundoff import bound, estimate
from hamel.verify.checks.samples import (
    Sample,
    Terms,
    TermsAt,
    drawn_samples,
    samples,
    terms,
)
from hamel.verify.checks.units import Units, units
from hamel.verify.limits import ROUNDING, SMALL
from hamel.verify.reference.outcome import (
    Kinematics,
    Outcome,
    Reference,
    evaluate,
    kinematics,
    state_of,
)
from hamel.verify.reference.saddle import (
    condition_of,
    least_eigenvalue,
    rank_of,
    row_condition,
    saddle,
)
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

UNVARIED = 5  # states with the file's own parameters
SHORT = 1e-3  # of the model's own time
FAR = 0.1  # off the constraints, in the model's own units
NEARER = (FAR, FAR / 10, FAR / 100, FAR / 1000)  # where the constraints have no value that far
LOST = 1e-8  # an eigenvalue of Sᵀ M S, scaled, excuses no more than the loss of so many digits


Row = tuple[float, Array, Array, Array]  # t, x, u, p


def roundoff(graph: Evaluator, name: str, rows: Sequence[Row], real: Real) -> Array:
    """A bound of the roundoff in a function's result for each (t, x, u, p), states × entries, in
    units of double."""
    return bound(*_written(graph.equations, name, rows), real)


def likely_roundoff(equations: Equations, name: str, rows: Sequence[Row], real: Real) -> Array:
    """The same as it is likely, not at its worst: of a long chain the bound says nothing."""
    return estimate(*_written(equations, name, rows), real)


def _written(
    equations: Equations, name: str, rows: Sequence[Row]
) -> tuple[list[ca.SX], ca.SX, Array]:
    """Arguments and result of a function, and the arguments' entries for each row."""
    function = equations.function(name)
    states = np.array([np.concatenate([np.ravel(part) for part in row]) for row in rows])
    return slots_of(equations, function), ca.densify(function.result.value), states


def margins(graph: Evaluator, name: str, rows: Sequence[Row], real: Real) -> Array:
    """How far the function's guards are from refusing each (t, x, u, p): below one they do."""
    function = graph.equations.function(name)
    ratios = [guard.value / (guard.tolerance * real.wider(guard.part)) for guard in function.guards]
    at = ca.Function("margins", slots_of(graph.equations, function), [ca.vertcat(*ratios)])
    return np.array([np.min(np.abs(np.array(at(*row))), initial=np.inf) for row in rows])


@dataclass(frozen=True)
class Evidence:
    """Everything about one choice at all states. Arrays are computed when a check first asks for
    them."""

    system: System
    reference: Reference
    samples: tuple[Sample, ...]
    terms_at: TermsAt
    graph: Evaluator
    others: tuple[Evaluator, ...]
    module: ModuleType | None
    chart: int = 0  # of the module, that the graph is of

    def loaded(self, module: ModuleType) -> Evidence:
        """With the module; what was computed before is kept where it computes in the same
        precision."""
        result = replace(self, module=module)
        if result.real is self.real:
            vars(result).update(
                {name: value for name, value in vars(self).items() if name != "module"}
            )
        return result

    @property
    def possible(self) -> bool:
        """Whether there can be bodies with these inertias; false only where the file waives it."""
        return all(body.possible for body in self.system.model.bodies)

    @cached_property
    def real(self) -> Real:
        """What the module computes in."""
        return FLOAT64 if self.module is None else real_of(self.module.defaults.dtype.name)

    def rows_of(self, name: str) -> list[Row]:
        """(t, x, u, p) of a function at every state, as the module's precision rounds them."""
        near = self.real.nearest
        return [
            (float(near(s.t)), near(x), near(s.u), near(s.p))
            for s, x in zip(self.samples, self.arguments_of(name))
        ]

    def complete(self, row: Row) -> Row:
        """With the module's usual frame behind the parameters, where it has one: what is behind
        the face of the module does not add it."""
        t, x, u, p = row
        return t, x, u, p if self.module is None else np.append(p, self.module.defaults[len(p) :])

    @cached_property
    def units(self) -> Units:
        """One of each quantity."""
        w = [x[self.graph.equations.speeds] for x in self.x]
        return units(self.system, [s.outcome.kinematics.A for s in self.samples], w)

    @cached_property
    def terms(self) -> tuple[Terms, ...]:
        """M, h, Q … of the System at every state."""
        return tuple(self.terms_at(s.t, s.q, s.v, s.u, s.given) for s in self.samples)

    @cached_property
    def x(self) -> tuple[Array, ...]:
        """The states (q, w) of this choice."""
        return self.states_of(self.graph)

    @cached_property
    def vdot(self) -> tuple[Array, ...]:
        """v̇ as the choice's ẋ has it: the derivative of v(t, x) along ẋ."""
        return self.accelerations_of(self.graph)

    @cached_property
    def conditions(self) -> list[float]:
        """Per state by what factor roundoff may grow on the way to v̇ of this choice."""
        return self.conditions_of(self.graph)

    def conditions_of(self, graph: Evaluator) -> list[float]:
        """Condition of the augmented system times that of the choice's own Y = [A; B]: how much
        roundoff may grow."""
        own = self.own_conditions(graph)
        return [self._condition(s.outcome) * growth for s, growth in zip(self.samples, own)]

    def own_conditions(self, graph: Evaluator) -> list[float]:
        """That of the choice's own Y alone, in the model's own units."""
        own = self.named("Y", graph) or [np.eye(1)] * len(self.samples)
        return [max(1.0, row_condition(Y * self._columns(Y))) for Y in own]

    def growths(self, graph: Evaluator) -> list[float]:
        """By what factor roundoff may grow on the way to v̇ = S ẇ + σ: cond Y of the choice, or what
        Sᵀ M S, scaled to a unit diagonal, loses of light bodies that are told by heavy ones."""
        own, nv = self.named("Y", graph), len(self.units.v)
        growths = self.own_conditions(graph)
        if not own or own[0].shape != (nv, nv):
            return growths
        freedom = len(graph.equations.w)
        lost = [_lost(t.M, Y, freedom) for t, Y in zip(self.terms, own)]
        return [max(pair) for pair in zip(growths, lost)]

    def _condition(self, o: Outcome) -> float:
        """Of [M Aᵀ; A 0] in the model's own units."""
        return condition_of(saddle(o.M / self.units.M, o.kinematics.A / self.units.A))

    def _columns(self, Y: Array) -> Array | float:
        return self.units.v if Y.shape[1] == len(self.units.v) else 1.0

    @cached_property
    def disturbed(self) -> tuple[State, ...]:
        """The states with q moved off the constraints by up to 0.1, the same way every time; by
        less where the constraints have no value there."""
        rng = np.random.default_rng(0)
        ways = [self.units.q * rng.uniform(-1, 1, len(s.q)) for s in self.samples]
        return tuple(self._beside(s, way) for s, way in zip(self.samples, ways))

    def _beside(self, s: Sample, way: Array) -> State:
        def moved(size: float) -> State:
            return state_of(self.reference, s.t, s.q + size * way, s.v, s.u, s.full)

        places = map(moved, NEARER)
        return next((x for x in places if np.isfinite(self.kinematics(x).phi).all()), moved(FAR))

    @cached_property
    def astray(self) -> tuple[Array, ...]:
        """x moved by up to a tenth: of terms that vanish on the constraints some are of third order
        in the way off them."""
        rng = np.random.default_rng(2)
        return tuple(x + FAR * self.units.x * rng.uniform(-1, 1, len(x)) for x in self.x)

    @cached_property
    def unvaried(self) -> tuple[Sample, ...]:
        """Some states of the very mechanism of the file: no parameter is varied."""
        return tuple(drawn_samples(self.system, self.reference, UNVARIED, 0, 0.0))

    @cached_property
    def velocities(self) -> tuple[Array, ...]:
        """v as the choice has it at its own states."""
        return self.results("velocity")

    @cached_property
    def own(self) -> tuple[State, ...]:
        """The states at the choice's own v: what the choice says of them is not excused by how well
        x tells v."""
        rows = zip(self.samples, self.velocities)
        return tuple(state_of(self.reference, s.t, s.q, v, s.u, s.full) for s, v in rows)

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """The reference at these."""
        return tuple(evaluate(self.reference, state) for state in self.own)

    def kinematics(self, state: State) -> Kinematics:
        """The reference's kinematics at another state."""
        return kinematics(self.reference, state)

    @cached_property
    def ranks(self) -> list[int]:
        """The rank of the system's own A at every state."""
        return [rank_of(t.A) for t in self.terms]

    @cached_property
    def small(self) -> float:
        """Accelerations below this, in the model's own units, are left over where gravity cancels:
        1e-4 of it."""
        gravity, own = self.reference.model.gravity, self.units.own
        size = [float(np.linalg.norm(s.state.vector(gravity))) for s in self.samples[:1] if gravity]
        return max(SMALL, *(1e-4 * g * own.time**2 / own.length for g in size), 0.0)

    @cached_property
    def speeds(self) -> Array:
        """Σ |v| of each state in the model's own units."""
        return np.array([np.abs(s.v / self.units.v).sum() for s in self.samples])

    @cached_property
    def forces(self) -> Array:
        """Per state the largest of the forces that h and Q are sums of, velocity products too, in
        the model's own units."""
        own = [worst(s.outcome.summed.force / self.units.force) for s in self.samples]
        inertia = [worst(s.outcome.M / self.units.M) for s in self.samples]
        return np.array(own) + np.array(inertia) * self.speeds**2

    @cached_property
    def reaches(self) -> Array:
        """Per state how far bodies are from the ground's origin, in units of the shortest row in
        m/s: of points that far away a small closure is the difference."""
        rows = [u for u, row in zip(self.units.rows, self.system.rows) if row.unit == "m/s"]
        if not rows:
            return np.zeros(len(self.samples))
        far = [worst(np.array([f.origin for f in s.state.frames.values()])) for s in self.samples]
        return np.array(far) / (min(rows) * self.units.time)

    def of_positions(self, tolerance: float, states: Sequence[Sample | State]) -> Sums:
        """What φ and A are sums of: coordinates, and the ways to both sides of a closure."""
        turned = np.array([1.0 + worst(s.q / self.units.q) for s in states])
        return Sums(tolerance, np.maximum(turned, self.reaches))

    def of_speeds(self, tolerance: float) -> Sums:
        """Sums of velocities; those of the samples are of the order of one before the constraints
        leave what they leave."""
        return Sums(tolerance, 1.0 + self.speeds)

    def of_forces(self, tolerance: float) -> Sums:
        """Sums of forces, from which h and Q are left: compared with the largest part."""
        return Sums(tolerance, self.forces)

    def of_accelerations(self, tolerance: float) -> Sums:
        """Velocity products, of what small closures far away are the difference too, and forces on
        the largest inertia."""
        inertia = np.array([worst(s.outcome.M / self.units.M) for s in self.samples])
        given = np.where(inertia > 0.0, self.forces / np.where(inertia > 0.0, inertia, 1.0), 0.0)
        return Sums(tolerance, np.maximum(1.0, self.reaches) * self.speeds**2 + given)

    def of_each_acceleration(self, tolerance: float) -> Sums:
        """The same of each velocity, and the forces of each on its own inertia: what is left of
        moments about a thin bar's own axis, where they cancel, turns next to nothing."""
        own = np.array([self._on_own_inertia(s.outcome) for s in self.samples])
        common = np.asarray(self.of_accelerations(tolerance).sizes)
        return Sums(tolerance, np.maximum(common[:, None], own))

    def _on_own_inertia(self, o: Outcome) -> Array:
        """Where rounding may be all that there is of an inertia, none counts."""
        inertia, force = np.diag(o.M) / np.diag(self.units.M), o.summed.force / self.units.force
        known = np.diag(o.M) > SMALL * o.summed.M
        return np.divide(force, inertia, out=np.zeros_like(force), where=known)

    def of_rows(self, tolerance: float) -> Sums:
        """|A| |v|² over all columns: where a loop turns as a whole, its rows are zero in what turns
        it, and the products of β cancel."""
        size = [worst(s.outcome.kinematics.A / self.units.A) for s in self.samples]
        return Sums(tolerance, np.maximum(size, self.reaches) * self.speeds**2)

    def of_energies(self, tolerance: float) -> Sums:
        """T and the parts of V."""
        size = [abs(s.outcome.T) + s.outcome.summed.V for s in self.samples]
        return Sums(tolerance, np.array(size) / self.units.energy)

    def of_powers(self, tolerance: float) -> Sums:
        """Sums of forces times velocities: the largest force times Σ |v|."""
        return Sums(tolerance, self.forces * self.speeds)

    def of_masses(self, tolerance: float) -> list[Array]:
        """Per state √(sᵢ sⱼ), s the sizes that the diagonal of M is a sum of, as floors of what its
        entries are compared with."""
        roots = [np.sqrt(s.outcome.summed.M / np.diag(self.units.M)) for s in self.samples]
        return [ROUNDING / tolerance * np.outer(root, root) for root in roots]

    @property
    def redundant(self) -> bool:
        """At some state rank A is less than the number of rows, so that λ is not unique."""
        return any(s.outcome.rank < len(s.outcome.lam) for s in self.samples)

    def states_of(self, graph: Evaluator) -> tuple[Array, ...]:
        """The states x = (q, w) of a choice that (q, v) of the samples become there."""
        return tuple(graph("state", s.t, s.whole, s.u, s.p) for s in self.samples)

    def accelerations_of(self, graph: Evaluator) -> tuple[Array, ...]:
        """v̇ of a choice at its own states, by which choices with different w can be compared."""
        rows = zip(self.samples, self.states_of(graph))
        return tuple(graph.acceleration(s.t, x, s.u, s.p) for s, x in rows)

    def arguments_of(self, name: str) -> tuple[Array, ...]:
        """The x that a function takes: the state (q, w), unless it is one of those that take
        something else."""
        if name == "state":
            return tuple(s.whole for s in self.samples)
        if name == "qdot":
            return tuple(np.concatenate([s.q, s.v]) for s in self.samples)
        if name == "integrate":
            return tuple(np.concatenate([s.q, s.v * self.units.time]) for s in self.samples)
        if name in ("inverse_dynamics", "regressor", "regressor_rest"):
            rng = np.random.default_rng(4)  # any v̇ will do, and none should come out as zero
            any_other = (
                s.outcome.vdot + self.units.vdot * rng.normal(size=len(s.v)) for s in self.samples
            )
            states = self.arguments_of("state" if name == "inverse_dynamics" else "qdot")
            return tuple(np.concatenate(pair) for pair in zip(states, any_other))
        if name == "difference":
            others = (*self.samples[1:], *self.samples[:1])
            return tuple(np.concatenate([s.q, other.q]) for s, other in zip(self.samples, others))
        if name == "normalise":
            return tuple(1.1 * s.q for s in self.samples)
        if name in ("regressor_w", "regressor_rest_w"):  # of first-order states they take none
            mechanical = len(self.samples[0].q) + len(self.units.w)
            return self._with_seeds(name, [x[:mechanical] for x in self.x])
        return self._with_seeds(name, self.x)

    def _with_seeds(self, name: str, rows: Sequence[Array]) -> tuple[Array, ...]:
        """The state, and behind it random directions where the function takes some."""
        taken = self.graph.equations.function(name).x
        if taken is None:
            return self.x
        rng = np.random.default_rng(5)
        return tuple(np.append(x, rng.normal(size=taken.symbols.numel() - len(x))) for x in rows)

    def named(self, name: str, graph: Evaluator | None = None) -> list[Array] | None:
        """A named intermediate (S, R, Y, B …) at every state, or None where the choice has none of
        that name."""
        graph = graph or self.graph
        if name not in graph.named:
            return None
        rows = zip(self.samples, self.states_of(graph))
        return [np.array(graph.named[name](s.t, x, s.u, s.p)) for s, x in rows]

    def rounded(self, name: str) -> list[Array]:
        """How far roundoff is likely to move the entries of a named intermediate, at every state:
        rows are never exchanged at run time, so it may pass through large numbers where neither the
        constraints nor the choice are near a singular position."""
        function = self.graph.named[name]
        arguments = [ca.SX.sym("a", *function.size_in(i)) for i in range(function.n_in())]
        rows = zip(self.samples, self.x)
        states = np.array([np.concatenate([[s.t], x, s.u, s.p]) for s, x in rows])
        value = function(*arguments)
        moved = estimate(arguments, ca.densify(value), states)
        return [each.reshape(value.shape) for each in moved]

    @cached_property
    def expected(self) -> Mapping[str, tuple[Array, Array]]:
        """For every function the graph's results and the roundoff in them, states × entries."""
        names = [function.name for function in self.graph.equations.functions]
        return OnDemand({name: partial(self._expected, name) for name in names})

    def _expected(self, name: str) -> tuple[Array, Array]:
        rows = self.rows_of(name)
        values = [np.ravel(self.graph.iterated(name, *row)) for row in rows]
        return np.array(values), roundoff(self.graph, name, rows, self.real)

    def results(self, name: str) -> tuple[Array, ...]:
        """A function of this choice at every state."""
        return tuple(self.graph(name, s.t, x, s.u, s.p) for s, x in zip(self.samples, self.x))


def evidence(
    ref: Reference,
    equations: Equations,
    module: ModuleType | None = None,
    states: int = 100,
    seed: int = 0,
    others: Collection[Equations] = (),
) -> Evidence:
    """What the checks look at."""
    system = equations.system
    seen = samples(system, ref, states, seed)
    return Evidence(
        system,
        ref,
        seen,
        terms(system),
        evaluator(equations),
        tuple(evaluator(other) for other in others),
        module,
    )


def _lost(M: Array, Y: Array, freedom: int) -> float:
    try:
        S = np.linalg.inv(Y)[:, len(Y) - freedom :]
    except np.linalg.LinAlgError:
        return 1.0  # the condition of Y says enough
    return 1.0 / max(least_eigenvalue(S.T @ M @ S, np.zeros(freedom)), LOST)
