"""A quadratic form and rows over the same unknowns, from which unknowns are taken out one by one.

The least of ½ xᵀ Q x − τᵀ x with A x = 0: an unknown is replaced by a combination of others, solved
for in a row, or, where no row speaks of it, minimised over. What stays sparse is never filled.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from derive.expressions.scalars import Matrix, Scalar
from derive.joints.rotations import dot, is_zero, plus, times, transpose
from derive.mechanics.elimination.solve import reflected_solution, small_inverse
from derive.mechanics.limits import COFACTORS

Combination = dict[int, Scalar]  # Σ coefficient · unknown


@dataclass(frozen=True)
class Replaced:
    """unknown = Σ coefficient · others."""

    unknown: int
    by: Combination


@dataclass(frozen=True)
class Minimised:
    """unknown = (its force − Σ ψ · others)/m̂."""

    unknown: int
    m: Scalar
    psi: Combination


@dataclass(frozen=True)
class Held:
    """Rows by which unknowns are held: Cᵀ λ = Σ ψ · others − force − Σ λ of rows that wait, for
    each of the unknowns."""

    rows: tuple[int, ...]
    unknowns: tuple[int, ...]
    block: Matrix
    psi: tuple[Combination, ...]
    waiting: tuple[Combination, ...]  # by row, what it has of each unknown


Step = Replaced | Minimised | Held


@dataclass
class QuadraticForm:
    """A quadratic form, ½ xᵀ Q x, and rows over the same unknowns, from which unknowns are taken
    out one by one."""

    entries: dict[int, Combination] = field(default_factory=dict[int, Combination])
    rows: dict[int, Combination] = field(default_factory=dict[int, Combination])
    speaking: dict[int, set[int]] = field(default_factory=dict[int, set[int]])  # rows by unknown
    steps: list[Step] = field(default_factory=list[Step])
    last: int = -1  # the unknown with the highest number
    lasting: set[int] = field(default_factory=set[int])  # which leave by `replace` alone
    sums: dict[int, Combination] = field(default_factory=dict[int, Combination])
    parts: dict[int, set[int]] = field(default_factory=dict[int, set[int]])  # sums by unknown

    def add(self, i: int, j: int, x: Scalar) -> None:
        """A symmetric pair of entries."""
        if is_zero(x):
            return
        row = self.entries.setdefault(i, {})
        row[j] = plus(row[j], x) if j in row else x
        self.entries.setdefault(j, {})[i] = row[j]

    def add_to_row(self, i: int, by: Mapping[int, Scalar], weight: Scalar = 1.0) -> None:
        """Row i + weight · by."""
        added(self.rows[i], by, weight)
        for j in by:
            if is_zero(self.rows[i][j]):
                del self.rows[i][j]
                self.speaking.get(j, set()).discard(i)
            else:
                self.speaking.setdefault(j, set()).add(i)

    def _without(self, unknown: int) -> tuple[Scalar, Combination]:
        """Its diagonal entry and the others, taken out of Q."""
        row = self.entries.pop(unknown, {})
        own = row.pop(unknown, 0.0)
        for j in row:
            del self.entries[j][unknown]
        return own, row

    def replace(self, unknown: int, by: Combination) -> None:
        """Put `by` in the place of an unknown."""
        own, row = self._without(unknown)
        terms = sorted(by.items())
        for place, (j, x) in enumerate(terms):
            for k, y in row.items():
                change = times(x, y)
                self.add(j, k, times(2.0, change) if j == k else change)
            if not is_zero(own):
                weighed = times(own, x)
                for k, y in terms[place:]:
                    self.add(j, k, times(weighed, y))
        for i in sorted(self.speaking.pop(unknown, set())):
            weight = self.rows[i].pop(unknown)
            self.add_to_row(i, by, weight)
        self.steps.append(Replaced(unknown, by))

    def minimise(self, unknown: int) -> None:
        """Take out an unknown that no row speaks of: Q − ψ ψᵀ/m̂."""
        m, psi = self._without(unknown)
        terms = sorted(psi.items())
        for place, (j, x) in enumerate(terms):
            weighed = times(-1.0, x / m)
            for k, y in terms[place:]:
                self.add(j, k, times(weighed, y))
        self.steps.append(Minimised(unknown, m, psi))

    def solve(self, indices: Sequence[int], unknowns: Sequence[int]) -> None:
        """Rows solved for unknowns, which they are put in the place of."""
        self._join(indices)
        rows = [self.rows.pop(i) for i in indices]
        for i, row in zip(indices, rows):
            for j in row:
                self.speaking[j].discard(i)
        block = [[row.pop(j, 0.0) for j in unknowns] for row in rows]
        psi = tuple(dict(self.entries.get(j, {})) for j in unknowns)
        waiting = tuple(
            {i: self.rows[i][j] for i in sorted(self.speaking.get(j, set()))} for j in unknowns
        )
        self.steps.append(Held(tuple(indices), tuple(unknowns), block, psi, waiting))
        others = sorted({j for row in rows for j in row})
        sides = [[row.get(j, 0.0) for j in others] for row in rows]
        for j, row in zip(unknowns, solved(block, sides)):
            self.replace(j, {k: times(-1.0, x) for k, x in zip(others, row) if not is_zero(x)})

    def _join(self, indices: Sequence[int]) -> None:
        """Of which the rows know the sum or difference alone becomes one unknown, for a while."""
        others = {j for i in indices for j in self.rows[i]} & self.lasting
        seen: dict[tuple[float, ...], int] = {}
        for j in sorted(others):
            column = _numbers(self.rows[i].get(j, 0.0) for i in indices)
            if column is None:
                continue
            for sign in (-1.0, 1.0):
                first = seen.pop(tuple(-sign * x for x in column), None)
                if first is not None:
                    self._put_together(j, first, sign)
                    break
            else:
                seen[column] = j

    def _put_together(self, unknown: int, first: int, sign: float) -> None:
        """unknown = sign · first + a new one."""
        self.last += 1
        self.replace(unknown, {first: sign, self.last: 1.0})
        self.sums[self.last] = {unknown: 1.0, first: -sign}
        for k in (unknown, first):
            self.parts.setdefault(k, set()).add(self.last)

    def part(self, unknown: int) -> None:
        """Take back what it was put together in."""
        for joined in sorted(self.parts.pop(unknown, set())):
            by = self.sums.pop(joined, None)
            if by is not None:
                self.replace(joined, by)


def _numbers(values: Iterable[Scalar]) -> tuple[float, ...] | None:
    found = [*values]
    numbers = [x for x in found if isinstance(x, float)]
    return tuple(numbers) if len(numbers) == len(found) else None


def solved(block: Matrix, sides: Matrix) -> Matrix:
    """block⁻¹ sides."""
    if len(block) > COFACTORS:
        return reflected_solution(block, sides)[0]
    columns = transpose(sides)
    return [[dot(row, column) for column in columns] for row in small_inverse(block)[0]]


def added(to: Combination, by: Mapping[int, Scalar], weight: Scalar = 1.0) -> None:
    """Put weight · by on top of a combination."""
    for j, x in by.items():
        change = times(weight, x)
        to[j] = plus(to[j], change) if j in to else change


def value_of(by: Combination, found: Mapping[int, Scalar]) -> Scalar:
    """What a combination comes to."""
    return dot(list(by.values()), [found[k] for k in by])
