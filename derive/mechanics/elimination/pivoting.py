"""The order in which a large sparse matrix is eliminated: which pivot blocks, chosen at samples.

Entries are held by row and by column and the best of them in a heap, so that an elimination that
touches few rows takes as long as these, and not as the whole matrix.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from derive.mechanics.elimination.solve import Block, Part, or_larger, steady
from derive.mechanics.limits import DIGITS, MANY, MOST_REFLECTED, SAME, VANISHES, ZERO

Score = tuple[bool, bool, int, int, float, int, int]  # least is best; row and column at the end


def pivot_order(samples: np.ndarray, structure: np.ndarray, constant: np.ndarray) -> list[Block]:
    """Pivot blocks for square matrices of one pattern: `samples` (k, n, n), `structure` and
    `constant` (n, n) flags. Raises as `sparse_pivot_order` does."""
    rows, columns = np.nonzero(structure)
    return sparse_pivot_order(
        samples.shape[1], (rows, columns), samples[:, rows, columns], constant[rows, columns]
    )


def sparse_pivot_order(
    n: int,
    places: tuple[np.ndarray, np.ndarray],
    samples: np.ndarray,
    constant: np.ndarray,
) -> list[Block]:
    """The same from entries: their rows and columns, `samples` (k, entries), and which are numbers.

    Greedy: a number before what varies; a single entry that stays away from zero before a block of
    two or three whose determinant does. Raises ZeroDivisionError where what is left is singular at
    every sample.
    """
    left = _table(n, places, samples, constant)
    chosen: list[Block] = []
    while left.rows:
        block = left.best()
        if block is None:
            raise ZeroDivisionError("the matrix is singular at every sampled state")
        block = left.steady(block)
        chosen.append(block)
        left.eliminate(block)
    return chosen


def _table(
    n: int,
    places: tuple[np.ndarray, np.ndarray],
    samples: np.ndarray,
    constant: np.ndarray,
) -> Table:
    rows: list[dict[int, np.ndarray]] = [{} for _ in range(n)]
    numbers = [set[int]() for _ in range(n)]
    down, across = (list(map(int, x)) for x in places)
    for i, j, values, number in zip(down, across, samples.T, constant):
        rows[i][j] = values
        if number:
            numbers[i].add(j)
    table = Table(len(samples), n)
    for i in range(n):
        table.put_row(i, rows[i], numbers[i])
    for j in range(n):
        table.columns.setdefault(j, set())  # one without entries is singular, not absent
    return table


def _rounded(size: float) -> float:
    """Of many equal loops rounding shall not tell which comes first."""
    return float(f"{size:.{DIGITS}e}")


class Table:
    """What is left of matrices, entry by entry: rows are put in and taken out, the best pivot is
    known at any time. An entry that is nowhere larger than `rounding` is none, also where nothing
    else is left."""

    def __init__(self, count: int, rows: int, rounding: float = 0.0) -> None:
        self.count = count  # of samples
        self.rounding = rounding
        self.told = _rounded if rows >= MANY else float
        self.rows: dict[int, dict[int, np.ndarray]] = {}
        self.columns: dict[int, set[int]] = {}
        self.fixed: set[tuple[int, int]] = set()
        self.sizes: dict[tuple[int, int], tuple[float, float]] = {}
        self.scores: dict[tuple[int, int], Score] = {}
        self.stale: set[tuple[int, int]] = set()  # scores that may have changed
        self.heap: list[Score] = []
        self.largest: list[tuple[float, int, int]] = []

    # ---- rows and entries

    def put_row(self, i: int, entries: Mapping[int, np.ndarray], numbers: Collection[int]) -> None:
        """A new row, or another one in its place; `numbers` are the columns of those."""
        if i in self.rows:
            self.drop_row(i)
        self.rows[i] = {}
        for j, values in entries.items():
            self._put(i, j, values)
            if j in numbers:
                self.fixed.add((i, j))
            self.stale.update((k, j) for k in self.columns[j])

    def drop_row(self, i: int) -> None:
        """Without that row, and without columns that have no other."""
        for j in self.rows.pop(i):
            self.columns[j].discard(i)
            self._forget(i, j)
            self.stale.update((k, j) for k in self.columns[j])
            if not self.columns[j]:
                del self.columns[j]

    def _put(self, i: int, j: int, values: np.ndarray) -> None:
        self.rows[i][j] = values
        self.columns.setdefault(j, set()).add(i)
        sizes = np.abs(values)
        least, largest = float(np.min(sizes)), float(np.max(sizes))
        self.sizes[i, j] = least, largest
        # what is no number counts as infinite: beside it nothing can be told
        heapq.heappush(self.largest, (-largest if np.isfinite(largest) else -np.inf, i, j))

    def _score(self, i: int, j: int) -> None:
        """Not varying first, then far from zero, then with little fill, then large."""
        least, largest = self.sizes[i, j]
        varies = (i, j) not in self.fixed and largest - least > SAME * largest
        share = least / largest if largest else 0.0
        fill = (len(self.rows[i]) - 1) * (len(self.columns[j]) - 1)
        nearness = -round(100.0 * share) if np.isfinite(share) else 0
        size = -self.told(least)
        score = (varies, varies and least <= ZERO * largest, nearness, fill, size, i, j)
        if self.scores.get((i, j)) != score:
            self.scores[i, j] = score
            heapq.heappush(self.heap, score)

    def scale(self) -> float:
        """The largest entry that is left."""
        while self.largest:
            size, i, j = self.largest[0]
            here = self.sizes.get((i, j))
            if here is not None and (-size == here[1] or not np.isfinite(here[1])):
                return -size
            heapq.heappop(self.largest)
        return 0.0

    def _array(self, rows: Sequence[int], columns: Sequence[int]) -> np.ndarray:
        """(samples, rows, columns), with zeros."""
        result = np.zeros((self.count, len(rows), len(columns)))
        for a, i in enumerate(rows):
            for b, j in enumerate(columns):
                if j in self.rows[i]:
                    result[:, a, b] = self.rows[i][j]
        return result

    def _flags(
        self, rows: Sequence[int], columns: Sequence[int], known: Iterable[tuple[int, int]]
    ) -> np.ndarray:
        marked = set(known)
        return np.array([[(i, j) in marked for j in columns] for i in rows], dtype=bool)

    # ---- pivots

    def best(self) -> Block | None:
        """The best pivot of what is left; None where all vanish."""
        for place in self.stale:
            if place in self.sizes:
                self._score(*place)
        self.stale.clear()
        entry = self._best_entry()
        if entry is None:
            return None
        i, j = entry
        least, largest = self.sizes[entry]
        grade = 0 if entry in self.fixed else 2 if self.scores[entry][0] else 1
        touching = {k for column in self.rows[i] for k in self.columns[column]}
        rows = sorted(touching)
        columns = sorted({column for k in rows for column in self.rows[k]})
        single = Block((rows.index(i),), (columns.index(j),), least, largest, grade)
        return _placed(or_larger(single, lambda: self._part(rows, columns)), rows, columns)

    def _best_entry(self) -> tuple[int, int] | None:
        least = max(VANISHES * self.scale(), self.rounding)
        aside: list[Score] = []
        result = None
        while self.heap and result is None:
            score = heapq.heappop(self.heap)
            place = score[-2:]
            if self.scores.get(place) != score:
                continue
            aside.append(score)
            largest = self.sizes[place][1]
            if np.isfinite(largest) and largest > least:
                result = place
        for score in aside:
            heapq.heappush(self.heap, score)
        return result

    def _part(self, rows: list[int], columns: list[int]) -> Part:
        entries = [(i, j) for i in rows for j in self.rows[i]]
        largest = [max(self.sizes[i, j][1] for i in self.columns[j]) for j in columns]
        return Part(
            self._array(rows, columns),
            self._flags(rows, columns, entries),
            self._flags(rows, columns, (x for x in entries if x in self.fixed)),
            self.scale(),
            np.array(largest),
        )

    def steady(self, block: Block) -> Block:
        """The block, unless digits may be lost by it: then all that is left, where that is not
        much."""
        if len(self.columns) > MOST_REFLECTED or len(self.rows) != len(self.columns):
            return block
        rows, columns = sorted(self.rows), sorted(self.columns)
        entries = [(i, j) for i in rows for j in self.rows[i] if (i, j) in self.fixed]
        places = tuple(rows.index(i) for i in block.rows), tuple(map(columns.index, block.columns))
        own = Block(*places, block.least, block.largest, block.grade)
        values = self._array(rows, columns)
        best = steady(values, self._flags(rows, columns, entries), own)
        return _placed(best, rows, columns)

    # ---- elimination

    def eliminate(self, block: Block) -> None:
        """Take the block out, and what it leaves of the other rows put in."""
        r, c = list(block.rows), list(block.columns)
        touched = sorted({i for j in c for i in self.columns[j]} - set(r))
        reached = sorted({j for i in r for j in self.rows[i]} - set(c))
        if touched and reached:
            self._change(r, c, touched, reached)
        for i in r:
            for j in self.rows.pop(i):
                self.columns[j].discard(i)
                self._forget(i, j)
        for j in c:
            for i in self.columns.pop(j):
                del self.rows[i][j]
                self._forget(i, j)
        self.stale.update((i, j) for i in touched for j in self.rows[i])
        self.stale.update((i, j) for j in reached for i in self.columns[j])

    def _change(self, r: list[int], c: list[int], touched: list[int], reached: list[int]) -> None:
        inverse = np.linalg.pinv(self._array(r, c))
        change = self._array(touched, c) @ inverse @ self._array(r, reached)
        left = self._array(touched, reached) - change
        numbers = all((i, j) in self.fixed for i in r for j in c)
        into = {i: all(self._is_fixed(i, j) for j in c) for i in touched}
        out = {j: all(self._is_fixed(i, j) for i in r) for j in reached}
        for a, i in enumerate(touched):
            for b, j in enumerate(reached):
                own = (i, j) in self.fixed or j not in self.rows[i]
                self._put(i, j, left[:, a, b])
                self.fixed.discard((i, j))
                if numbers and into[i] and out[j] and own:
                    self.fixed.add((i, j))

    def _is_fixed(self, i: int, j: int) -> bool:
        return (i, j) in self.fixed

    def _forget(self, i: int, j: int) -> None:
        del self.sizes[i, j]
        self.scores.pop((i, j), None)
        self.fixed.discard((i, j))


def _placed(block: Block, rows: Sequence[int], columns: Sequence[int]) -> Block:
    """A block of some rows and columns, by those of the matrix."""
    return Block(
        tuple(rows[i] for i in block.rows),
        tuple(columns[j] for j in block.columns),
        block.least,
        block.largest,
        block.grade,
    )
