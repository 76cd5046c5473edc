"""Rows of A that depend on each other: which they are, in words, and independent rows that stand
for all of them.

Where A = L A_K with independent rows A_K, the pseudo-inverse of L with its rank fixed by the
structure gives r rows E A, E = L⁺, that ask for the same accelerations, E A v̇ = E β. Every row
takes part in them; where the rows agree, on the constraints, they are A_K v̇ = β_K. Forces y along
them are λ = Eᵀ y along all rows, of all λ with that Aᵀ λ the one of least norm. A threshold at run
time, as a numerical pseudo-inverse has it, would flip off the constraints, where redundant rows are
not quite dependent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.choices.limits import ALMOST, DEPENDENT, LOOKED_AT, SHORT_ROW, TAKES_PART
from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import Row, RowForm, System


@dataclass(frozen=True)
class Group:
    """Rows that depend on each other: those in `kept` are independent, each of `others` combines
    those it `repeats`."""

    kept: tuple[int, ...]
    others: tuple[int, ...]
    repeats: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Independent:
    """E A, E c and E β: independent rows that stand for all. `pivots` vanish where those of a group
    do not determine it."""

    E: ca.SX  # r × nc
    A: ca.SX
    c: ca.SX
    beta: ca.SX
    names: tuple[str, ...]
    pivots: tuple[tuple[str, Scalar], ...] = ()  # with the names of the rows they are of

    def form(self, k: int) -> RowForm:
        """Row k as the elimination reads it."""
        columns = self.A[k, :].sparsity().get_triplet()[1]
        return RowForm(
            self.names[k], (), tuple((j, self.A[k, j]) for j in columns), self.c[k], self.beta[k]
        )

    def spread(self, forces: Sequence[Scalar]) -> ca.SX:
        """λ = Eᵀ y of all rows (nc × 1), for the multipliers y of these: where rows repeat each
        other, the λ of least norm among those with the same Aᵀ λ."""
        result = ca.SX.zeros(self.E.size2())
        for k, i in zip(*self.E.sparsity().get_triplet()):
            result[i] += self.E[k, i] * forces[k]
        return result


def groups(A: np.ndarray, kept: Sequence[int], least: float = TAKES_PART) -> tuple[Group, ...]:
    """From A at regular states (k × nc × nv, rows scaled alike); a row of zeros is a group of its
    own, with nothing kept.

    The weights of a dependent row are A_other A_kept⁺, and a kept row takes part where its weight
    is not roundoff, below `least`, at some state. Groups that share a kept row are one.
    """
    others = [i for i in range(A.shape[1]) if i not in kept]
    if not others:
        return ()
    seen = A[:LOOKED_AT]
    weights = np.max(np.abs(seen[:, others] @ np.linalg.pinv(seen[:, list(kept)])), axis=0)
    result: list[Group] = []
    for i, row in zip(others, weights):
        repeated = tuple(k for k, x in zip(kept, row) if x > least)
        group = Group(repeated, (i,), (repeated,))
        for other in [g for g in result if set(g.kept) & set(group.kept)]:
            result.remove(other)
            both = tuple(sorted({*other.kept, *group.kept}))
            group = Group(both, (*other.others, *group.others), (*other.repeats, *group.repeats))
        result.append(group)
    return tuple(result)


def selected(system: System, kept: Sequence[int]) -> Independent:
    """The kept rows alone, E a selection of rows of the unit matrix. The others carry no force
    then: a convention, as their reactions are not determined by rigid bodies."""
    rows, E = list(kept), ca.SX(len(kept), len(system.rows))
    for k, i in enumerate(rows):
        E[k, i] = 1
    names = tuple(system.rows[i].name for i in rows)
    return Independent(E, system.A[rows, :], system.c[rows, :], system.beta[rows, :], names)


def combined(system: System, kept: Sequence[int], found: Sequence[Group]) -> Independent:
    """The rows of each group combined, E = (1 + CᵀC)⁻¹ [1 Cᵀ] with C = A_others A_kept⁺; all other
    rows as they are."""
    plain = selected(system, kept)
    pivots: list[tuple[str, Scalar]] = []
    E, names = plain.E, list(plain.names)
    for group in (g for g in found if g.kept):
        block, own = _pseudo_inverse(system.A[list(group.kept), :], system.A[list(group.others), :])
        places = [list(kept).index(i) for i in group.kept]
        E[places, [*group.kept, *group.others]] = block
        pivots += [(system.rows[i].name, x) for i, x in zip(group.kept, own)]
        for k, i in zip(places, group.kept):
            names[k] = f"{system.rows[i].name} with what repeats it"
    A, c, beta = (ca.mtimes(E, x) for x in (system.A, system.c, system.beta))
    return Independent(E, A, c, beta, tuple(names), tuple(pivots))


def _pseudo_inverse(kept: ca.SX, others: ca.SX) -> tuple[ca.SX, Vector]:
    """[1; C]⁺ with C of others = C kept, and the pivots of kept keptᵀ."""
    r = kept.size1()
    gram = ldl_solution(
        scalars(ca.mtimes(kept, kept.T)), _rows(ca.mtimes(others, kept.T)), range(r)
    )
    C = ca.vertcat(*[ca.horzcat(*row) for row in gram.x])
    sides = [*_rows(ca.SX.eye(r)), *_rows(C)]
    solution = ldl_solution(scalars(ca.SX.eye(r) + ca.mtimes(C.T, C)), sides, range(r)).x
    return ca.horzcat(*[ca.vertcat(*column) for column in solution]), gram.pivots


def _rows(matrix: ca.SX) -> list[Vector]:
    return [list(row) for row in scalars(matrix)]


def sentences(system: System, found: Sequence[Group]) -> tuple[str, ...]:
    """One for every closure or constraint with rows that repeat others."""
    fate = "kept" if keeps(system) else "dropped"
    least = ", the least ones are given" if keeps(system) else ""
    return tuple(
        f"{text} at the sampled states and {'is' if count == 1 else 'are'} {fate}: the reactions "
        f"of all of these are not unique{least}"
        for text, count in _claims(system, found)
    )


def dependent_rows(
    system: System, A: np.ndarray, kept: Sequence[int], sizes: Sequence[float]
) -> str:
    """Which of the `kept` rows, independent elsewhere, depend on each other at one state with these
    A, whose rows have usual `sizes`; "" where none does. Where they do a consistent state is found
    to half the digits alone."""
    scaled = A / np.array(sizes)[:, None]
    there: list[int] = []
    for i in kept:
        if np.linalg.svd(scaled[[*there, i]], compute_uv=False)[-1] > ALMOST:
            there.append(i)
    here = groups(scaled[None], there, ALMOST)
    dependent = [
        replace(group, others=(i,), repeats=(rows,))
        for group in here
        for i, rows in zip(group.others, group.repeats)
    ]
    dependent = [group for group in dependent if group.others[0] in kept]
    return " and ".join(text for text, _ in _claims(system, dependent))


def _evened(A: np.ndarray) -> np.ndarray:
    """Rows of length one, but for those that rounding left of zero."""
    lengths = np.linalg.norm(A, axis=1, keepdims=True)
    longest = float(np.max(lengths, initial=0.0)) or 1.0
    return A / np.maximum(lengths, SHORT_ROW * longest)


def check_repeated(
    system: System, A: np.ndarray, kept: Sequence[int], least: float = DEPENDENT
) -> None:
    """Raises AssumptionError where rows other than the `kept` ones do not repeat these at a
    consistent state with this A, as with other parameters: equations that leave them out would let
    the loop break. Singular values below `least` are zero."""
    scaled = _evened(A)
    rank = int(np.linalg.matrix_rank(scaled, tol=least))
    if rank <= len(kept):
        return
    held, freed = list(kept), list[int]()
    for i in (i for i in range(len(A)) if i not in kept):
        if np.linalg.matrix_rank(scaled[[*held, i]], tol=least) > len(held):
            held.append(i)
            freed.append(i)
    repeats = f"{_listing(system, freed)} repeat{'' if len(freed) > 1 else 's'} other rows"
    speeds = system.v.numel()
    raise AssumptionError(
        f"{system.model.name}: {repeats} with the values of the file, but not with these: the rank "
        f"of the constraints is {rank}, not {len(kept)}, and {speeds - rank} speeds are free, not "
        f"{speeds - len(kept)}",
        "values with which the loop closes, or these values in the file: what repeats is found "
        "there",
    )


def _claims(system: System, found: Sequence[Group]) -> Iterator[tuple[str, int]]:
    """Owner by owner: "rows 4 and 6 of closure C (…) repeat …", and how many rows that are."""
    for owner in dict.fromkeys(_owner(row) for row in system.rows):
        pairs = [pair for group in found for pair in zip(group.others, group.repeats)]
        own = sorted(pair for pair in pairs if _owner(system.rows[pair[0]]) == owner)
        idle, others = (
            [i for i, repeated in own if not repeated],
            [i for i, repeated in own if repeated],
        )
        parts = (
            [f"{_listing(system, idle)} say{'' if len(idle) > 1 else 's'} nothing"] if idle else []
        )
        if others:
            repeated = sorted({k for _, rows in own for k in rows})
            parts.append(
                f"{_listing(system, others)} repeat{'' if len(others) > 1 else 's'} "
                f"{_listing(system, repeated)}"
            )
        if parts:
            yield " and ".join(parts), len(own)


def _owner(row: Row) -> str:
    return row.name.partition(".")[0]


def keeps(system: System) -> bool:
    """Whether the model asks to keep rows that repeat others (`redundant: keep`) and share the
    reactions among them, rather than to drop them."""
    return system.model.redundant == "keep"


def _listing(system: System, rows: Sequence[int]) -> str:
    """rows 4 and 6 of closure C (C.x, C.y) and constraint d."""
    owners = dict.fromkeys(_owner(system.rows[i]) for i in rows)
    return " and ".join(
        _of_one(system, owner, [i for i in rows if _owner(system.rows[i]) == owner])
        for owner in owners
    )


def _of_one(system: System, owner: str, rows: Sequence[int]) -> str:
    everything = [i for i, row in enumerate(system.rows) if _owner(row) == owner]
    kind = (
        "closure"
        if any(closure.name == owner for closure in system.model.closures)
        else "constraint"
    )
    if len(everything) == 1:
        return f"{kind} {owner}"
    numbers = [str(everything.index(i) + 1) for i in rows]
    text = numbers[0] if len(numbers) == 1 else f"{', '.join(numbers[:-1])} and {numbers[-1]}"
    names = ", ".join(system.rows[i].name for i in rows)
    return f"row{'s' if len(numbers) > 1 else ''} {text} of {kind} {owner} ({names})"
