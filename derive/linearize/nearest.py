"""The steady motion near the starts of a problem, and how far from them it is."""

from __future__ import annotations

import numpy as np

from derive.diagnostics import AssumptionError, listed
from derive.linearize.limits import CREEPS, FAR
from derive.linearize.search import solved
from derive.linearize.starts import check_attitude, starts
from derive.linearize.steady import Problem, is_guess
from derive.linearize.turned import turned

TOLD = 3  # changes from the guess that are told at most


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
            check_attitude(found, y[: found.equations.system.q.numel()], p)
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
    if is_guess(motion):  # it may be asked for at rest
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


def away(found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray) -> float:
    """How far the motion y = (x, u) is from the guess, in the model's own units."""
    return float(np.max(_strayed(found, next(starts(found, p, s)), y), initial=0.0))


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
