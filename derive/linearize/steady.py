"""Steady motions: all but the cyclic coordinates and all quasi-velocities constant, found by Newton
with the exact Jacobian of the forces that are not balanced."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.expressions.columns import columns_of
from derive.expressions.deferred import changed
from derive.expressions.evaluate import number, value
from derive.expressions.tree import Expression
from derive.formulations.records import Equations
from derive.linearize.balance import Balance, forces
from derive.linearize.limits import (
    CREEPS,
    FAR,
    FLAT,
    HALVINGS,
    KEPT,
    LEAP,
    RANK,
    STANDS,
    STEADY_STEPS,
    STRAIGHT,
    STRAYS,
)
from derive.linearize.minimal import position_rows
from derive.linearize.records import Steady
from derive.linearize.turned import turned
from derive.linearize.turning import rates_of_angles
from derive.mechanics.records import System
from derive.model.records import Span, SteadyMotion
from derive.states import gimbal
from derive.states.closing import Kinematics, closed, nominal, normalised
from derive.states.initial import initial_state
from derive.states.scales import scales
from derive.states.speeds import speed_rows

GUESS = "guess"
NEARER = 5  # times that the way from one steady motion to the next is halved
BESIDE = (0.1, 0.3, 1.0)  # how far beside the first start others are tried
TOLD = 3  # changes from the guess that are told at most


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
    names += [f"length of quaternion {k + 1}" for k in range(len(system.quaternions))]
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


def settled(found: Problem, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(x, u) of the steady motion for one set of values: the first that is found near the first
    start, or else the nearest to it that any start leads to.

    Motions that creep are tried at rest: where velocities enter squared, Newton's method comes to
    rest slowly. Raises AssumptionError.
    """
    problem: AssumptionError | None = None
    motions: list[tuple[float, np.ndarray]] = []
    guess = None
    for start in starts(found, p, s):
        guess = start if guess is None else guess
        try:
            y = _at_rest(found, solved(found, p, s, start), p, s)
            _check_attitude(found, y[: found.equations.system.q.numel()], p)
        except AssumptionError as error:
            problem = problem or error
            continue
        motions.append((float(np.max(_strayed(found, guess, y), initial=0.0)), y))
        if motions[-1][0] <= FAR:
            break
    if motions:
        return min(motions, key=lambda motion: motion[0])[1]
    raise _turned(found, p, s) or problem or AssertionError


def _turned(found: Problem, p: np.ndarray, s: np.ndarray) -> AssumptionError | None:
    """Why no motion is steady in these quasi-velocities, where the motion that is asked for turns
    their axes."""
    equations, motion = found.equations, found.motion
    if motion.name == GUESS and not motion.values:  # it may be asked for at rest
        return None
    cyclic = {*range(equations.system.q.numel())} - {*found.still}
    why = turned(equations, cyclic, np.concatenate([next(starts(found, p, s)), p]))
    if why is None:
        return None
    are = "is along an axis" if len(why.speeds) == 1 else "are along axes"
    message = (
        f"'{motion.name}' is no steady motion in the quasi-velocities of '{equations.choice}': "
        f"{listed(why.speeds)} {are} that turn with {why.coordinate}, and cannot be constant"
    )
    advice = f"others, such as quasi_velocities: {{rates: [{', '.join(why.instead)}]}}"
    return AssumptionError(equations.system.model.diagnostic(motion.span, message, advice))


def _strayed(found: Problem, guess: np.ndarray, y: np.ndarray) -> np.ndarray:
    """By what each coordinate that the motion keeps differs, in the model's own units."""
    kept = list(found.still)
    return np.abs(y - guess)[kept] / found.scale[kept]


def moves(
    found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray
) -> tuple[tuple[str, float, float], ...]:
    """Coordinates with their values at the guess and at the motion y = (x, u), the largest changes
    first, where the motion is far from the guess; else none."""
    guess = next(starts(found, p, s))
    by = _strayed(found, guess, y)
    largest = np.max(by, initial=0.0)
    if largest <= FAR:
        return ()
    order = sorted(range(len(by)), key=lambda k: -by[k])[:TOLD]
    names = found.equations.arguments[1].labels
    places = [found.still[k] for k in order if by[k] > largest / 10]
    return tuple((names[i], float(guess[i]), float(y[i])) for i in places)


def _check_attitude(found: Problem, q: np.ndarray, p: np.ndarray) -> None:
    """Raises AssumptionError where Euler angles are in gimbal lock: their rates have no slopes."""
    N = found.kinematics.rates(np.zeros(1), q[np.newaxis], p[np.newaxis])
    names = [] if N is None else gimbal.locked(found.equations.system, N.largest()[0])
    if names:
        where = f"at the steady motion '{found.motion.name}'"
        raise AssumptionError(gimbal.told(names, where), hint=gimbal.INSTEAD)


def _at_rest(found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The same motion at rest, where y creeps and rest near it is steady, too; else y."""
    w = found.equations.speeds
    if not 0 < np.max(np.abs(y[w]), initial=0.0) < CREEPS:
        return y
    still = y.copy()
    still[w] = 0.0
    try:
        still = solved(found, p, s, still)
    except AssumptionError:
        return y
    return still if np.max(np.abs(still - y), initial=0.0) < np.sqrt(CREEPS) else y


def starts(found: Problem, p: np.ndarray, s: np.ndarray) -> Iterator[np.ndarray]:
    """(x, u) to begin with. A motion of the file has held and guessed values put in, and is nearest
    to rest on the constraints; `guess` begins at the initial values, then at rest there. Then a
    little beside these, as far as values are not held.
    """
    system, motion = found.equations.system, found.motion
    given = found.given(p, s) | {name: _number(found, e, p) for name, e in motion.guesses}
    free = np.array([c.name not in dict(motion.values) for c in system.model.coordinates])
    if motion.name == GUESS and not motion.values:
        changes = {name: _number(found, e, p) for name, e in motion.guesses}
        initial = initial_state(system, changes, p)
        q, spreads = initial.q, (0.0, *BESIDE)
        _check_attitude(found, q, p)
        yield _state(found, given, q, initial.v, p)
    else:
        q, spreads = _positions(found, given, free, p), BESIDE
        _check_attitude(found, q, p)
        yield _state(found, given, q, _velocities(found, given, q, p), p)
    rng, sizes = np.random.default_rng(0), found.scale[: len(q)] * free
    for spread in spreads:
        beside = normalised(system, q + spread * sizes * rng.uniform(-1, 1, len(q)))
        on = closed(found.kinematics, 0.0, beside, p, free)
        if on is not None:
            yield _state(found, given, on, _velocities(found, given, on, p), p)


def _number(found: Problem, formula: Expression, p: np.ndarray) -> float:
    names = {x.name: x.value for x in found.equations.system.model.parameters}
    return number(formula, names | dict(zip(found.equations.arguments[3].labels, p)))


def _state(
    found: Problem, given: dict[str, float], q: np.ndarray, v: np.ndarray, p: np.ndarray
) -> np.ndarray:
    w = found.speeds(0.0, q, p).full() @ v
    z = [
        given.get(x.name, _number(found, x.initial, p)) for x in found.equations.system.model.states
    ]
    return np.concatenate(
        [q, w, z, [given.get(i.name, 0.0) for i in found.equations.system.model.inputs]]
    )


def _positions(
    found: Problem, given: dict[str, float], free: np.ndarray, p: np.ndarray
) -> np.ndarray:
    system = found.equations.system
    q = nominal(system)
    for i, c in enumerate(system.model.coordinates):
        q[i] = given.get(c.name, q[i])
    q = normalised(system, q)
    on = closed(found.kinematics, 0.0, q, p, free)
    return q if on is None else on


def _velocities(
    found: Problem, given: dict[str, float], q: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """The smallest v with A v = c and the held rates."""
    system = found.equations.system
    A, c, N = found.kinematics.velocities(0.0, q, p)
    rows = {f"der({x.name})": N[i] for i, x in enumerate(system.model.coordinates)}
    rows |= {x.name: np.eye(A.shape[1])[j] for j, x in enumerate(system.model.velocities)}
    rows |= {name: row(0.0, q, p).full()[0] for name, row in found.declared.items()}
    names = [name for name in given if name in rows]
    matrix = np.vstack([A, *[rows[name] for name in names]])
    return np.linalg.lstsq(
        matrix, np.concatenate([c, [given[name] for name in names]]), rcond=RANK
    )[0]


def solved(found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(x, u) of the steady motion near y, by damped Newton on forces, or else on rates: these grow
    where the choice turns singular, and say so. Raises AssumptionError, with the residual, where
    there is none."""
    rates = Balance(found.residual, found.function)
    if found.balance.mass is not None:
        try:
            return _solved(found, found.balance, p, s, y)
        except AssumptionError:
            pass
    return _solved(found, rates, p, s, y)


def _solved(
    found: Problem, balance: Balance, p: np.ndarray, s: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """In the model's own units. Steps are those of least squares: a family of steady motions leaves
    directions open, and rows may repeat each other."""
    y, free = with_inputs(found, y, p, s)
    D = found.scale
    rates = row_sizes(found, _evaluated(found, found.function, y, p, s)[1])
    rows = balance.sizes(y, p, rates)
    step, done = np.zeros_like(y), False
    for _ in range(STEADY_STEPS):
        residual, slopes = _evaluated(found, balance.function, y, p, s)
        scaled = slopes * (free * D) / rows[:, None]
        step = -D * np.linalg.lstsq(scaled, residual / rows, rcond=RANK)[0]
        y, done = _damped(found, balance, y, step, (p, s), residual, rows)
        if done:
            break
    if not done and _share(found, step, y) > STRAYS:
        raise _lost(found, y, step)
    R, J = _evaluated(found, found.function, y, p, s)
    worst = _excess(R / rates, J * D / rates[:, None], y / D)
    if not np.all(np.isfinite(R)) or np.max(worst, initial=0.0) > KEPT:
        raise _refused(found, R, worst, s)
    return y


def check_pivots(found: Problem, y: np.ndarray, p: np.ndarray) -> None:
    """What the equations divide by is there at the motion y = (x, u): else rates of speeds were
    solved for that mean nothing. Raises AssumptionError."""
    pivots = found.pivots(*np.split(y, [found.function.size1_in(0)]), p).full()
    if np.any(np.abs(pivots) < 1.0):
        raise _singular(found)


def row_sizes(found: Problem, J: np.ndarray) -> np.ndarray:
    """One of each row in the model's own units; of a position row, which does not say its unit,
    what its slopes J say."""
    own = scales(found.equations.system.model)
    slopes = np.max(np.abs(J * found.scale), axis=1, initial=0.0)
    return np.array(
        [
            own.of(unit) if unit or own.plain or not slope else slope
            for unit, slope in zip(found.units, slopes)
        ]
    )


def with_inputs(
    found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """y with the inputs that are held at their values, and which entries are left to find."""
    y, free = y.copy(), np.ones(len(y))
    first = found.equations.arguments[1].symbols.numel()
    given = found.given(p, s)
    for k, name in enumerate(found.equations.arguments[2].labels, start=first):
        if name in given:
            y[k], free[k] = given[name], 0.0
    return y, free


def _evaluated(
    found: Problem, function: ca.Function, y: np.ndarray, p: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    nx = found.equations.arguments[1].symbols.numel()
    values, slopes = function(y[:nx], y[nx:], p, s)
    R, J = np.asarray(values).ravel(), np.asarray(slopes)
    if not (np.all(np.isfinite(R)) and np.all(np.isfinite(J))):
        raise _singular(found)
    return R, J


def _singular(found: Problem) -> AssumptionError:
    return AssumptionError(
        f"the equations of '{found.equations.choice}' are singular near the steady motion "
        f"'{found.motion.name}'",
        "another choice of quasi-velocities, such as --choice orthonormal, which is regular where "
        "the constraints are independent, or other guesses",
    )


def _damped(
    found: Problem,
    balance: Balance,
    y: np.ndarray,
    step: np.ndarray,
    given: tuple[np.ndarray, np.ndarray],
    R: np.ndarray,
    rows: np.ndarray,
) -> tuple[np.ndarray, bool]:
    """The step, no leap and halved while it makes things worse; done where it no longer moves
    anything."""
    nx = found.equations.arguments[1].symbols.numel()
    before, scale = float(np.linalg.norm(R / rows)), _leap(found, y, step)
    for _ in range(HALVINGS):
        trial = y + scale * step
        after = np.asarray(balance.values(trial[:nx], trial[nx:], *given)).ravel()
        if np.all(np.isfinite(after)) and float(np.linalg.norm(after / rows)) <= before:
            break
        scale /= 2
    else:
        return y, True
    return trial, _share(found, step, y) <= STANDS or before == 0.0


def _leap(found: Problem, y: np.ndarray, step: np.ndarray) -> float:
    """The part of a step that moves no coordinate too far at once: equilibria near by are not
    leaped over."""
    nq = found.equations.system.q.numel()
    moved, size = (float(np.max(np.abs(x[:nq] / found.scale[:nq]), initial=0.0)) for x in (step, y))
    allowed = LEAP * (1.0 + size)
    return 1.0 if moved <= allowed else allowed / moved


def _share(found: Problem, step: np.ndarray, y: np.ndarray) -> float:
    """How large a step is beside y, in the model's own units."""
    moved, size = (float(np.max(np.abs(x / found.scale), initial=0.0)) for x in (step, y))
    return moved / (1.0 + size)


def _excess(R: np.ndarray, J: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Residuals relative to what the terms of their rows could amount to."""
    slopes = np.maximum(np.max(np.abs(J), axis=1, initial=0.0), FLAT)
    return np.abs(R) / (slopes * (1.0 + float(np.max(np.abs(y), initial=0.0))))


def _lost(found: Problem, y: np.ndarray, step: np.ndarray) -> AssumptionError:
    """Where forces fade away with distance, nothing is missed far enough out."""
    model, motion = found.equations.system.model, found.motion
    names = (*found.equations.arguments[1].labels, *found.equations.arguments[2].labels)
    k = int(np.argmax(np.abs(step / found.scale)))
    message = (
        f"no steady motion was found: the search for '{motion.name}' runs away, "
        f"{names[k]} is {y[k]:.3g} and still changes by {step[k]:.3g}"
    )
    advice = "what keeps the motion steady to be held, or another guess"
    return AssumptionError(model.diagnostic(motion.span, message, advice))


def _refused(found: Problem, R: np.ndarray, excess: np.ndarray, s: np.ndarray) -> AssumptionError:
    model, motion = found.equations.system.model, found.motion
    k = int(np.argmax(excess))
    unit = f" {found.units[k]}" if found.units[k] else ""
    what = f"'{motion.name}' is no steady motion"
    if motion.name == GUESS and not motion.values:
        what = "no steady motion was found near the initial values"
    missed = f"is missed by {R[k]:.3g}{unit}"
    if found.rows[k].startswith("der(") and found.rows[k] not in dict(motion.values):
        missed = f"would have to vanish and is {R[k]:.3g}{unit}"
    guesses = "other guesses (`guess:` of the motion, or --set)"
    if motion.name == GUESS and not motion.values:
        guesses = "other guesses (`initial:` of the file, or --set)"
    advice = (
        f"held values that can be kept for ever; {guesses}, an input that is `free`, "
        "or another --choice"
    )
    if found.equations.system.quaternions:
        advice += (
            "; a body that goes on turning needs `orientation: {euler: …}`, or hinges: its "
            "quaternion turns along"
        )
    if turning := rates_of_angles(found.equations, found.rows[k]):
        advice += f"; {turning}"
    free = ", ".join(f"{name} = {x:.3g}" for name, x in zip(motion.sweepable, s))
    message = f"{what}{f' with {free}' if free else ''}: {found.rows[k]} {missed}"
    return AssumptionError(model.diagnostic(motion.span, message, advice))


def family(found: Problem, p: np.ndarray, s: np.ndarray) -> Steady:
    """The steady motions for rows of p (N × np) and s (N × ns): continued from row to row, with
    straight lines between where those will do. Continuation stays on one branch where several
    exist. Raises AssumptionError where a row has no steady motion."""
    many, nx = len(p), found.equations.arguments[1].symbols.numel()
    y = np.zeros((many, nx + found.equations.system.u.numel()))
    y[0] = settled(found, p[0], s[0])
    _between(found, p, s, y, 0, many - 1, y[0])
    R = residuals_of(found, y, p, s)
    return Steady(y[:, :nx], y[:, nx:], p, np.max(np.abs(R), axis=1, initial=0.0))


def residuals_of(found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """R (N × rows) at N motions y = (x, u)."""
    nx = found.equations.arguments[1].symbols.numel()
    return columns_of(found.residual)(y[:, :nx].T, y[:, nx:].T, p.T, s.T)[0][:, 0].T


def _between(
    found: Problem,
    p: np.ndarray,
    s: np.ndarray,
    y: np.ndarray,
    first: int,
    last: int,
    guess: np.ndarray,
) -> None:
    """Fill the rows after `first`: by the chord to `last` where every motion on it is steady, else
    row by row."""
    if last <= first:
        return
    try:
        y[last] = solved(found, p[last], s[last], guess)
        if last == first + 1:
            return
        inner = slice(first + 1, last)
        parts = _parts(np.hstack([p, s]), first, last)[:, np.newaxis]
        chord = y[first] + parts * (y[last] - y[first])
        off = np.max(np.abs(residuals_of(found, chord, p[inner], s[inner])), initial=0.0)
        if off <= STRAIGHT * (1 + np.max(np.abs(chord))):
            y[inner] = chord
            return
    except AssumptionError:  # too far at once
        pass
    for k in range(first + 1, last + 1):
        ahead = y[k - 1] if k < first + 2 else 2 * y[k - 1] - y[k - 2]
        y[k] = _stepped(found, p, s, y, k, ahead)


def _stepped(
    found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray, k: int, ahead: np.ndarray
) -> np.ndarray:
    """From the extrapolated guess, or else from the last motion, by motions between."""
    try:
        return solved(found, p[k], s[k], ahead)
    except AssumptionError:
        return _by_halves(found, p[k - 1 : k + 1], s[k - 1 : k + 1], y[k - 1], NEARER)


def _by_halves(
    found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray, depth: int
) -> np.ndarray:
    """From the motion y of the first row of values to that of the second: by one in the middle
    where that is too far at once, `depth` times over."""
    try:
        return solved(found, p[1], s[1], y)
    except AssumptionError:
        if not depth:
            raise
    middle_p, middle_s = p.mean(axis=0), s.mean(axis=0)
    middle = _by_halves(found, np.array([p[0], middle_p]), np.array([s[0], middle_s]), y, depth - 1)
    return _by_halves(
        found, np.array([middle_p, p[1]]), np.array([middle_s, s[1]]), middle, depth - 1
    )


def _parts(values: np.ndarray, first: int, last: int) -> np.ndarray:
    """How far each row between is on the way from the first to the last."""
    way = values[last] - values[first]
    length = float(way @ way)
    inner = values[first + 1 : last] - values[first]
    return inner @ way / length if length > 0 else np.zeros(last - first - 1)
