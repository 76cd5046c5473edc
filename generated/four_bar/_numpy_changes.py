"""Changes of the coordinates on the way of a motion in NumPy: charts that take over from each
other, and frames that are based anew, as in runtime_simulate.h.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from typing import Any

import numpy as np

from ._model_facts import Charts, Nullspace
from ._numpy_guards import forget
from ._numpy_motion import Failed, Motion
from ._simulation import Status

RESTART = 1e-4  # the error that the step control compares with where it begins anew


def _begin_anew(motion: Motion, guarded: bool) -> None:
    """Guards and slope of the state in its new coordinates. Raises Failed."""
    if guarded and any(motion.facts.guards):
        forget(motion)
    motion.refresh()


def _restore(motion: Motion, old: Any) -> None:
    """The state as it was; evaluations count all the same."""
    state = motion.state
    calls = state["calls"]
    for name in motion.facts.state.names or ():
        state[name] = old[name]
    state["calls"] = calls


# ---- charts


def enter_best(motion: Motion) -> None:
    """After a step: go on in another chart where that is better."""
    charts, state = motion.facts.charts, motion.state
    if charts:
        given = (state["t"], state["x"][:-1], motion.u, motion.p, motion.chart)
        _enter(motion, charts, int(charts.chart(motion.facts.numpy(), *given)))


def is_rescued(motion: Motion) -> bool:
    """Where a step failed: go on in the best chart if that is so much better here."""
    charts, state, binding = motion.facts.charts, motion.state, motion.facts.numpy()
    if not charts:
        return False
    at = (state["t"], state["x"][:-1], motion.u, motion.p)
    best = int(charts.chart(binding, *at, None))
    least = charts.BETTER * charts.margin(binding, motion.chart, *at)
    better = charts.margin(binding, best, *at) > least
    return bool(better) and _enter(motion, charts, best)


def _enter(motion: Motion, charts: Charts, to: int) -> bool:
    """Go on in chart `to`; False where that fails."""
    state, old, here = motion.state, motion.state.copy(), motion.chart
    if to == here:
        return False
    try:
        given = (state["t"], old["x"][:-1], motion.u, motion.p)
        v = _velocity(motion, *given)
        state["x"][:-1] = charts.transform(motion.facts.numpy(), here, to, *given)
        state["choice"] = to
        _check_same(motion, v, _velocity(motion, given[0], state["x"][:-1], *given[2:]))
        _begin_anew(motion, guarded=True)
    except (Failed, FloatingPointError):
        _restore(motion, old)
        return False
    state["error"], state["switches"] = RESTART, state["switches"] + 1
    return True


# ---- frames


def take_frame(motion: Motion) -> None:
    """The frame in force at the end of p: at the start of a motion that of p itself."""
    state, frame = motion.state, motion.facts.frame
    if not frame:
        return
    if state["next_step"] == 0 and state["done"] == 0:
        state["frame"] = motion.p[-frame:]
    motion.p = np.concatenate([motion.p[:-frame], state["frame"]])


def is_based_anew(motion: Motion, least: float | None = None) -> bool:
    """Base the frame anew where less than this is left of a direction; False where that fails."""
    nullspace, facts, state = motion.facts.nullspace, motion.facts, motion.state
    if not nullspace or not facts.frame:
        return False
    old, p = state.copy(), motion.p
    at = (state["t"], old["x"][:-1], motion.u)
    bound = nullspace.WORN if least is None else least
    if not nullspace.worn(facts.numpy(), *at, p) < bound:
        return False
    try:
        motion.p = nullspace.rebase(facts.numpy(), *at, p)
        if motion.chart == facts.framed:
            state["x"][:-1] = _measured_along(motion, at, p)
        _begin_anew(motion, guarded=motion.chart == facts.framed)
    except (Failed, FloatingPointError):
        motion.p = p
        _restore(motion, old)
        return False
    state["frame"], state["bases"] = motion.p[-facts.frame :], state["bases"] + 1
    return True


def _measured_along(motion: Motion, at: tuple[Any, ...], p: np.ndarray) -> np.ndarray:
    """The same state in the frame of motion.p, which was in that of p."""
    facts, x = motion.facts, at[1]
    binding, charts = facts.numpy(), facts.charts
    suffix = charts.SUFFIXES[motion.chart] if charts else ""
    v = _velocity(motion, *at, p)
    state = getattr(binding, f"state{suffix}")
    moving = np.concatenate([x[: facts.nq], v, x[facts.nx - facts.nz :]])
    carried = state(at[0], moving, motion.u, motion.p)
    _check_same(motion, v, _velocity(motion, at[0], carried, motion.u, motion.p))
    return carried


def _velocity(motion: Motion, *at: Any) -> np.ndarray:
    """v of t, x, u and p in the chart of the motion."""
    charts = motion.facts.charts
    suffix = charts.SUFFIXES[motion.chart] if charts else ""
    return getattr(motion.facts.numpy(), f"velocity{suffix}")(*at)


def _check_same(motion: Motion, v: np.ndarray, after: np.ndarray) -> None:
    """Raises Failed where a change of what w is measured along would make another v: where
    constraints depend on each other no chart holds it."""
    if not np.abs(after - v).max() <= motion.facts.limits.carried * np.abs(v).max():
        raise Failed(Status.SINGULAR_POSITION)


def independence(motion: Motion, nullspace: Nullspace) -> float:
    """How far the constraints are from depending on each other where the motion is."""
    at = (motion.state["t"], motion.state["x"][:-1], motion.u, motion.p)
    return nullspace.independence(motion.facts.numpy(), *at)
