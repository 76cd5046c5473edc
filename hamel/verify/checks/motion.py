"""Short motions of the module's own integrator, from some of the states, against the reference
integrated on its own.

The reference's v̇ is carried on by extrapolated midpoint steps (Gragg, Bulirsch, Stoer; Hairer,
Nørsett, Wanner, Solving Ordinary Differential Equations I, §II.9) in q and v, without any
constraint kept; the module has its equations in w, its integrator and its projection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise, product
from typing import Any

import numpy as np

from codegen.integrators import integrator_of
from codegen.reals import FLOAT64
from derive.expressions.tree import Expression, Name, walk
from derive.model.kinks import switches
from derive.model.records import Model
from derive.states.closing import normalised
from derive.states.sampling import depends_on_time
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import sizes, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.samples import Sample
from hamel.verify.reference.outcome import energies, evaluate, state_of, with_reactions
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

SHARE = 0.5
NUDGE = 1e-3  # in the model's own units
SUBSTEPS = (2, 4, 6, 8, 10, 12, 14)  # of the midpoint rule: order 14 together
DOUBT = 1e-11  # an extrapolated step of the reference that is less certain is made as two …
DEPTH = 4  # … so many times
UNSURE = 1e-10
MOTIONS, TRIED = 3, 5  # of the best conditioned states
HALVED = (1, 2, 4, 8, 16, 32, 64)  # equal steps of the module, for the order …
ENOUGH = 0.1  # so small a part of the order may lack without looking at further motions
SMOOTH = 1e-6
BETTER = 0.02  # of the error of a step of the module
LOOKED_AT = 6  # states, for some motions are not smooth
FEWEST = 3  # motions that say something, before their order counts as lacking
LONGER = (2.0, 4.0, 8.0)  # … over so many times as long
FAR = 1e-2  # errors above do not fall in proportion yet, …
EXACT = 1e-11  # … and those below may be roundoff
RTOL = 1e-12


def simulated(e: Evidence) -> float | None:
    """q and v at the end. Not where rows are redundant: off the constraints, where the reference
    drifts, they are not."""
    return None if e.redundant else worst_of(e, _missed)


def _missed(e: Evidence, k: int) -> float:
    s = e.samples[k]
    span = time_scale(e, s)
    return _apart(e, end_of(e, s, e.x[k], span), reference_end(e, s, span))


def order(e: Evidence) -> float | None:
    """What part of its order the default integrator lacks, as its equal steps are halved."""
    if e.module is None or e.redundant or not simulates(e):
        return None
    method = integrator_of(e.module.integrators[0])
    assert method is not None  # a module names what hamel knows
    wanted = method.order
    if not wanted:  # it goes with the tolerance
        return None
    seen: list[float] = []
    for slopes in filter(None, _slopes(e)):
        seen.append(max(map(min, zip(slopes, slopes[1:] or slopes))))
        if max(seen) > (1.0 - ENOUGH) * wanted:
            return max(0.0, 1.0 - max(seen) / wanted)
    return 1.0 - max(seen) / wanted if len(seen) >= FEWEST else None


def _slopes(e: Evidence) -> Iterator[list[float]]:
    """Per smooth motion log₂ of how much smaller an error half the step leaves, where both can be
    told from roundoff.

    Where forces have kinks, or turn within a fraction of the step as smoothed friction does, no
    method shows its order: smooth is what one extrapolated step of the reference gets nearly right,
    and much better than one step of the module.
    """
    for k, times in product(best_conditioned(e)[:LOOKED_AT], LONGER):
        s = e.samples[k]
        span = times * time_scale(e, s)
        try:
            runs = [_run(e, s, e.x[k], span, step) for step in (None, *(span / n for n in HALVED))]
            end, *others = (_end(e, s, run, s.t + span) for run in runs)
            rough = _apart(e, _step(e, s, s.t, _start(s), span)[0], end)
        except FloatingPointError:
            continue
        if not rough <= SMOOTH:
            continue
        errors = [_apart(e, other, end) for other in others]
        if not rough <= BETTER * max(EXACT, errors[0]):
            continue
        yield [float(np.log2(a / b)) for a, b in pairwise(errors) if b > EXACT and a < FAR]


def work(e: Evidence) -> float | None:
    """What the module counts as work is what T₂ − T₀ + V gained, by the reference's energies."""
    return worst_of(e, _unbalanced)


def _unbalanced(e: Evidence, k: int) -> float:
    s = e.samples[k]
    span = time_scale(e, s)
    run = _run(e, s, e.x[k], span)
    end, start = (
        energies(e.reference, state_at(e, s, s.t + span, _end(e, s, run, s.t + span))),
        s.outcome,
    )
    size = e.units.energy + abs(end.T) + abs(start.T) + abs(end.V - start.V) + abs(run.work[-1])
    return float(abs(end.total - start.energy - run.work[-1]) / size)


def backwards(e: Evidence) -> float | None:
    """There, velocities turned round, and back: where v̇ is even in v by the reference, and nothing
    depends on time."""
    if not simulates(e) or e.system.model.states or not _reversible(e):
        return None
    return worst_of(e, _not_back)


def _reversible(e: Evidence) -> bool:
    # no two times tell of what is periodic in their distance
    if depends_on_time(e.system):
        return False
    return all(_even(e, s, t) for s in e.samples[:3] for t in (s.t, s.t + e.units.time))


def _even(e: Evidence, s: Sample, t: float) -> bool:
    turned = evaluate(e.reference, state_of(e.reference, t, s.q, -s.v, s.u, s.full))
    apart = worst(
        (turned.vdot - s.outcome.vdot)
        / sizes(s.outcome.vdot[None] / e.units.vdot)[0]
        / e.units.vdot
    )
    return apart < 1e-9 and not turned.kinematics.c.any()


def _not_back(e: Evidence, k: int) -> float:
    s = e.samples[k]
    span = time_scale(e, s)
    q, v = np.split(end_of(e, s, e.x[k], span), [len(s.q)])
    there = e.graph("state", s.t, np.concatenate([q, -v]), s.u, s.p)
    q, v = np.split(end_of(e, s, there, span), [len(s.q)])
    return _apart(e, np.concatenate([q, -v]), _start(s))


def worst_of(e: Evidence, error: Callable[[Evidence, int], float]) -> float | None:
    """Over the motions that neither end at a singular position of the choice nor have a kink that
    the reference stumbles over."""
    if not simulates(e):
        return None
    errors: list[float] = []
    for k in best_conditioned(e)[:TRIED]:
        if len(errors) < MOTIONS:
            with suppress(FloatingPointError):
                errors.append(error(e, k) / max(1.0, e.conditions[k] * 1e-3))
    return worst(errors) if errors else None


def simulates(e: Evidence) -> bool:
    """In doubles: these errors are compared with what is left of sixteen digits."""
    return e.module is not None and hasattr(e.module, "simulate") and e.real is FLOAT64


def best_conditioned(e: Evidence) -> list[int]:
    """The states, by the condition of the choice there."""
    return sorted(range(len(e.samples)), key=lambda k: e.conditions[k])


def time_scale(e: Evidence, s: Sample) -> float:
    """A share of the time in which the state changes by one, or a disturbance of it decays or
    swings."""
    unit = e.units
    signs = NUDGE * np.where(np.arange(len(s.v)) % 2, -1.0, 1.0)
    stiffness = (
        worst(_changed(e, s, s.q + s.outcome.kinematics.N @ (signs * unit.v) * unit.time, s.v))
        / NUDGE
    )
    damping = worst(_changed(e, s, s.q, s.v + signs * unit.v)) / NUDGE
    rates = (
        1.0,
        _pace_of_states(e, s, signs * unit.v),
        worst(s.outcome.qdot / unit.qdot),
        worst(s.outcome.vdot / unit.vdot) ** 0.5,
        stiffness**0.5,
        damping,
    )
    return SHARE * unit.time / max(rates)


def _pace_of_states(e: Evidence, s: Sample, dv: Array) -> float:
    """How fast first-order states change, and how they and velocities change each other's
    rates."""
    if not len(s.z):
        return 0.0
    unit = e.units
    signs = NUDGE * np.where(np.arange(len(s.z)) % 2, -1.0, 1.0)
    moves = (np.concatenate([s.q, s.v, s.z + signs * unit.z]), np.concatenate([s.q, s.v + dv, s.z]))
    paces = [worst(s.outcome.zdot / unit.zdot)]
    for y in moves:
        there = evaluate(e.reference, state_at(e, s, s.t, y))
        paces.append(worst((there.zdot - s.outcome.zdot) / unit.zdot) / NUDGE)
        paces.append(worst((there.vdot - s.outcome.vdot) / unit.vdot) / NUDGE)
    return max(paces)


def _changed(e: Evidence, s: Sample, q: Array, v: Array) -> Array:
    """By how much v̇ is another there."""
    there = evaluate(
        e.reference, state_of(e.reference, s.t, normalised(e.system, q), v, s.u, s.full)
    )
    return (there.vdot - s.outcome.vdot) / e.units.vdot


def _run(e: Evidence, s: Sample, x: Array, span: float, step_size: float | None = None) -> Any:
    assert e.module is not None
    chart = {"chart": e.chart} if e.chart else {}
    atol = RTOL * float(e.units.x.min(initial=1.0))
    return e.module.simulate(
        [s.t, s.t + span],
        x,
        s.u,
        s.p,
        rtol=RTOL,
        atol=atol,
        step_size=step_size,
        events=False,
        **chart,
    )


def end_of(e: Evidence, s: Sample, x: Array, span: float) -> Array:
    """(q, v, z) where the module's own motion from x at the time of s is after a span."""
    return _end(e, s, _run(e, s, x, span), s.t + span)


def _end(e: Evidence, s: Sample, run: Any, t: float) -> Array:
    """(q, v, z) where a motion ends; modules of several charts give v themselves, for x may be in
    any of them, and a frame that was based anew stands with the parameters of the row."""
    assert e.module is not None
    x, v, p = run.x[-1], getattr(run, "v", None), getattr(run, "p", None)
    q, z = x[: len(s.q)], x[len(x) - len(s.z) :]
    if v is not None:
        return np.concatenate([q, v[-1], z])
    if p is not None:
        return np.concatenate([q, e.module.velocity(t, x, s.u, p[-1]), z])
    return np.concatenate([q, e.graph("velocity", t, x, s.u, s.p), z])


def _apart(e: Evidence, got: Array, wanted: Array) -> float:
    unit = e.units.whole
    return worst((got - wanted) / unit / sizes(wanted[None] / unit)[0].clip(1.0))


def reference_end(e: Evidence, s: Sample, span: float) -> Array:
    """(q, v, z) after the span, by two steps and their halves: one may go over a thin layer that
    none of its points is in. FloatingPointError where steps are halved without end."""
    middle = _carried(e, s, s.t, _start(s), span / 2, DEPTH - 1, np.inf)
    return _carried(e, s, s.t + span / 2, middle, span / 2, DEPTH - 1, np.inf)


def _start(s: Sample) -> Array:
    return s.whole


def state_at(e: Evidence, s: Sample, t: float, y: Array) -> State:
    """The reference's state at (q, v, z), inputs and parameters as of the sample."""
    q, v, z = np.split(y, [len(s.q), len(s.q) + len(s.v)])
    return state_of(e.reference, t, q, v, s.u, s.full_with(z))


def _carried(
    e: Evidence, s: Sample, t: float, y: Array, h: float, depth: int, before: float
) -> Array:
    """y after h, in as many steps as it takes; where half the step is hardly surer (`before`) there
    is a kink, or no rank."""
    if _piece(e, s, t, y) != _piece(e, s, s.t, _start(s)):
        raise FloatingPointError("a formula changes its piece")
    end, doubtful = _step(e, s, t, y, h)
    doubt = _apart(e, doubtful, end)
    if depth == 0 and not doubt <= UNSURE:
        raise FloatingPointError("the reference cannot tell")
    if depth and not doubt <= DOUBT:
        if not doubt < before / 4:
            raise FloatingPointError("the reference cannot tell")
        middle = _carried(e, s, t, y, h / 2, depth - 1, doubt)
        return _carried(e, s, t + h / 2, middle, h / 2, depth - 1, doubt)
    if _piece(e, s, t + h, end) != _piece(e, s, s.t, _start(s)):
        raise FloatingPointError("a formula changes its piece")
    return np.concatenate([normalised(e.system, end[: len(s.q)]), end[len(s.q) :]])


def _piece(e: Evidence, s: Sample, t: float, y: Array) -> tuple[float, ...]:
    """In which of its pieces every formula is: no order and no extrapolation holds across, and the
    midpoint rule does not look at the end of its step."""
    pieces = switches(e.reference.model)
    if not pieces:
        return ()
    try:
        state = with_reactions(e.reference, state_at(e, s, t, y))
    except np.linalg.LinAlgError:  # nothing is left of the state
        raise FloatingPointError("the reference cannot tell") from None
    return tuple(float(np.sign(state.value(side))) for side in pieces)


def sides(model: Model) -> tuple[Expression, ...]:
    """What changes its sign where a formula goes on to another piece, of all that a state tells; a
    reaction is none of that."""
    return tuple(x for x in switches(model) if not any(map(_is_reaction, walk(x))))


def _is_reaction(node: Expression) -> bool:
    return isinstance(node, Name) and node.name.startswith("reaction.")


def _step(e: Evidence, s: Sample, t: float, y: Array, h: float) -> tuple[Array, Array]:
    return _extrapolated(lambda t, y: _rates(e, s, t, y), t, y, h)


def _rates(e: Evidence, s: Sample, t: float, y: Array) -> Array:
    try:
        outcome = evaluate(e.reference, state_at(e, s, t, y))
    except np.linalg.LinAlgError:  # nothing is left of the state
        raise FloatingPointError("the reference cannot tell") from None
    return np.concatenate([outcome.qdot, outcome.vdot, outcome.zdot])


def _extrapolated(
    rate: Callable[[float, Array], Array], t: float, y: Array, h: float
) -> tuple[Array, Array]:
    """y after h, and what it would be without the finest of the midpoint steps: by Aitken and
    Neville in the squares of these. The last extrapolation alone is too sure of itself where forces
    turn at the end of the step."""
    first, table = rate(t, y), []
    for n in SUBSTEPS:
        before, now = y, y + h / n * first
        for k in range(1, n):
            before, now = now, before + 2.0 * h / n * rate(t + k * h / n, now)
        row = [now]
        for j, above in enumerate(table[-1] if table else []):
            row.append(row[j] + (row[j] - above) / ((n / SUBSTEPS[len(table) - 1 - j]) ** 2 - 1.0))
        table.append(row)
    return table[-1][-1], table[-2][-1]


CHECKS = (
    Check(
        "simulate",
        1e-8,
        "short motions against the reference integrated on its own, per condition number/1000",
        simulated,
    ),
    Check(
        "order of the integrator",
        0.35,
        "what the slope of the error of halved steps lacks, as a part of the order",
        order,
    ),
    Check("work = Δ(T₂ − T₀ + V)", 1e-8, "along short motions, by the reference's energies", work),
    Check(
        "there and back",
        1e-8,
        "velocities turned round and run again, where the reference says that this can be",
        backwards,
    ),
)
