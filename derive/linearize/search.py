"""The steady motion near a guess: damped Newton with the exact Jacobian of the forces that are not
balanced."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.balance import Balance
from derive.linearize.limits import (
    FLAT,
    HALVINGS,
    KEPT,
    LEAP,
    RANK,
    ROUNDING,
    STANDS,
    STEADY_STEPS,
    STRAYS,
)
from derive.linearize.steady import LENGTH, Problem, is_guess
from derive.linearize.turning import rates_of_angles
from derive.states.scales import scales


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
    """In the model's own units."""
    y, free = with_inputs(found, y, p, s)
    D = found.scale
    rates = row_sizes(found, slopes_at(found, y, p, s)[1])
    rows = balance.sizes(y, p, rates)
    step, done = np.zeros_like(y), False
    for _ in range(STEADY_STEPS):
        residual, slopes = _evaluated(found, balance.function, y, p, s)
        step = _step(residual / rows, slopes * (free * D) / rows[:, None], D)
        y, done = _damped(found, balance, y, step, (p, s), residual, rows)
        if done:
            break
    if not done and _share(found, step, y) > STRAYS:
        raise _lost(found, y, step)
    R, J = slopes_at(found, y, p, s)
    worst = _excess(R / rates, J * D / rates[:, None], y / D)
    if not np.all(np.isfinite(R)) or np.max(worst, initial=0.0) > KEPT:
        raise _refused(found, R, worst, s)
    return y


def foreseen(
    found: Problem,
    place: tuple[np.ndarray, np.ndarray, np.ndarray],
    p: np.ndarray,
    s: np.ndarray,
) -> np.ndarray:
    """Where the motion (p, s, y) goes by its slopes there when the values become these, however
    far: y − J⁻¹ ∂R/∂(p, s) Δ(p, s). Raises AssumptionError where it has no slopes."""
    own_p, own_s, own = place
    y, free = with_inputs(found, own, p, s)
    D = found.scale
    J = slopes_at(found, own, own_p, own_s)[1]
    R = shifts_at(found, own, own_p, own_s) @ np.append(p - own_p, s - own_s) + J @ (y - own)
    if not np.all(np.isfinite(R)):
        raise _singular(found)
    rows = row_sizes(found, J)
    return y + _step(R / rows, J * (free * D) / rows[:, None], D)


def _step(residual: np.ndarray, slopes: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Of Newton's method, by least squares: a family of steady motions leaves directions open, and
    rows may repeat each other."""
    return -D * np.linalg.lstsq(slopes, residual, rcond=RANK)[0]


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


def slopes_at(
    found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """R and J = ∂R/∂y at y = (x, u). Raises AssumptionError where they are not finite."""
    return _evaluated(found, found.function, y, p, s)


def shifts_at(found: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """∂R/∂(p, s) at y = (x, u)."""
    nx = found.equations.arguments[1].symbols.numel()
    return np.asarray(found.shifts(y[:nx], y[nx:], p, s))


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
    """Residuals relative to what the terms of their rows could amount to, and to what they do:
    far away, where one factor of a term has grown as much as the other has shrunk, little is
    missed against what such factors could amount to."""
    slopes, sizes = np.abs(J), np.abs(y)
    steepest = np.maximum(np.max(slopes, axis=1, initial=0.0), FLAT)
    could = steepest * (1.0 + float(np.max(sizes, initial=0.0)))
    terms = np.maximum(1.0 + slopes @ sizes, ROUNDING * slopes @ (1.0 + sizes))
    return np.abs(R) / np.minimum(could, terms)


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
    lengths = np.array([row.startswith(LENGTH) for row in found.rows])  # met as others are
    k = int(
        np.argmax(np.where(lengths, 0.0, excess) if np.any(excess[~lengths] > KEPT) else excess)
    )
    unit = f" {found.units[k]}" if found.units[k] else ""
    what = f"'{motion.name}' is no steady motion"
    if is_guess(motion):
        what = "no steady motion was found near the initial values"
    missed = f"is missed by {R[k]:.3g}{unit}"
    if found.rows[k].startswith("der(") and found.rows[k] not in dict(motion.values):
        missed = f"would have to vanish and is {R[k]:.3g}{unit}"
    guesses = "other guesses (`guess:` of the motion, or --set)"
    if is_guess(motion):
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
