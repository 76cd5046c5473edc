"""A steady motion from any start, and the branch of them as values change."""

from __future__ import annotations

import numpy as np

from derive.diagnostics import AssumptionError, listed
from derive.linearize.limits import CREEPS, FAR, STRAIGHT
from derive.linearize.records import Steady
from derive.linearize.search import solved
from derive.linearize.starts import check_attitude, starts
from derive.linearize.steady import GUESS, Problem, residuals_of
from derive.linearize.turned import turned

NEARER = 5  # times that the way from one steady motion to the next is halved
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
