"""A motion with more digits than a double holds, and how far it can be wrong.

Two Taylor runs of different order, precision and steps have to agree; twice what they differ by is
the bound. They integrate the equations of one choice, so v̇ at the last state is also compared with
the independent derivation in maximal coordinates.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from decimal import Decimal, localcontext
from fractions import Fraction
from math import ceil

import casadi as ca
import numpy as np

from derive.expressions.instructions import listing
from derive.formulations.evaluate import evaluator, function_of
from derive.formulations.records import Equations
from derive.states.closing import Kinematics
from derive.states.initial import Initial
from hamel.build import store
from hamel.simulate.exact.series import Fixed, Graph, NotAnalytic, Series
from hamel.simulate.exact.taylor import Problem as Flow
from hamel.simulate.exact.taylor import integrated
from hamel.simulate.limits import FIRST_CORRECTIONS, MORE, VERSION
from hamel.verify.checks.samples import all_parameters
from hamel.verify.reference.outcome import evaluate, reference
from hamel.verify.reference.outcome import state_of as spelled_out

KIND = "reference"  # of entries in the store


@dataclass(frozen=True)
class Problem:
    """Equations with a state x = (q, w), constant inputs and the parameters of p. All are taken as
    the decimals they print as.

    Where coordinates depend on each other x is corrected in the digits it has not: `held`, beside
    what the model holds, stay.
    """

    equations: Equations
    x: tuple[float, ...]
    u: tuple[float, ...]
    p: tuple[float, ...]
    held: tuple[str, ...] = ()


@dataclass(frozen=True)
class Solution:
    """Coordinates and generalized velocities at each time, as decimals.

    `bound`: no value is off by more, by the two runs; `agreement`: relative difference of v̇ at the
    end from the independent derivation.
    """

    model: str
    choice: str
    names: tuple[str, ...]
    times: tuple[float, ...]
    values: tuple[tuple[str, ...], ...]
    digits: int
    bound: float
    agreement: float
    steps: int

    def at(self, row: int) -> dict[str, Decimal]:
        """Coordinates and generalized velocities by name at one of the times, in all digits."""
        return dict(zip(self.names, map(Decimal, self.values[row])))


def written(value: float) -> Fraction:
    """The decimal number that a double prints as: 9.81, not 9.81000000000000049…"""
    return Fraction(repr(float(value)))


def state_of(e: Equations, initial: Initial, p: np.ndarray, t: float = 0.0) -> np.ndarray:
    """x from (q, v) by the equations' own function."""
    state = function_of(e, "state")(t, initial.whole, np.zeros(e.system.u.numel()), p)
    return np.asarray(state).ravel()


def solution(problem: Problem, times: Sequence[float], digits: int = 30) -> Solution:
    """The motion at rising `times` (s), as decimals that are to be right in `digits` behind the
    point. Raises NotAnalytic where there is no series, Stopped where the motion ends. Remembered by
    content."""
    _check_states(problem)
    name = _fingerprint(problem, times, digits)
    stored = _stored_solution(name)
    if stored is None:
        stored = _computed(problem, times, digits)
        _keep(name, stored)
    return stored


def _check_states(problem: Problem) -> None:
    e = problem.equations
    if e.z:
        names = ", ".join(e.z)
        raise NotAnalytic(f"solutions of many digits know no first-order states ({names})")


def _computed(problem: Problem, times: Sequence[float], digits: int) -> Solution:
    """Two runs of different order, bits and steps, for what they share is then only the equations;
    the values are those of the finer one."""
    e = problem.equations
    flow = Flow(
        function_of(e, "dynamics"),
        _consistent(problem),
        tuple(map(written, problem.u)),
        tuple(map(written, problem.p)),
        _kinks(e),
    )
    runs = [
        integrated(flow, times, digits + more, *_effort(digits + more)) for more in (MORE, MORE + 3)
    ]
    pairs = zip((v for x in runs[0].x for v in x), (v for x in runs[1].x for v in x))
    apart = max((abs(a - b) for a, b in pairs), default=Fraction(0))
    states = [_with_velocities(problem, time, x, digits) for time, x in zip(times, runs[1].x)]
    names = [c.name for c in e.system.model.coordinates] + [
        v.name for v in e.system.model.velocities
    ]
    values = tuple(tuple(_decimal(value, digits + 3) for value in state) for state in states)
    bound = float(2 * apart + Fraction(1, 10**digits))
    agreement = _agreement(problem, times[-1], [float(value) for value in runs[1].x[-1]])
    about = (e.system.model.name, e.choice, tuple(names), tuple(times))
    return Solution(*about, values, digits, bound, agreement, runs[1].steps)


def _kinks(e: Equations) -> ca.Function | None:
    """What changes its sign where forces go on to another piece; None where they have one."""
    known = any(request.name == "kinks" for request in e.requests)
    return function_of(e, e.request("kinks").function) if known else None


def _effort(digits: int) -> tuple[int, int]:
    """Order and bits: terms fall by a factor of about eight, and numbers a hundred digits below one
    still count."""
    return ceil(1.1 * digits) + 2, ceil(3.33 * (2 * digits + 40))


def _evaluated(
    function: ca.Function, fixed: Fixed, arguments: Sequence[Sequence[Fraction]]
) -> list[Fraction]:
    slots = [[Series([fixed.of(value)]) for value in values] for values in arguments]
    graph = Graph(function, fixed, slots)
    graph.grow(0)
    return [fixed.fraction(entry[0]) for entry in graph.outputs[0]]


def _consistent(problem: Problem) -> tuple[Fraction, ...]:
    """x with q corrected until φ = 0 in all digits: the same small correction again and again, each
    in double precision."""
    s, fixed = problem.equations.system, Fixed(1000)
    q = [written(value) for value in problem.x[: s.q.numel()]]
    w = [written(value) for value in problem.x[s.q.numel() :]]
    if not s.phi.numel():
        return (*q, *w)
    p = [written(value) for value in problem.p]
    phi = ca.Function("phi", [s.t, s.q, s.p], [ca.densify(s.phi)])
    solver = Kinematics(s)
    start = np.array([[float(value) for value in q]])
    _, J = solver.closing(np.zeros(1), start, np.array([problem.p]))
    _, _, N = solver.velocities(0.0, start[0], np.array(problem.p))
    held = {x.name for x in s.model.initial if x.held} | {*problem.held}
    free = np.array([c.name not in held for c in s.model.coordinates])
    back = (
        np.linalg.pinv(J[0] @ np.linalg.pinv(N) * free, rcond=1e-9)
        if np.any(free)
        else np.zeros((len(q), len(J[0])))
    )
    if np.linalg.matrix_rank(back) < np.linalg.matrix_rank(J[0]):
        back = np.linalg.pinv(J[0] @ np.linalg.pinv(N), rcond=1e-9)
    for _ in range(FIRST_CORRECTIONS):
        off = _evaluated(phi, fixed, [[Fraction(0)], q, p])
        size = max(map(abs, off))
        if size == 0:
            break
        # scaled to one: each correction then gains all the digits of a double, however small it is
        change = back @ [float(value / size) for value in off]
        q = [value - size * Fraction(float(part)) for value, part in zip(q, change)]
    return (*q, *w)


def _with_velocities(
    problem: Problem, time: float, x: Sequence[Fraction], digits: int
) -> list[Fraction]:
    """(q, v) from (q, w)."""
    arguments = [[Fraction(time)], list(x), [*map(written, problem.u)], [*map(written, problem.p)]]
    velocity = _evaluated(
        function_of(problem.equations, "velocity"), Fixed(_effort(digits + MORE)[1]), arguments
    )
    return [*x[: problem.equations.system.q.numel()], *velocity]


def _agreement(problem: Problem, time: float, x: Sequence[float]) -> float:
    """How far v̇ is from that of the independent derivation, relative to the largest entry of v̇ or
    of v in a second."""
    s, seen, p = problem.equations.system, evaluator(problem.equations), np.array(problem.p)
    place = (time, np.array(x), np.array(problem.u), p)
    own, v = seen.acceleration(*place), seen("velocity", *place)
    ref = reference(s.model)
    state = spelled_out(
        ref, time, np.array(x[: s.q.numel()]), v, np.array(problem.u), all_parameters(s, p)
    )
    other = evaluate(ref, state).vdot
    size = max(float(np.max(np.abs(x), initial=1e-300)) for x in (other, v))
    return float(np.max(np.abs(own - other), initial=0.0)) / size


def _decimal(value: Fraction, digits: int) -> str:
    """Digits behind the point, as many as counted."""
    with localcontext(prec=digits + 400):
        return str(
            (Decimal(value.numerator) / Decimal(value.denominator)).quantize(
                Decimal(1).scaleb(-digits)
            )
        )


# ---- kept by content


def _fingerprint(problem: Problem, times: Sequence[float], digits: int) -> str:
    parts = [
        VERSION,
        problem.x,
        problem.u,
        problem.p,
        tuple(times),
        digits,
        problem.equations.system.model.content(),
    ]
    text = "|".join(
        [
            *map(repr, parts),
            *(_listing(function_of(problem.equations, name)) for name in ("dynamics", "velocity")),
        ]
    )
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _listing(function: ca.Function) -> str:
    """Every instruction, and where the results come from."""
    program = listing(function)
    return "\n".join(map(repr, (*program.instructions, program.outputs)))


def _stored_solution(name: str) -> Solution | None:
    entry = store.stored(KIND, name)
    if entry is None or set(entry.data) != {field.name for field in fields(Solution)}:
        return None
    lists = {"names": tuple(entry.data["names"]), "times": tuple(entry.data["times"])}
    values = tuple(tuple(row) for row in entry.data["values"])
    return Solution(**{**entry.data, **lists, "values": values})


def _keep(name: str, found: Solution) -> None:
    store.put(KIND, name, store.Entry(data=asdict(found)))
