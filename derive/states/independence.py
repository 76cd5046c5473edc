"""Which rows of A are independent, and which of them are kept where some repeat others.

Rows that repeat each other at every position need not do so in one way: which of them can be left
out may change from place to place. The rows that are kept have to be independent wherever all of
them have full rank.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from derive.numerics import NONZERO
from derive.states.limits import MOST_SETS, POOR, RANK, REGULAR, SINGULAR


def independent(
    rows: np.ndarray, candidates: Sequence[int], before: Sequence[int] = ()
) -> tuple[int, ...]:
    """Of the candidates among rows (states × rows × nv, of length at most one) those that add rank
    at most of the states, first come first kept. Where these are nearly dependent at some state at
    which all of them are not, other rows may be kept in their place: those `before` and as many
    more, or without these where that is no better."""
    first = _first(rows, candidates)
    if len(first) == len(candidates) or share(rows, first, candidates) >= POOR:
        return first
    best = _best(rows, candidates, first, before)
    if share(rows, best, candidates) >= POOR or not before:
        return best
    return _best(rows, candidates, best, ())


def _best(
    rows: np.ndarray, candidates: Sequence[int], first: tuple[int, ...], before: Sequence[int]
) -> tuple[int, ...]:
    """Of the sets looked at the one with the largest share, `first` before its equals."""
    sets = [first, *_others(candidates, len(first), before)]
    sets.append(_farthest(rows, candidates, len(first), before))
    whole = _whole(rows, candidates, len(first))
    # rounded, so that ties go the same way on every machine
    return max(sets, key=lambda kept: round(whole.share(rows[:, list(kept)]), 3))


def _others(
    candidates: Sequence[int], rank: int, before: Sequence[int]
) -> Iterator[tuple[int, ...]]:
    """All sets of that many candidates with those `before` among them, while they are few."""
    free, wanted = [i for i in candidates if i not in before], rank - len(before)
    if wanted >= 0 and comb(len(free), wanted) <= MOST_SETS:
        for more in combinations(free, wanted):
            yield tuple(sorted((*before, *more)))


def share(rows: np.ndarray, kept: Sequence[int], candidates: Sequence[int]) -> float:
    """The least part, over regular states, that the kept rows K have of the independence of all
    candidates E: σ_min(K) over the least σ(E) that counts. One at best where rows are left out that
    say nothing, √(r / n) where n rows say the same r times.

    Far from positions at which all rows lose rank it is the least |K d| / |E d| over directions d
    that E tells of, which may be less: with E = U Σ Vᵀ it is σ_min(K V Σ⁻¹).
    """
    if not kept or not len(rows):
        return 1.0
    return _whole(rows, candidates, len(kept)).share(rows[:, list(kept)])


@dataclass(frozen=True)
class _Whole:
    """What all rows say: σ_r of each state, which states are regular and which far from singular
    ones, and V Σ⁻¹ of the latter."""

    every: np.ndarray
    regular: np.ndarray
    far: np.ndarray
    scaled: np.ndarray

    def share(self, own: np.ndarray) -> float:
        """That of some rows, as many as the rank."""
        least = _least(own)[self.regular] / np.maximum(self.every[self.regular], NONZERO)
        return float(np.min([*least, *_least(own[self.far] @ self.scaled)], initial=1.0))


def _whole(rows: np.ndarray, candidates: Sequence[int], rank: int) -> _Whole:
    _, sizes, Vt = np.linalg.svd(rows[:, list(candidates)], full_matrices=False)
    sizes, Vt = sizes[:, :rank], Vt[:, :rank]
    every = sizes[:, -1]
    regular, far = (every > part * np.median(every) for part in (SINGULAR, REGULAR))
    scaled = (Vt / np.maximum(sizes, NONZERO)[:, :, None])[far].transpose(0, 2, 1)
    return _Whole(every, regular, far, scaled)


def _least(rows: np.ndarray) -> np.ndarray:
    """σ_min of each."""
    return np.asarray(np.linalg.svd(rows, compute_uv=False)[:, -1])


def _first(rows: np.ndarray, candidates: Sequence[int]) -> tuple[int, ...]:
    """By Gram–Schmidt in the order given: a row that depends on earlier ones at a singular position
    alone is kept. No more than there are columns, as which rows repeat others may differ from state
    to state."""
    rest = rows.copy()
    kept: list[int] = []
    for i in candidates:
        if len(kept) == rows.shape[2]:
            break
        lengths = np.linalg.norm(rest[:, i], axis=1)
        if np.sum(lengths > RANK) <= len(rest) / 2:
            continue
        kept.append(i)
        rest = _without(rest, i, lengths)
    return tuple(kept)


def _farthest(
    rows: np.ndarray, candidates: Sequence[int], rank: int, before: Sequence[int]
) -> tuple[int, ...]:
    """Those `before`, then row by row the one of which most is left at the state where least of it
    is."""
    rest = rows.copy()
    kept: list[int] = []
    for n in range(rank):
        lengths = np.linalg.norm(rest, axis=2)
        free = [i for i in candidates if i not in kept]
        # rounded, so that ties go the same way on every machine
        best = max(free, key=lambda i: round(float(np.min(lengths[:, i])), 6))
        best = before[n] if n < len(before) else best
        kept.append(best)
        rest = _without(rest, best, lengths[:, best])
    return tuple(sorted(kept))


def _without(rest: np.ndarray, i: int, lengths: np.ndarray) -> np.ndarray:
    """What is left of all rows beside row i."""
    unit = rest[:, i] / np.where(lengths > RANK, lengths, 1.0)[:, None]
    for _ in range(2):  # once more, for what roundoff left along it
        rest = rest - (rest @ unit[:, :, None]) * unit[:, None, :]
    return rest
