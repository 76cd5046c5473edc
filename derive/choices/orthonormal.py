"""Choice b: B = Nᵀ with N(q) an orthonormal basis of ker A(q), so that [A; B] is as well
conditioned as A allows.

One degree of freedom: N is the generalised cross product of the rows of A, divided by its length;
smooth wherever A has full rank. More: the columns of a frame E, projected on ker A and
orthonormalised by Gram–Schmidt; smooth away from where the projection of E loses rank, which a
guard watches. In a generated module E is data: it is based anew, E = N(q), before that happens, and
w with it, w' = N'ᵀ v, so that this choice goes wherever A has full rank. v̇ at ẇ = 0 is the
derivative of N w + A⁺ c along the motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.choices.limits import MINORS, ROWS, SINGULAR
from derive.choices.pivots import quadratic_guards, relative_guards
from derive.choices.records import Frame, Guard
from derive.choices.reduction import Reduction, symbols_for
from derive.choices.survey import Survey, direction_names
from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import dot, is_zero, minus
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import System
from derive.states.closing import Kinematics
from derive.states.sampling import States

LENGTH = "length of basis vector"  # the guards of the frame are called so


def orthonormal(survey: Survey) -> Reduction:
    """The reduction with B = Nᵀ, S = N, NᵀN = 1: w are components of v along orthonormal directions
    of ker A. v = N w + A⁺ c.

    Where the survey is of a moving frame it is symbols, else numbers. Orthonormal in v as it is
    counted, so entries in m/s and rad/s weigh alike: a matter of conditioning, not of mechanics.
    """
    system, rows, kept = survey.system, survey.independent_rows, survey.kept
    A = scalars(rows.A) if kept else []
    free = system.v.numel() - len(kept)
    if free == 1 and len(kept) <= MINORS:
        basis, length = _cross_product(A)
        guards = relative_guards(survey, [f"{LENGTH} 1"], [length], SINGULAR)
        return _reduction(system, kept, A, rows.c, basis, guards, None)
    if not free and rows.c.is_zero():  # at rest, wherever it is
        return _reduction(system, kept, A, rows.c, [], (), None)
    base = _frame(system, kept, survey.sampled)
    frame = _movable(system, base) if survey.moving and kept and free else None
    columns: list[Vector] = [[float(x) for x in column] for column in base.T]
    directions = columns if frame is None else _columns_of(frame, system.v.numel())
    if len(kept) > ROWS:
        projected, pivots, order = _projected(A, directions)
        guards = quadratic_guards(survey, [rows.names[i] for i in order], pivots)
        basis, lengths = _gram_schmidt(projected)
    else:
        found, every = _gram_schmidt([*A, *directions])
        names = [f"pivot of {name}" for name in rows.names]
        guards = relative_guards(survey, names, every[: len(kept)], SINGULAR)
        basis, lengths = found[len(kept) :], every[len(kept) :]
    guards += tuple(Guard(f"{LENGTH} {k + 1}", ca.SX(x), SINGULAR) for k, x in enumerate(lengths))
    return _reduction(system, kept, A, rows.c, basis, guards, frame)


def _movable(system: System, base: np.ndarray) -> Frame:
    """The frame as symbols, with the base in numbers."""
    labels = tuple(
        f"frame {k + 1} of {velocity.name}"
        for k in range(base.shape[1])
        for velocity in system.model.velocities
    )
    symbols = ca.vertcat(*[ca.SX.sym(label) for label in labels])
    return Frame(symbols, labels, tuple(float(x) for x in base.T.ravel()))


def _columns_of(frame: Frame, nv: int) -> list[Vector]:
    entries: Vector = [frame.symbols[i] for i in range(frame.symbols.numel())]
    return [entries[i : i + nv] for i in range(0, len(entries), nv)]


def _reduction(
    system: System,
    kept: Sequence[int],
    A: list[Vector],
    c: ca.SX,
    N: list[Vector],
    guards: tuple[Guard, ...],
    frame: Frame | None,
) -> Reduction:
    """v = N w + A⁺ c; σ is the derivative of that along the motion, with w held."""
    names = direction_names(system, len(N))
    w = symbols_for(names)
    S = _columns(N, system.v.numel())
    v = ca.mtimes(S, w) + _particular(A, [c[i] for i in range(len(kept))])
    qdot = ca.substitute(system.qdot, system.v, v)
    # v(t, q, w) with w held: all of v̇ that is not S ẇ
    sigma = ca.jtimes(v, ca.vertcat(system.t, system.q), ca.vertcat(1, qdot))
    return Reduction(
        names=names,
        w=w,
        B=S.T,
        S=S,
        v=v,
        sigma=sigma,
        walked=None,
        guards=guards,
        pivots=tuple(f"basis vector {k + 1} is divided by its length" for k in range(len(N))),
        kept=tuple(kept),
        constant_pivots=False,
        frame=frame,
    )


def _columns(N: Sequence[Vector], nv: int) -> ca.SX:
    S = ca.SX(nv, len(N))
    for k, column in enumerate(N):
        for j, x in enumerate(column):
            if not is_zero(x):
                S[j, k] = x
    return S


def _cross_product(A: list[Vector]) -> tuple[list[Vector], Scalar]:
    """The one direction at right angles to n − 1 rows, by their signed minors: it vanishes exactly
    where the rows lose rank."""
    n = len(A) + 1
    minors = [
        (-1.0) ** j * _determinant([[row[k] for k in range(n) if k != j] for row in A])
        for j in range(n)
    ]
    length = ca.sqrt(dot(minors, minors))
    return [[x / length for x in minors]], length


def _determinant(rows: list[Vector]) -> Scalar:
    if not rows:
        return 1.0
    return dot(
        [(-1.0) ** j * x for j, x in enumerate(rows[0])],
        [
            0.0 if is_zero(x) else _determinant([row[:j] + row[j + 1 :] for row in rows[1:]])
            for j, x in enumerate(rows[0])
        ],
    )


def _projected(
    A: list[Vector], directions: Sequence[Vector]
) -> tuple[list[Vector], Vector, list[int]]:
    """e − Aᵀ (A Aᵀ)⁻¹ A e for each direction e, the pivots of A Aᵀ and their rows. A Aᵀ couples
    only rows that share a joint, so that the work grows with the number of loops where these follow
    each other; rows made orthogonal one after the other fill up."""
    gram = [[dot(row, other) for other in A] for row in A]
    along = [[dot(row, e) for row in A] for e in directions]
    order = _fewest_neighbours_first(gram)
    solution = ldl_solution(gram, along, order)
    projected = [
        [minus(x, dot(y, column)) for x, column in zip(e, zip(*A))]
        for e, y in zip(directions, solution.x)
    ]
    return projected, solution.pivots, order


def _fewest_neighbours_first(gram: list[Vector]) -> list[int]:
    """An order of elimination with little fill: what is coupled with the fewest goes first."""
    left = {
        i: {j for j, x in enumerate(row) if j != i and not is_zero(x)} for i, row in enumerate(gram)
    }
    order: list[int] = []
    while left:
        first = min(left, key=lambda i: (len(left[i]), i))
        beside = left.pop(first)
        for i in beside:
            left[i] = (left[i] | beside) - {first, i}
        order.append(first)
    return order


def _gram_schmidt(given: Sequence[Vector]) -> tuple[list[Vector], list[Scalar]]:
    """Each made orthogonal to those before it, at length one; and the lengths that they had."""
    done: list[Vector] = []
    lengths: list[Scalar] = []
    for row in given:
        rest = _without(row, done)
        length = ca.sqrt(dot(rest, rest))
        lengths.append(length)
        done.append([0.0 if is_zero(x) else x / length for x in rest])
    return done, lengths


def _without(row: Vector, units: Sequence[Vector]) -> Vector:
    for unit in units:
        along = dot(unit, row)
        if not is_zero(along):
            row = [x if is_zero(e) else x - along * e for x, e in zip(row, unit)]
    return row


def _particular(A: list[Vector], c: list[ca.SX]) -> ca.SX:
    """A⁺ c; exact zeros where the constraints do not move."""
    if not A or all(x.is_zero() for x in c):
        return ca.SX.zeros(len(A[0])) if A else ca.SX(0)
    rows = ca.vertcat(*[ca.horzcat(*row) for row in A])
    return ca.mtimes(rows.T, ca.solve(ca.mtimes(rows, rows.T), ca.vertcat(*c)))


def _frame(system: System, kept: Sequence[int], sampled: States) -> np.ndarray:
    """Constant nv × nw frame: the null space at the sampled state that suits all sampled states
    best."""
    if len(kept) == system.v.numel():
        return np.zeros((len(kept), 0))
    rows = Kinematics(system).rows(sampled.t, sampled.q, sampled.p)[0][:, list(kept)]
    spaces = [
        np.linalg.svd(A)[2][len(kept) :].T if len(kept) else np.eye(system.v.numel()) for A in rows
    ]
    worst = [
        min(np.linalg.svd(other.T @ space)[1].min() for other in spaces) for space in spaces[:20]
    ]
    return np.round(spaces[int(np.argmax(worst))], 3)
