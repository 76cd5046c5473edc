"""Linear systems whose pivots are chosen once, at sampled states, and watched by guards
afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.choices.limits import SINGULAR, SQUARED
from derive.choices.records import Guard
from derive.choices.reduction import Reduction
from derive.choices.survey import Survey
from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.elimination.pivoting import sparse_pivot_order
from derive.mechanics.elimination.solve import Block, lu_solution, sparse_rows
from derive.mechanics.limits import COFACTORS


@dataclass(frozen=True)
class Solved:
    """One column per right-hand side, with the pivot blocks and their determinants."""

    columns: list[Vector]
    blocks: list[Block]
    determinants: Vector


def solved(
    survey: Survey, matrix: ca.SX, sides: Sequence[Vector], given: Reduction | None = None
) -> Solved:
    """`matrix`(t, q, p) x = each side, by Gauss elimination with pivots that stay farthest from
    zero over the sampled states; where it has rows of a choice, `given` is that choice."""
    blocks = pivot_blocks(survey, matrix, given)
    solution = lu_solution(sparse_rows(matrix), sides, blocks)
    return Solved(solution.x, blocks, solution.pivots)


def pivot_blocks(survey: Survey, matrix: ca.SX, given: Reduction | None = None) -> list[Block]:
    """Raises ZeroDivisionError where the matrix is singular at every sampled state."""
    rows, columns = (np.array(x, dtype=int) for x in matrix.sparsity().get_triplet())
    entries = matrix.nz[:]
    values = sampled(survey, entries if given is None else given.at_frame(entries))[:, :, 0]
    numbers = [x.is_constant() for x in ca.vertsplit(entries)] if len(rows) else []
    constant = np.array(numbers, dtype=bool)
    zero = constant & np.all(values == 0.0, axis=0)
    places, known = (rows[~zero], columns[~zero]), constant[~zero]
    return sparse_pivot_order(matrix.size1(), places, values[:, ~zero], known)


def by_reflections(found: Solved) -> bool:
    """Whether no pivots were safe for some of the matrix."""
    return any(len(block.rows) > COFACTORS for block in found.blocks)


def block_guards(
    survey: Survey, found: Solved, names: Sequence[str], given: Reduction | None = None
) -> tuple[Guard, ...]:
    """A guard for each pivot that varies with the configuration, its tolerance relative to the
    largest determinant at the sampled states, at the frame of a reduction if one is given; `names`
    are those of the matrix' rows. Pivots that are numbers, or the same at all states, need none."""
    return tuple(
        Guard(
            f"pivot of {', '.join(names[i] for i in block.rows)}",
            ca.SX(x),
            SINGULAR
            * (_largest(survey, x, given) if len(block.rows) > COFACTORS else block.largest),
        )
        for block, x in zip(found.blocks, found.determinants)
        if block.grade == 2
    )


def in_words(survey: Survey, found: Solved, names: Sequence[str]) -> tuple[str, ...]:
    """The pivots of an elimination of [A; B], row by row."""
    kinds = ("a number", "cannot vanish", "varies")
    velocities = [v.name for v in survey.system.model.velocities]
    return tuple(
        f"{' and '.join(names[i] for i in block.rows)} for "
        f"{' and '.join(velocities[j] for j in block.columns)} "
        f"(pivot: {kinds[block.grade]})"
        for block in found.blocks
    )


def _largest(survey: Survey, pivot: Scalar, given: Reduction | None) -> float:
    values = ca.SX(pivot) if given is None else given.at_frame(ca.SX(pivot))
    return float(np.max(np.abs(sampled(survey, values))))


def quadratic_guards(
    survey: Survey, names: Sequence[str], pivots: Sequence[Scalar]
) -> tuple[Guard, ...]:
    """Of the pivots of A M⁻¹ Aᵀ or A Aᵀ: they vanish where A loses rank, and with the square of its
    distance from that. So their tolerance is a square, too."""
    return relative_guards(survey, [f"pivot of {name}" for name in names], pivots, SQUARED)


def relative_guards(
    survey: Survey, names: Sequence[str], values: Sequence[Scalar], part: float
) -> tuple[Guard, ...]:
    """Of what is divided by: `part` of its largest value at the sampled states is the least, for it
    has units of the file. What is a number needs none."""
    symbolic = [
        (name, x) for name, x in zip(names, values) if isinstance(x, ca.SX) and not x.is_constant()
    ]
    sizes = (
        np.max(np.abs(sampled(survey, ca.vertcat(*[x for _, x in symbolic]))), axis=0).ravel()
        if symbolic
        else ()
    )
    return tuple(
        Guard(name, x, part * float(size), part) for (name, x), size in zip(symbolic, sizes)
    )


def sampled(survey: Survey, matrix: ca.SX) -> np.ndarray:
    """A function of (t, q, p) at the sampled states, states × rows × columns."""
    s = survey.sampled
    return survey.solver.values(matrix, s.t, s.q, s.p)
