"""Where the search for a steady motion begins: at what is held and guessed, on the constraints,
then a little beside."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.evaluate import number
from derive.expressions.tree import Expression
from derive.linearize.limits import RANK
from derive.linearize.steady import Problem, is_guess
from derive.states import gimbal
from derive.states.closing import closed, nominal, normalised
from derive.states.initial import initial_state

BESIDE = (0.1, 0.3, 1.0)  # how far beside the first start others are tried


def starts(found: Problem, p: np.ndarray, s: np.ndarray) -> Iterator[np.ndarray]:
    """(x, u) to begin with. A motion of the file has held and guessed values put in, and is nearest
    to rest on the constraints; `guess` begins at the initial values, then at rest there. Then a
    little beside these, as far as values are not held.
    """
    system, motion = found.equations.system, found.motion
    given = found.given(p, s) | {name: _number(found, e, p) for name, e in motion.guesses}
    free = np.array([c.name not in dict(motion.values) for c in system.model.coordinates])
    if is_guess(motion):
        changes = {name: _number(found, e, p) for name, e in motion.guesses}
        initial = initial_state(system, changes, p)
        q, spreads = initial.q, (0.0, *BESIDE)
        check_attitude(found, q, p)
        yield _state(found, given, q, initial.v, p)
    else:
        q, spreads = _positions(found, given, free, p), BESIDE
        check_attitude(found, q, p)
        yield _state(found, given, q, _velocities(found, given, q, p), p)
    rng, sizes = np.random.default_rng(0), found.scale[: len(q)] * free
    for spread in spreads:
        beside = normalised(system, q + spread * sizes * rng.uniform(-1, 1, len(q)))
        on = closed(found.kinematics, 0.0, beside, p, free)
        if on is not None:
            yield _state(found, given, on, _velocities(found, given, on, p), p)


def check_attitude(found: Problem, q: np.ndarray, p: np.ndarray) -> None:
    """Raises AssumptionError where Euler angles are in gimbal lock: their rates have no slopes."""
    N = found.kinematics.rates(np.zeros(1), q[np.newaxis], p[np.newaxis])
    names = [] if N is None else gimbal.locked(found.equations.system, N.largest()[0])
    if names:
        where = f"at the steady motion '{found.motion.name}'"
        raise AssumptionError(gimbal.told(names, where), hint=gimbal.INSTEAD)


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
