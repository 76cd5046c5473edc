"""A motion as arrays: integrated by the generated module, judged by its constraints and
energies."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from codegen.integrators import INTEGRATORS, Tableau
from codegen.runtime.simulation import Status
from derive.diagnostics import AssumptionError
from derive.formulations.charts import together
from derive.formulations.frames import based
from derive.formulations.functions import positions
from hamel import charts
from hamel.progress import paced
from hamel.records import Switch
from hamel.simulate.inputs import Changes
from hamel.simulate.libraries import REFERENCES, Problem

if TYPE_CHECKING:
    from derive.formulations.records import Equations

FINEST = 1e-10  # rtol; rounding grows near singular positions
MOST_STEPS = 10**9  # enough for a night; Ctrl-C ends it any time


class InputError(AssumptionError):
    """A function of the inputs failed: no other way of integrating helps."""


@dataclass(frozen=True)
class Motion:
    """One row per output time in every array; `work` is that of all forces without potential since
    the first row."""

    title: str
    t: np.ndarray
    q: dict[str, np.ndarray]
    w: dict[str, np.ndarray]
    v: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    units: dict[str, str]
    T: np.ndarray
    V: np.ndarray
    work: np.ndarray
    phi: (
        np.ndarray
    )  # max |φ| per row, as it was integrated: angles that go round without their whole turns
    slip: np.ndarray  # max |A v − c| per row, likewise
    steps: int
    rejected: int
    calls: int
    position_violation: float  # the largest after any step, not only at the rows
    velocity_violation: float
    crossings: int
    seconds: float
    charts: int = 0
    acceleration_violation: float = 0.0
    switches: tuple[Switch, ...] = ()
    choices: tuple[str, ...] = ()  # that each row was made in, where there is more than one
    # Jacobi's integral T₂ − T₀ + V, which is in balance where T is not quadratic in the rates
    jacobi: np.ndarray | None = None
    inputs: dict[str, np.ndarray] = field(default_factory=dict)  # those that change
    # by name: times, and a row of the coordinates and velocities at each
    events: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    stopped_by: str | None = None
    error: np.ndarray | None = None  # estimate for each coordinate and quasi-velocity, at every row

    def columns(self) -> dict[str, np.ndarray]:
        """Everything by name, as it is written."""
        integral = {} if self.jacobi is None else {"jacobi": self.jacobi}
        energies = {"T": self.T, "V": self.V, **integral, "work": self.work}
        violations = {"position_violation": self.phi, "velocity_violation": self.slip}
        motion = {**self.q, **self.w, **self.v, **self.inputs, **self.outputs}
        return {"t": self.t, **motion, **energies, **violations}

    def written(self) -> dict[str, np.ndarray]:
        """The columns, with the choice of each row where there is more than one."""
        return self.columns() | ({"choice": np.array(self.choices)} if self.choices else {})

    @property
    def balance(self) -> np.ndarray:
        """Energy − (energy at 0) − work, relative to the largest energy exchanged (V counts from
        wherever it likes)."""
        total = self.T + self.V if self.jacobi is None else self.jacobi
        scale = max(np.max(np.abs(self.T)), np.ptp(self.V), np.max(np.abs(self.work)))
        return (total - total[0] - self.work) / scale if scale > 0 else np.zeros_like(total)

    @property
    def error_estimate(self) -> float | None:
        """The largest at the end; None where there is none."""
        if self.error is None or not np.isfinite(self.error[-1:]).any():
            return None
        return float(np.nanmax(self.error[-1]))

    @property
    def energy_balance(self) -> float:
        """The largest |balance| of all rows: energy that came from nowhere, relative to the largest
        energy exchanged."""
        return float(np.max(np.abs(self.balance)))


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
) -> Motion:
    """The motion from its start: by the module's own `simulate`, or by a library where one is named
    as the integrator.

    Raises Unfinished after `most` steps, InputError where a function of the inputs or events fails,
    AssumptionError where the motion comes to a singular position or the integrator cannot go on.
    """
    begin = time.perf_counter()
    times, x, u, p = start.times, start.x, start.u, start.p
    watch = _Covered(None)
    library = next((reference for reference in REFERENCES if reference.name == by.integrator), None)
    try:
        if library is not None:
            equations = based(equations)
            found = library.prepare(Problem(module, equations, times, x, u, p, by.rtol, by.atol))()
        else:
            several: dict[str, Any] = {"chart": start.chart} if equations.charts else {}
            watch = _Covered(paced(progress, float(times[-1] - times[0]), _haste(by)))
            if start.changes.sample is not None:
                several["sample"] = start.changes.sample
            if start.events:
                several["events"] = start.watched(module)
            found = module.simulate(
                times,
                x,
                start.inputs(module),
                p,
                max_steps=most,
                progress=watch,
                error=start.changes.function
                is None,  # who asks a function twice may get two answers
                **asdict(by),
                **several,
            )
    except FloatingPointError as error:
        if _status(error) is Status.MORE and most < MOST_STEPS:
            raise Unfinished(vars(error)["partial"], watch.covered) from None
        if _status(error) in (Status.NO_INPUT, Status.NO_EVENT):
            raise InputError(str(error)) from error.__cause__
        hint = "another choice of quasi-velocities may be regular there: see `hamel choices`"
        coarse = by.step_size is not None or by.rtol >= FINEST
        if not coarse and _status(error) is Status.SINGULAR_POSITION:
            finest = f"an rtol of {FINEST:g} is about the finest that can be checked"
            hint += f"; across a singular position {finest}"
        raise AssumptionError(str(error), hint) from None
    found = replace(
        found, t=found.t.astype(float), x=found.x.astype(float), work=found.work.astype(float)
    )
    return judged(module, equations, found, u, p, time.perf_counter() - begin)


class _Covered:
    """How far a motion came, told on."""

    def __init__(self, watch: Callable[[float], None] | None) -> None:
        self.watch = watch
        self.covered = 0.0

    def __call__(self, covered: float) -> None:
        self.covered = covered
        if self.watch is not None:
            self.watch(covered)


def _status(error: FloatingPointError) -> Status:
    """How the motion ended; a generated module has its own class of the same numbers."""
    partial = getattr(error, "partial", None)
    return Status.NOT_FINITE if partial is None else Status(partial.status)


def _haste(by: Stepping) -> str:
    """What to do about a motion that takes very long."""
    if by.step_size is not None:
        return f"steps of {by.step_size:g} s are many"
    explicit = next(integrator for integrator in INTEGRATORS if integrator.name == by.integrator)
    if isinstance(explicit, Tableau):
        return (
            "where fast motions have died out the system is stiff, which --integrator radau is for"
        )
    return "a looser rtol takes longer steps"


def judged(
    module: ModuleType,
    equations: Equations,
    found: Any,
    u: np.ndarray,
    p: np.ndarray,
    seconds: float,
) -> Motion:
    """What the module's own functions say about every row, in the chart it was made in.

    |φ| and |A v − c| are those of `reduced`, the state as it was integrated: without whole turns of
    angles where nothing depends on these.
    """
    t, x = found.t, found.x
    reduced = found if found.reduced is None else replace(found, x=found.reduced.astype(float))
    results = {function.name: function.result for function in equations.functions}
    nq = equations.system.q.numel()
    p = charts.parameters(found, p)
    fed = {} if found.u is None else dict(zip(module.inputs, found.u.astype(float).T))
    rows = charts.choices(equations, found)

    parts = charts.pieces(module, reduced, nq, u, p)

    def named(name: str) -> dict[str, np.ndarray]:
        made = charts.at_rows(module, name, found, nq, u, p)
        return dict(zip(results[name].labels, made.T)) if made.shape[1] else {}

    energies = charts.at_rows(module, "energy", found, nq, u, p)
    violation = np.abs(charts.at_rows(module, "constraints", reduced, nq, u, p))
    closed = positions(equations.system)
    labels = equations.argument("x").labels
    return Motion(
        title=f"{equations.system.model.name}, choice {together(equations)}",
        t=t,
        q=dict(zip(labels[:nq], x[:, :nq].T)),
        w=dict(zip(labels[nq:], x[:, nq:].T)),
        v=named("velocity"),
        outputs=named("outputs"),
        units=_units(equations),
        T=energies[:, 0],
        V=energies[:, 1],
        jacobi=energies[:, 2] if energies.shape[1] > 2 else None,
        inputs=fed,
        events=_events(found),
        stopped_by=_stopping(found),
        error=found.error,
        work=found.work,
        phi=np.max(violation[:, :closed], axis=1, initial=0.0),
        slip=np.max(violation[:, closed:], axis=1, initial=0.0),
        steps=found.steps,
        rejected=found.rejected,
        calls=found.calls,
        position_violation=found.position_violation,
        velocity_violation=found.velocity_violation,
        crossings=found.crossings,
        seconds=seconds,
        charts=found.charts,
        acceleration_violation=max(
            _acceleration_violation(equations, module, *part, u, p) for part in parts
        ),
        switches=charts.switches(equations, rows, t),
        choices=rows if len({equations.choice, *rows}) > 1 else (),
    )


def _events(found: Any) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times and states by name."""
    if found.events is None:
        return {}
    named = {name: found.events.of(name) for name in found.events.names}
    return {name: (each.t.astype(float), each.x.astype(float)) for name, each in named.items()}


def _stopping(found: Any) -> str | None:
    if Status(found.status) is not Status.EVENT:
        return None
    return found.events.names[int(found.events.which[-1])]


def balanced(energies: np.ndarray) -> np.ndarray:
    """What the power changes, of rows of the function `energy`: Jacobi's integral where it is
    there, else T + V."""
    return energies[:, 2] if energies.shape[1] > 2 else energies[:, 0] + energies[:, 1]


def _acceleration_violation(
    first: Equations,
    module: ModuleType,
    chart: int,
    places: np.ndarray,
    part: Any,
    u: np.ndarray,
    p: np.ndarray,
) -> float:
    """max |A v̇ − β| over the rows of one chart, v̇ the derivative of v(t, x) along the compiled
    ẋ."""
    equations, system, t, x = (first, *first.charts)[chart], first.system, part.t, part.x
    if not system.rows:
        return 0.0
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    v = equations.function("velocity").result.value
    xdot = ca.SX.sym("xdot", slots["x"].numel())
    vdot = ca.jtimes(v, slots["x"], xdot) + ca.jacobian(v, slots["t"])
    # β stands over v, the state over w: v(t, x) takes its place
    beta = ca.substitute(system.beta, system.v, v)
    residual = ca.Function(
        "residual", [slots["t"], slots["x"], slots["p"], xdot], [ca.mtimes(system.A, vdot) - beta]
    )
    dynamics = charts.in_chart(module, "dynamics", chart)
    assert dynamics is not None  # it was integrated
    p = charts.parameters(part, p)
    rates = dynamics(t, x, charts.inputs(part, u), p).astype(float)
    each = np.broadcast_to(p, (len(t), p.shape[-1]))
    return float(np.max(np.abs(np.asarray(residual(t[np.newaxis], x.T, each.T, rates.T)))))


def _units(equations: Equations) -> dict[str, str]:
    x, u = equations.argument("x"), equations.argument("u")
    results = [
        function.result
        for function in equations.functions
        if function.name in ("velocity", "outputs")
    ]
    return {
        name: unit for source in (x, u, *results) for name, unit in zip(source.labels, source.units)
    }
