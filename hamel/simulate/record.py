"""What is known of a motion: what the module's own functions say about its rows, and how it was
made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType

import casadi as ca
import numpy as np

from codegen.runtime.simulation import Simulation, Status
from derive.formulations.charts import BETWEEN, together
from derive.formulations.projection import positions
from derive.formulations.records import Equations
from derive.states.initial import Initial
from hamel import charts
from hamel.records import Simulated
from hamel.simulate.energies import largest_error
from hamel.simulate.figure import figure
from hamel.simulate.measures import measures
from hamel.simulate.method import Method

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Source:
    """What a motion was made of: the equations as they were integrated, their module, inputs u and
    parameters p; the method and the start."""

    equations: Equations
    module: ModuleType
    u: np.ndarray
    p: np.ndarray
    method: Method
    initial: Initial


def simulated(source: Source, simulation: Simulation, seconds: float) -> Simulated:
    """The record of a motion that took `seconds` to compute. The module's own functions say what
    its rows are, each in the chart it was made in."""
    equations, method = source.equations, source.method
    source = replace(source, p=charts.parameters(simulation, source.p))
    names, title = charts.choices(equations, simulation), _title(equations)
    groups = _groups(source, simulation)
    found = {"t": simulation.t, **_measured(source, simulation)}
    called = measures(equations.system.model)
    columns = _columns(source, simulation, groups)
    columns |= {called.get(name, name): values for name, values in found.items()}
    several = len({*names, equations.choice}) > 1
    written = columns | ({called["choice"]: np.array(names)} if several else {})
    units = _units(equations)
    events = _events(simulation)
    return Simulated(
        model=equations.system.model.name,
        formulation=equations.formulation,
        choice=together(equations) if BETWEEN in (method.choice or "") else equations.choice,
        enforcement=method.enforcement or "",
        integrator=method.integrator,
        alpha=method.alpha,
        time=float(simulation.t[-1]),
        steps=simulation.steps,
        rejected=simulation.rejected,
        calls=simulation.calls,
        seconds=seconds,
        position_violation=simulation.position_violation,
        velocity_violation=simulation.velocity_violation,
        acceleration_violation=_acceleration_violation(source, simulation),
        energy_balance=largest_error(found),
        error=_error_estimate(simulation),
        crossings=simulation.crossings,
        landings=simulation.landings,
        events={name: t.tolist() for name, (t, _) in events.items()},
        stopped_by=_stopping(simulation),
        at_events={name: rows for name, (_, rows) in events.items()},
        charts=simulation.charts,
        switches=charts.switches(equations, names, simulation.t),
        moved={n: {"given": value, "used": used} for n, value, used in source.initial.moved},
        final={name: float(values[-1]) for name, values in columns.items()},
        file=None,
        plot=None,
        simulation=simulation,
        motion=written,
        measures=found,
        title=title,
        units=units,
        figure=partial(figure, title, found, groups, units),
    )


def _title(equations: Equations) -> str:
    return f"{equations.system.model.name}, choice {together(equations)}"


def _groups(source: Source, simulation: Simulation) -> dict[str, Columns]:
    """Coordinates, quasi-velocities, first-order states, inputs that change, outputs: what is
    drawn, by name."""
    equations = source.equations
    w = equations.speeds
    labels = equations.argument("x").labels
    x, fed = simulation.x.T, simulation.u
    return {
        "coordinates": dict(zip(labels[: w.start], x[: w.start])),
        "quasi-velocities": dict(zip(labels[w], x[w])),
        "states": dict(zip(labels[w.stop :], x[w.stop :])),
        "inputs": {} if fed is None else dict(zip(source.module.inputs, fed.astype(float).T)),
        "outputs": _labelled(source, simulation, "outputs"),
    }


def _labelled(source: Source, simulation: Simulation, name: str) -> Columns:
    """The entries of a function at every row; none where there is no such function."""
    rows = _rows(source, simulation, name)
    if not rows.shape[1]:
        return {}
    return dict(zip(source.equations.function(name).result.labels, rows.T))


def _rows(source: Source, simulation: Simulation, name: str) -> np.ndarray:
    w = source.equations.speeds
    return charts.at_rows(source.module, name, simulation, w, source.u, source.p)


def _columns(source: Source, simulation: Simulation, groups: Mapping[str, Columns]) -> Columns:
    """Everything of the model by name, a value per row; a declared quasi-velocity with the name of
    an output, or the like, has _w behind it."""
    named = {
        **groups["states"],
        **_constant_inputs(source, simulation),
        **groups["inputs"],
        **groups["outputs"],
    }
    speeds = groups["quasi-velocities"].items()
    own = {f"{name}_w" if name in named else name: values for name, values in speeds}
    v = _labelled(source, simulation, "velocity")
    return {"t": simulation.t, **groups["coordinates"], **own, **v, **named}


def _measured(source: Source, simulation: Simulation) -> Columns:
    """Energies, the work of all forces without potential since the first row, and violations."""
    energies = _rows(source, simulation, "energy")
    integral = {"jacobi": energies[:, 2]} if energies.shape[1] > 2 else {}
    shares = {"T": energies[:, 0], "V": energies[:, 1], **integral, "work": simulation.work}
    return shares | _violations(source, simulation)


def _constant_inputs(source: Source, simulation: Simulation) -> Columns:
    """Inputs that do not change belong to the data all the same: `hamel identify` reads them."""
    return {
        name: np.full(len(simulation.t), float(value))
        for name, value in zip(source.module.inputs, source.u)
    }


def _violations(source: Source, simulation: Simulation) -> Columns:
    """max |φ| and max |A v − c| of every row, as it was integrated: without whole turns of angles
    where nothing depends on these."""
    closed = positions(source.equations.system)
    sizes = np.abs(_rows(source, _reduced(simulation), "constraints"))
    return {
        "position_violation": np.max(sizes[:, :closed], axis=1, initial=0.0),
        "velocity_violation": np.max(sizes[:, closed:], axis=1, initial=0.0),
    }


def _reduced(simulation: Simulation) -> Simulation:
    reduced = simulation.reduced
    return simulation if reduced is None else replace(simulation, x=reduced.astype(float))


def _error_estimate(simulation: Simulation) -> float | None:
    """The largest at the end; None where there is none."""
    error = simulation.error
    if error is None or not np.isfinite(error[-1:]).any():
        return None
    return float(np.nanmax(error[-1]))


def _events(simulation: Simulation) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times and states by name."""
    events = simulation.events
    if events is None:
        return {}
    by_name = {name: events.of(name) for name in events.names}
    return {name: (each.t.astype(float), each.x.astype(float)) for name, each in by_name.items()}


def _stopping(simulation: Simulation) -> str | None:
    """The event that ended the motion."""
    events = simulation.events
    if Status(simulation.status) is not Status.EVENT or events is None:
        return None
    return events.names[int(events.which[-1])]


def _acceleration_violation(source: Source, simulation: Simulation) -> float:
    """The largest |A v̇ − β| of all rows, each in its chart."""
    w = source.equations.speeds
    pieces = charts.pieces(source.module, _reduced(simulation), w, source.u, source.p)
    return max(_largest_violation(source, chart, piece) for chart, _, piece in pieces)


def _largest_violation(source: Source, chart: int, piece: Simulation) -> float:
    """max |A v̇ − β| over the rows of one chart, v̇ the derivative of v(t, x) along the compiled
    ẋ."""
    equations = (source.equations, *source.equations.charts)[chart]
    system, t, x = source.equations.system, piece.t, piece.x
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
    dynamics = charts.in_chart(source.module, "dynamics", chart)
    assert dynamics is not None  # it was integrated
    p = charts.parameters(piece, source.p)
    rates = dynamics(t, x, charts.inputs(piece, source.u), p).astype(float)
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
