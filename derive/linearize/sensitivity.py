"""How eigenvalues move with parameters: dλ = yᴴ dA x / yᴴ x, with the steady motion moving
along."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.linearize.limits import DEFECTIVE, RANK, TWIN
from derive.linearize.spectrum import eigenvalues
from derive.linearize.study import Study


@dataclass(frozen=True)
class Mode:
    """An eigenvalue (1/s) with its right vector over all minimal states, and dλ/d(name) for
    parameters and free names."""

    eigenvalue: complex
    vector: np.ndarray
    sensitivity: dict[str, complex]


def modes(study: Study) -> tuple[Mode, ...]:
    """The modes at the study's own values, of each pair the one above the real axis.

        dλ/dθ = yᴴ (dA/dθ) x / (yᴴ x),   A x = λ x,   yᴴ A = λ yᴴ

    dA/dθ holds the shift of the steady motion with θ. Where yᴴ x all but vanishes, or eigenvalues
    are the same, no derivative exists: the sensitivity is empty then. Modes of one eigenvalue are
    independent as far as there are such, each without what leads in the others.
    """
    motions = study.motions({})
    A = study.full(motions)[0]
    slopes = _slopes(study, motions.x[0], motions.u[0], motions.p[0])
    result: list[Mode] = []
    found = [x for x in eigenvalues(study.matrices(motions))[0] if x.imag >= 0]
    for k, wanted in enumerate(found):
        twins = [i for i, x in enumerate(found) if abs(x - wanted) <= TWIN * np.linalg.norm(A)]
        x, y = _vectors(A, wanted)
        over = np.vdot(y, x)
        defective = abs(over) < DEFECTIVE or len(twins) > 1
        x = _space(A, wanted, len(twins))[twins.index(k)] if len(twins) > 1 else x
        moved = (
            {}
            if defective
            else {name: complex(np.vdot(y, slope @ x) / over) for name, slope in slopes.items()}
        )
        result.append(Mode(complex(wanted), x / x[np.argmax(np.abs(x))], moved))
    return tuple(result)


def _vectors(A: np.ndarray, eigenvalue: complex) -> tuple[np.ndarray, np.ndarray]:
    """Right and left vector of length one: the null vectors of A − λ 1, which the defective zeros
    of A leave alone."""
    left, _, right = np.linalg.svd(A - eigenvalue * np.eye(len(A)))
    return right[-1].conj(), left[:, -1]


def _space(A: np.ndarray, eigenvalue: complex, count: int) -> list[np.ndarray]:
    """So many right vectors of an eigenvalue: the reduced echelon form of the null space of
    A − λ 1. Where that is smaller its first one stands for those that are missing."""
    _, sizes, right = np.linalg.svd(A - eigenvalue * np.eye(len(A)))
    width = max(1, min(count, int(np.sum(sizes <= TWIN * sizes[0]))))
    rows = right[len(A) - width :].conj()
    vectors = np.linalg.solve(rows[:, _leading(rows)], rows)
    return [*vectors, *[vectors[0]] * (count - width)]


def _leading(rows: np.ndarray) -> list[int]:
    """Columns that tell the rows apart: each time the largest of what those before leave."""
    left, found = rows.copy(), list[int]()
    for _ in range(len(rows)):
        k = int(np.argmax(np.linalg.norm(left, axis=0)))
        found.append(k)
        along = left[:, k] / np.linalg.norm(left[:, k])
        left -= np.outer(along, along.conj() @ left)
    return sorted(found)


def _slopes(study: Study, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> dict[str, np.ndarray]:
    """dA/dθ along the family of steady motions, for every parameter and free name: ∂A/∂p + ∂A/∂(x,
    u) d(x, u)/dθ."""
    problem, form = study.problem, study.linear
    names = (*study.equations.arguments[3].labels, *problem.motion.sweepable)
    if not names:
        return {}
    t, *rest = (a.symbols for a in study.equations.arguments)
    at = ca.vertcat(*rest)
    d = ca.SX.sym("d", at.numel())
    turned = ca.jtimes(ca.vec(ca.densify(form.A)), at, d)
    function = ca.Function("dA", [t, *rest, d], [turned])
    s = np.array([study.at[name] for name in problem.motion.sweepable])
    _, J = problem.function(x, u, p, s)
    slopes: NDArray[np.float64] = J.full()
    moved: NDArray[np.float64] = problem.shifts(x, u, p, s).full()
    shifts = -np.linalg.lstsq(slopes, moved, rcond=RANK)[0]
    n = len(form.states)
    directions = np.vstack([shifts, np.eye(len(p), len(names))])
    columns = [function(0.0, x, u, p, directions[:, k]).full().ravel() for k in range(len(names))]
    return {name: column.reshape(n, n, order="F") for name, column in zip(names, columns)}
