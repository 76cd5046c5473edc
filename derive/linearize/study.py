"""A steady motion under study: the linear equations along it, without what is cyclic, for any
values of what can be swept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from derive.choices.redundancy import check_repeated
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.formulations.records import Equations
from derive.linearize.branch import Place, family
from derive.linearize.cyclic import confirmed, cyclic_coordinates
from derive.linearize.kinks import at_kink
from derive.linearize.limits import DEPENDENT, SAME_ROWS, SPREADS, STUDY_SAMPLES
from derive.linearize.minimal import Evaluator, evaluator, linear, position_rows
from derive.linearize.nearest import settled
from derive.linearize.records import Linear, Steady
from derive.linearize.search import check_pivots
from derive.linearize.spectrum import Stage, deflated, families, in_units
from derive.linearize.steady import Problem, problem, residuals_of
from derive.model.records import SteadyMotion
from derive.numerics import refuses_numerically
from derive.states.scales import scales

Rows = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
Columns = Mapping[str, Sequence[float] | np.ndarray]  # values by name, one for each motion


@dataclass(frozen=True)
class Study:
    """`at` gives sweepable names and parameters; `cyclic` and `kept` are indices into the linear
    form's states."""

    linear: Linear
    problem: Problem
    at: dict[str, float]
    origin: Place  # the motion that belongs to `at`
    cyclic: tuple[int, ...]
    kept: tuple[int, ...]
    families: tuple[Stage, ...]
    A: Evaluator
    A_kept: Evaluator  # without the cyclic coordinates
    residuals: Rows  # (y, p, s) → what vanishes at the motion y = (x, u)

    @property
    def equations(self) -> Equations:
        """The equations of motion that were linearised."""
        return self.linear.equations

    @property
    def names(self) -> tuple[str, ...]:
        """The states that are left, without cyclic ones; families still in."""
        return tuple(self.linear.states[k] for k in self.kept)

    @property
    def one(self) -> np.ndarray:
        """One of each state that is left, in the model's own units."""
        own = scales(self.equations.system.model)
        return own.all_of(self.linear.units[k] for k in self.kept)

    @property
    def reduced(self) -> tuple[str, ...]:
        """The states that the eigenvalues belong to."""
        names = list(self.names)
        for stage in self.families:
            names = [name for i, name in enumerate(names) if i not in stage]
        return tuple(names)

    @property
    def length(self) -> int:
        """How many operations the rows of the motion and the matrix take together, at most."""
        A = self.linear.A[list(self.kept), list(self.kept)]
        arguments = [argument.symbols for argument in self.equations.arguments]
        matrix = ca.Function("A", arguments, [ca.cse(ca.densify(A))])
        return int(matrix.n_instructions() + self.problem.residual.n_instructions())

    @property
    def spurious(self) -> int:
        """States beyond 2n − 2 m_h − m_n, the numbers of constraints counted by the ranks of φ_q
        and A at the motion."""
        system, motions = self.equations.system, self.motions({})
        rows = [
            evaluator(self.equations, M)
            for M in (ca.jacobian(position_rows(system), system.q), system.A)
        ]
        ranks = [
            int(np.linalg.matrix_rank(row(motions.x, motions.u, motions.p)[0], tol=SAME_ROWS))
            for row in rows
        ]
        return len(self.linear.states) - (system.q.numel() + system.v.numel() - sum(ranks))

    def values(self, sweep: Columns) -> tuple[np.ndarray, np.ndarray]:
        """Rows of p and s for columns of values by name; what is not named stays as it is in
        `at`."""
        many = max((len(column) for column in sweep.values()), default=1)
        columns = {name: np.full(many, value) for name, value in self.at.items()}
        columns |= {name: np.asarray(column, dtype=float) for name, column in sweep.items()}
        p = [columns[name] for name in self.equations.arguments[3].labels]
        s = [columns[name] for name in self.problem.motion.sweepable]
        return np.array(p).reshape(len(p), many).T, np.array(s).reshape(len(s), many).T

    def value(self, name: str, place: Place) -> float:
        """Of a parameter or a free name, at one motion."""
        names = (*self.equations.arguments[3].labels, *self.problem.motion.sweepable)
        return float(np.append(place.p, place.s)[names.index(name)])

    def motions(self, sweep: Columns, origin: Place | None = None) -> Steady:
        """The steady motions, one for each row of values, on the branch through the study's own
        motion, or another `origin`; where a row has none, `absent` says so. Raises AssumptionError
        where there is none at all."""
        return family(self.problem, origin or self.origin, *self.values(sweep))

    def full(self, motions: Steady) -> np.ndarray:
        """A in all minimal states, N × n × n, cyclic coordinates and families included: its zero
        eigenvalues belong to them."""
        return self.A(motions.x, motions.u, motions.p)

    def matrices(self, motions: Steady) -> np.ndarray:
        """A without cyclic coordinates and families, N × k × k: the matrix whose eigenvalues are
        reported."""
        A = self.A_kept(motions.x, motions.u, motions.p)
        return deflated(A, self.families, self.one)

    def along(self, sweep: Columns) -> np.ndarray:
        """The matrix of the linear equations for each row of values: the steady motion is found
        anew at every one, as it changes with them."""
        return self.matrices(self.motions(sweep))


@refuses_numerically("the study of the linear equations")
def study(
    equations: Equations,
    motion: SteadyMotion,
    values: Mapping[str, float] | None = None,
    cyclic: Sequence[str] | None = None,
) -> Study:
    """The motion with `values` for its free names and for parameters.

    `cyclic` names the coordinates to leave out, all that are cyclic when None. Raises
    AssumptionError where the motion is not steady, a free name has no value, or a name is unknown.
    """
    given = _settings(equations, motion, values or {})
    wanted = cyclic if cyclic is not None else motion.cyclic
    ignorable = cyclic_coordinates(equations)
    left_out = _left_out(equations, wanted, ignorable)
    result = problem(equations, motion, ignorable)
    p = np.array([given[name] for name in equations.arguments[3].labels])
    s = np.array([given[name] for name in motion.sweepable])
    y = settled(result, p, s)
    touched = _cyclic_there(equations, ignorable, y, p)
    if touched != ignorable:
        left_out = _left_out(equations, wanted, touched)
        result = problem(equations, motion, touched)
        y = settled(result, p, s)
    _check_rank(equations, motion, y, p)
    check_pivots(result, y, p)
    x, u = np.split(y, [equations.arguments[1].symbols.numel()])
    form = at_kink(linear(equations, x[: equations.system.q.numel()], p), (x, u, p))
    places = tuple(k for k, j in enumerate(form.independent) if j in left_out)
    remaining = tuple(k for k in range(len(form.states)) if k not in places)
    at = list(remaining)
    first = Study(
        form,
        result,
        given,
        Place(p, s, y),
        places,
        remaining,
        (),
        evaluator(equations, form.A),
        evaluator(equations, form.A[at, at]),
        partial(residuals_of, result),
    )
    velocity = [form.independent[k] >= equations.system.q.numel() for k in remaining]
    found = families(in_units(_samples(first), first.one), velocity)
    return replace(first, families=found)


def _check_rank(equations: Equations, motion: SteadyMotion, y: np.ndarray, p: np.ndarray) -> None:
    """The rows of A are as independent at the motion y = (x, u) as anywhere else, and those that
    repeat others do there, too."""
    system = equations.system
    if system.v.numel() == len(equations.w):
        return
    found = equations.request("constraint_rows").function.result
    assert found.pattern is not None
    x, u = np.split(y, [equations.arguments[1].symbols.numel()])
    rows = np.zeros(found.pattern.shape)
    entries = evaluator(equations, found.value)(x[None], u[None], p[None])[0, :, 0]
    rows[list(found.pattern.rows), list(found.pattern.columns)] = entries
    if len(equations.kept) < len(rows) and not np.array_equal(p, system.own_parameters):
        check_repeated(system, rows, equations.kept, DEPENDENT)
    rank = int(np.linalg.matrix_rank(rows, tol=DEPENDENT))
    speeds = system.v.numel() - rank
    if speeds > len(equations.w):
        labels = equations.arguments[1].labels[: system.q.numel()]
        place = listed([f"{name} {value:.4g}" for name, value in zip(labels, x)], 6)
        raise AssumptionError(
            f"the steady motion '{motion.name}' is at a singular configuration of "
            f"{system.model.name}: {place}; {speeds} speeds are free there, {len(equations.w)} "
            "elsewhere",
            "linear equations do not describe motions through it: guess or hold another one",
        )


def _left_out(
    equations: Equations, wanted: Sequence[str] | None, ignorable: tuple[int, ...]
) -> tuple[int, ...]:
    return ignorable if wanted is None else confirmed(equations, tuple(wanted), ignorable)


def _cyclic_there(
    equations: Equations, ignorable: tuple[int, ...], y: np.ndarray, p: np.ndarray
) -> tuple[int, ...]:
    """Which coordinates are cyclic at the motion, too: forces in pieces, as of a contact, may act
    at none of the states that were looked at."""
    if not any(request.name == "kinks" for request in equations.requests):
        return ignorable
    x, u = np.split(y, [equations.arguments[1].symbols.numel()])
    return cyclic_coordinates(equations, (x[np.newaxis], u[np.newaxis], p[np.newaxis]))


def _settings(
    equations: Equations, motion: SteadyMotion, values: Mapping[str, float]
) -> dict[str, float]:
    """Parameters and free names; a free name that is not given has the middle of its range in the
    file."""
    model = equations.system.model
    result: dict[str, float] = dict(zip(equations.arguments[3].labels, equations.parameters))
    result |= {
        name: (first + last) / 2
        for name, first, last, _ in motion.ranges
        if name in motion.sweepable
    }
    for name, value in values.items():
        if name not in result and name not in motion.sweepable:
            known = (*motion.sweepable, *result)
            near = did_you_mean(name, known) or f"known: {listed(known)}"
            raise AssumptionError(
                f"'{name}' is neither a parameter of {model.name} nor free in '{motion.name}'", near
            )
        result[name] = float(value)
    missing = [name for name in motion.sweepable if name not in result]
    if missing:
        raise AssumptionError(
            f"the steady motion '{motion.name}' needs a value for '{missing[0]}'",
            f"--set {missing[0]}=…, or --sweep {missing[0]}=first:last:count",
        )
    return result


def _samples(study: Study) -> np.ndarray:
    """A at motions near by, at parameters chosen at random: what is singular at all of them is a
    family."""
    rng = np.random.default_rng(0)
    stacks: list[np.ndarray] = []
    for spread in SPREADS:
        changed = {
            name: value * (1 + spread * rng.uniform(-1, 1)) for name, value in study.at.items()
        }
        for name in study.problem.motion.sweepable:
            changed[name] += spread * rng.uniform(0.1, 1)
        try:
            motions = study.motions({name: [value] for name, value in changed.items()})
        except (AssumptionError, ModelError):
            continue
        stacks.append(study.matrices(motions))
        if len(stacks) == STUDY_SAMPLES:
            break
    if not stacks:
        stacks = [study.matrices(study.motions({}))]
    return np.concatenate(stacks)
