"""A motion: integrated by the generated module or by a library, which give the same record."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from codegen.integrators import Tableau, integrator_of
from codegen.runtime.simulation import Simulation, Status
from derive.choices.survey import survey_of
from derive.diagnostics import NO_VALUE, AssumptionError, listed
from derive.expressions.tree import ZERO
from derive.model.kinks import jumps
from derive.model.records import Model
from hamel.progress import paced
from hamel.simulate.inputs import Changes
from hamel.simulate.kinks import said
from hamel.simulate.libraries import Problem, library_of
from hamel.simulate.limits import BELOW, FINEST, LOOKED_BACK, LOST, MOST_STEPS, SLOWER, STANDING

if TYPE_CHECKING:
    from derive.formulations.records import Equations


SINGULAR = (
    "the position may be singular, and constraints depend on each other there: an event with "
    "`stop: true` may end the motion before"
)


MEET = (
    "constraints depend on each other there, and branches of the motion meet: no choice of "
    "quasi-velocities is regular. Other steps, by another rtol or fewer rows (--step), may show "
    "the way across; an event with `stop: true` may end the motion before"
)

SMOOTH = (
    "a force that changes smoothly: tanh(v/eps) in place of sign(v), with eps a speed that counts "
    "as rest; step(x, eps) in place of step(x)"
)

# what helps where no choice was made
NO_CHOICE: dict[str, str] = dict.fromkeys(
    ("partitioning", "selective", "tangent"), "`--enforcement projection` selects no coordinates"
)


class Final(AssumptionError):
    """The motion ends there: no other choice and no other way of integrating helps."""


@dataclass(frozen=True)
class Stepping:
    """How the module is to integrate: steps by the tolerances without a step size."""

    integrator: str
    enforcement: str
    step_size: float | None
    rtol: float
    atol: float


@dataclass(frozen=True)
class Start:
    """From x, in the coordinates of `chart`, at times[0]; inputs u and parameters p are constant
    but for what `changes` says. The rows of the motion are at `times`."""

    times: np.ndarray
    x: np.ndarray
    u: np.ndarray
    p: np.ndarray
    chart: int = 0
    changes: Changes = field(default_factory=Changes)
    events: Mapping[str, Any] = field(default_factory=dict)

    def watched(self, module: ModuleType) -> dict[str, Any]:
        """Events as the module takes them."""
        return {
            name: event
            if callable(event)
            else module.Event(event.function, event.direction, event.stop)
            for name, event in self.events.items()
        }

    def inputs(self, module: ModuleType) -> Any:
        """As the module takes them."""
        changes = self.changes
        if changes.function is not None:
            return changes.function
        if not changes.tables:
            return self.u
        numbers = dict(zip(module.inputs, self.u.tolist()))
        tables = {n: module.Table(x.times, x.values, x.kind) for n, x in changes.tables.items()}
        return numbers | tables


class Unfinished(Exception):
    """A motion that used up its steps: `partial` holds the rows up to there, `covered` is how long
    it is."""

    def __init__(self, partial: Any, covered: float) -> None:
        super().__init__("too many steps")
        self.partial = partial
        self.covered = covered


def integrated(
    module: ModuleType,
    equations: Equations,
    start: Start,
    by: Stepping,
    progress: Callable[[float], None] | None = None,
    most: int = MOST_STEPS,
) -> Simulation:
    """The motion from its start, in float64: by the module's own `simulate`, or by a library where
    one is named as the integrator.

    Raises Unfinished after `most` steps, Final where a function of the inputs or events fails,
    AssumptionError where the motion comes to a singular position or the integrator cannot go on.
    """
    library = library_of(by.integrator)
    span = float(start.times[-1] - start.times[0])
    told = paced(progress, span, _haste(by))
    hint = SINGULAR if equations.system.rows else f"{NO_VALUE}, or forces change too fast to follow"
    watch = Covered(told, span, f"{module.name}.simulate", float(start.times[0]), hint)
    try:
        if library is not None:
            at = (start.times, start.x, start.u, start.p)
            simulation = library.prepare(Problem(module, equations, *at, by.rtol, by.atol))()
        else:
            simulation = _own(module, equations, start, by, watch, most)
    except FloatingPointError as error:
        if status_of(error) is Status.MORE and most < MOST_STEPS:
            raise Unfinished(vars(error)["partial"], watch.covered) from None
        raise _refusal(error, by, equations, start) from error.__cause__
    arrays = {"t": simulation.t, "x": simulation.x, "work": simulation.work}
    return replace(simulation, **{name: array.astype(float) for name, array in arrays.items()})


def _own(
    module: ModuleType,
    equations: Equations,
    start: Start,
    by: Stepping,
    watch: Callable[[float], None],
    most: int,
) -> Simulation:
    """By the module's own `simulate`."""
    times, changes = start.times, start.changes
    several: dict[str, Any] = {"chart": start.chart} if equations.charts else {}
    if changes.sample is not None:
        several["sample"] = changes.sample
    if start.events:
        several["events"] = start.watched(module)
    return module.simulate(
        times,
        start.x,
        start.inputs(module),
        start.p,
        max_steps=most,
        progress=watch,
        error=changes.function is None,  # who asks a function twice may get two answers
        **asdict(by),
        **several,
    )


class Covered:
    """How far a motion came, told on. Ends one that comes to a standstill before a place where its
    branch cannot be told: steps become shorter from look to look, and none too short."""

    def __init__(
        self,
        watch: Callable[[float], None] | None,
        span: float,
        name: str,
        first: float,
        hint: str,
    ) -> None:
        self.watch, self.span, self.name, self.first, self.hint = watch, span, name, first, hint
        self.reached: deque[float] = deque(maxlen=2 * LOOKED_BACK + 1)
        self.covered = 0.0

    def __call__(self, covered: float) -> None:
        self.covered = covered
        self.reached.append(covered)
        if self._stands():
            raise AssumptionError(
                f"{self.name} comes no further than t = {self.first + covered:g}: its steps become "
                "shorter and shorter there",
                self.hint,
            )
        if self.watch is not None:
            self.watch(covered)

    def _stands(self) -> bool:
        if len(self.reached) < 2 * LOOKED_BACK + 1:
            return False
        before, middle, last = (self.reached[k] for k in (0, LOOKED_BACK, -1))
        return last - before < STANDING * self.span and last - middle < SLOWER * (middle - before)


def _refusal(
    error: FloatingPointError, by: Stepping, equations: Equations, start: Start
) -> AssumptionError:
    """Why there is no motion, and what may help."""
    status = status_of(error)
    if status in (Status.NO_INPUT, Status.NO_EVENT):
        return Final(str(error))
    if status is Status.JUMP:
        return Final(str(error), "an event with `stop: true` may end the motion before")
    if status is Status.FULL:
        return Final(str(error), _chattering(equations.system.model))
    if status is Status.HELD or (status is Status.NOT_SOLVED and jumps(equations.system.model)):
        return _held(error, equations.system.model)
    if status is Status.NOT_SOLVED and by.step_size is not None:
        return AssumptionError(str(error), "shorter steps, or an integrator that chooses its own")
    pulled = _over_pulleys(equations.system.model)
    if status is Status.NOT_FINITE and pulled:
        hint = (
            f"{listed(pulled)} may have an end within a pulley, where there is no way round "
            "it: an event with `stop: true` may end the motion before"
        )
        return AssumptionError(str(error), hint)
    if not equations.system.rows:  # one choice is as good as another
        return AssumptionError(str(error), f"{NO_VALUE}, or the motion grows without bound")
    hint = "another choice of quasi-velocities may be regular there: see `hamel choices`"
    if _branches_meet(error, equations, start):
        hint = MEET
    elif equations.generalized_velocities:  # no choice was made
        hint = NO_CHOICE.get(by.enforcement, "")
    coarse = by.step_size is not None or by.rtol >= FINEST
    if not coarse and status is Status.SINGULAR_POSITION:
        finest = f"an rtol of {FINEST:g} is about the finest that can be checked"
        hint += f"; across a singular position {finest}"
    return AssumptionError(str(error), hint)


def _chattering(model: Model) -> str:
    """What helps where an event happens without end."""
    hint = (
        "an event whose formula leaves zero again, one with `stop: true`, which ends the motion "
        "there, or a shorter time"
    )
    forces = [said(piece) for piece in jumps(model)]
    return f"{hint}; where {listed(forces)} holds the motion, {SMOOTH}" if forces else hint


def _held(error: FloatingPointError, model: Model) -> Final:
    """With the formulas that may jump, at the first of them."""
    found = jumps(model)
    if not found:
        return Final(str(error), SMOOTH)
    named = listed(dict.fromkeys(said(piece) for piece in found))
    return Final(model.diagnostic(found[0].span, f"{error} ({named})", SMOOTH))


def _branches_meet(error: FloatingPointError, equations: Equations, start: Start) -> bool:
    """Whether constraints depend on each other where the motion ended, and so in any choice: the
    status says so by the smallest pivot of A, which may be small everywhere; beside that of the
    start the last row tells."""
    there = status_of(error) is Status.SINGULAR_POSITION
    partial = getattr(error, "partial", None)
    if partial is None:
        return there
    rows = np.flatnonzero(np.isfinite(partial.x).all(axis=1))
    if len(rows) < 2:  # the start alone
        return there
    last = rows[-1]
    before = _rows(equations, start, start.times[0], start.x)
    after = _rows(equations, start, partial.t[last], partial.x[last].astype(float))
    if not len(before):
        return there
    lengths = np.linalg.norm(before, axis=1, keepdims=True)  # rows may vanish, too, on the way
    least = [
        np.linalg.svd(A / np.where(lengths > 0, lengths, 1.0), compute_uv=False)[-1]
        for A in (before, after)
    ]
    return bool(least[1] < (BELOW if there else LOST) * least[0])


def _rows(equations: Equations, start: Start, t: float, x: np.ndarray) -> np.ndarray:
    """The rows of A that are independent at sampled states."""
    system = equations.system
    survey, nq = survey_of(system), system.q.numel()
    p = np.append(start.p[: len(system.own_parameters)], x[len(x) - system.z.numel() :])
    return survey.solver.velocities(t, x[:nq], p)[0][list(survey.kept)]


def _over_pulleys(model: Model) -> list[str]:
    """The paths that go round one."""
    return [path.name for path in model.paths if any(x.radius != ZERO for x in path.points)]


def status_of(error: FloatingPointError) -> Status:
    """How the motion ended; a generated module has its own class of the same numbers."""
    partial = getattr(error, "partial", None)
    return Status.NOT_FINITE if partial is None else Status(partial.status)


def _haste(by: Stepping) -> str:
    """What to do about a motion that takes very long."""
    if by.step_size is not None:
        return f"steps of {by.step_size:g} s are many"
    if isinstance(integrator_of(by.integrator), Tableau):
        return (
            "where fast motions have died out the system is stiff, which --integrator radau is for"
        )
    return "a looser rtol takes longer steps"
