"""What a steady motion has to satisfy: all but the cyclic coordinates and all quasi-velocities are
constant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.expressions.columns import columns_of
from derive.expressions.deferred import changed
from derive.expressions.evaluate import value
from derive.expressions.tree import Name
from derive.formulations.records import Equations
from derive.linearize.balance import Balance, forces
from derive.linearize.minimal import position_rows
from derive.mechanics.records import System
from derive.model.records import Span, SteadyMotion
from derive.states.closing import Kinematics
from derive.states.scales import scales
from derive.states.speeds import speed_rows

GUESS = "guess"
LENGTH = "length of quaternion"


@dataclass(frozen=True)
class Problem:
    """R(x, u, p, s) = 0 for the unknowns (x, u): rows by name, with s the free names of the motion
    and p the parameters."""

    equations: Equations
    motion: SteadyMotion
    rows: tuple[str, ...]
    units: tuple[str, ...]
    function: ca.Function  # (x, u, p, s) → R, ∂R/∂(x, u)
    balance: Balance  # the rows that are searched with
    residual: ca.Function  # (x, u, p, s) → R
    shifts: ca.Function  # (x, u, p, s) → ∂R/∂(p, s)
    kinematics: Kinematics
    speeds: ca.Function  # (t, q, p) → B of w = B v
    declared: dict[str, ca.Function]  # (t, q, p) → row of a quasi-velocity that the file declares
    pivots: ca.Function  # (x, u, p) → what is divided by, in units of the least that is let through
    names: tuple[str, ...]  # what is held
    held: ca.Function  # (p, s) → its values
    scale: np.ndarray  # one of each unknown
    still: tuple[int, ...]  # coordinates that the motion keeps: all but the cyclic ones

    def given(self, p: np.ndarray, s: np.ndarray) -> dict[str, float]:
        """Held values by name, in SI, for these parameters p and free names s."""
        return dict(zip(self.names, self.held(p, s).full().ravel().tolist()))


def rest(equations: Equations) -> SteadyMotion:
    """The motion `guess`: nothing is held, the search starts from the initial values."""
    model = equations.system.model
    span = model.initial[0].span if model.initial else Span(0, 0)
    return SteadyMotion(GUESS, (), (), span)


def motion_of(equations: Equations, name: str | None) -> SteadyMotion:
    """The file's steady motion of that name, its first one, or `guess`. Raises AssumptionError for
    an unknown name."""
    known = {motion.name: motion for motion in equations.system.model.steady_motions}
    if name is None:
        return next(iter(known.values()), rest(equations))
    if name in known:
        return known[name]
    if name == GUESS:
        return rest(equations)
    offered = (*known, GUESS)
    raise AssumptionError(
        f"unknown steady motion '{name}'",
        did_you_mean(name, offered)
        or f"known: {listed(offered)}, an equilibrium found from the initial state",
    )


def is_guess(motion: SteadyMotion) -> bool:
    """Whether it is what is found near the initial values; inputs may be given with it."""
    given = all(formula == Name(name) for name, formula in motion.values)
    return motion.name == GUESS and given and set(motion.sweepable) >= {*dict(motion.values)}


def with_free_inputs(
    equations: Equations, motion: SteadyMotion, names: Iterable[str]
) -> SteadyMotion:
    """The motion; if it is what is found near the initial values, with those of `names` that are
    inputs free to be given, where they are zero else."""
    if not is_guess(motion):
        return motion
    inputs = tuple(i.name for i in equations.system.model.inputs if i.name in set(names))
    return replace(motion, values=tuple((x, Name(x)) for x in inputs), sweepable=inputs)


def check_still(system: System) -> None:
    """Refuses what is seen to depend on time before anything is chosen: positions, and what acts on
    velocities that no constraint ties. Raises AssumptionError."""
    A = ca.sparsify(system.A)
    free = [i for i in range(system.v.numel()) if not A[:, i].nnz()]
    _check_still(system, ca.vertcat(system.phi, system.Q[free]), system.t)


def _check_still(system: System, value: ca.SX, t: ca.SX) -> None:
    if ca.depends_on(value, t):
        raise AssumptionError(
            f"{system.model.name} depends on time and has no steady motion",
            "linearise along a motion: the generated function `linearization` takes t",
        )


def problem(equations: Equations, motion: SteadyMotion, cyclic: Sequence[int]) -> Problem:
    """The equations of a steady motion: φ = 0, f = 0 in all rows but those of cyclic coordinates,
    and held = given. Unknowns are (x, u). Raises AssumptionError where the equations depend on
    time."""
    system = equations.system
    t, x, u, p = (argument.symbols for argument in equations.arguments)
    f = equations.function("dynamics").result
    _check_still(system, ca.vertcat(f.value, system.phi), t)
    s = (
        ca.vertcat(*[ca.SX.sym(name) for name in motion.sweepable])
        if motion.sweepable
        else ca.SX(0, 1)
    )
    # a cyclic coordinate may go on changing: a rolling wheel's angle does
    still = [i for i in range(f.value.numel()) if i not in cyclic]
    wanted = _values_by_name(equations, motion, s)
    quantities = _quantities(equations) | _declared(equations)
    held = _column([quantities[name][0] - value for name, value in wanted.items()])
    positions = position_rows(system)
    names = [
        row.name
        for row in sorted((r for r in system.rows if r.position >= 0), key=lambda r: r.position)
    ]
    names += [f"{LENGTH} {k + 1}" for k in range(len(system.quaternions))]
    R = ca.densify(ca.vertcat(positions, f.value[still, 0], held))
    y = ca.vertcat(x, u)
    B = equations.term("B")
    known = [x, u, p, s]
    function = ca.Function("steady", known, [R, ca.densify(ca.jacobian(R, y))])
    residual = ca.Function("residual", known, [R])
    first = positions.numel() + still.index(equations.speeds.start) if equations.w else 0
    pivots = [guard.value / guard.tolerance for guard in equations.function("dynamics").guards]
    return Problem(
        equations=equations,
        motion=motion,
        rows=(*names, *(f.labels[i] for i in still), *wanted),
        units=(
            *("" for _ in names),
            *(f.units[i] for i in still),
            *(quantities[name][1] for name in wanted),
        ),
        function=function,
        balance=forces(equations, known, R, first) or Balance(residual, function),
        residual=residual,
        shifts=ca.Function("shifts", known, [ca.densify(ca.jacobian(R, ca.vertcat(p, s)))]),
        kinematics=Kinematics(changed(system, p=system.own_p)),
        speeds=ca.Function("B", [system.t, system.q, system.own_p], [ca.densify(B)]),
        declared={
            name: ca.Function("row", [system.t, system.q, system.own_p], [ca.densify(row)])
            for name, row in speed_rows(system).items()
        },
        pivots=ca.Function("pivots", [x, u, p], [ca.substitute(_column(pivots), t, 0.0)]),
        names=tuple(wanted),
        held=ca.Function("held", [p, s], [_column(list(wanted.values()))]),
        scale=scales(system.model).all_of(
            (*equations.arguments[1].units, *(i.unit for i in system.model.inputs))
        ),
        still=tuple(i for i in range(system.q.numel()) if i not in cyclic),
    )


def _column(entries: list[ca.SX]) -> ca.SX:
    return ca.densify(ca.vertcat(*entries)) if entries else ca.SX(0, 1)


def _values_by_name(equations: Equations, motion: SteadyMotion, s: ca.SX) -> dict[str, ca.SX]:
    """Values of what is held, by name; inputs that are not named are zero."""
    system = equations.system
    names = dict(system.symbols.names) | {name: s[k] for k, name in enumerate(motion.sweepable)}
    wanted = {i.name: ca.SX(0) for i in system.model.inputs if i.name not in motion.free}
    return wanted | {
        name: ca.SX(value(e, names, system.symbols.rates, system.symbols.functions))
        for name, e in motion.values
    }


def _quantities(equations: Equations) -> dict[str, tuple[ca.SX, str]]:
    """Everything that can be held: coordinates, their rates, generalized velocities and inputs,
    over (x, u, p), with units."""
    system, model = equations.system, equations.system.model
    results = {f.name: f.result.value for f in equations.functions}
    quantities = {c.name: (system.q[i], c.unit) for i, c in enumerate(model.coordinates)}
    quantities |= {
        f"der({c.name})": (results["dynamics"][i], f"{c.unit or 1}/s")
        for i, c in enumerate(model.coordinates)
    }
    quantities |= {v.name: (results["velocity"][i], v.unit) for i, v in enumerate(model.velocities)}
    quantities |= {x.name: (system.z[k], x.unit) for k, x in enumerate(model.states)}
    return quantities | {i.name: (system.u[k], i.unit) for k, i in enumerate(model.inputs)}


def _declared(equations: Equations) -> dict[str, tuple[ca.SX, str]]:
    """The quasi-velocities that a motion may hold, over (x, p), with units."""
    v = equations.function("velocity").result.value
    rows = speed_rows(equations.system)
    units = {x.name: x.unit for x in equations.system.model.speeds}
    return {name: (ca.mtimes(row, v), units[name]) for name, row in rows.items()}


def residuals_of(found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """R (N × rows) at N motions y = (x, u)."""
    nx = found.equations.arguments[1].symbols.numel()
    return columns_of(found.residual)(y[:, :nx].T, y[:, nx:].T, p.T, s.T)[0][:, 0].T
