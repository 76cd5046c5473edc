"""Where a branch of steady motions turns back: beyond, there is none of it.

Along the branch, by its own length and not by the value that changes, nothing is singular at a
fold. With z = (y, t), where t goes from 0 to 1 on the way of the values, R(z) = 0 is one curve; its
tangent τ is in the null space of ∂R/∂z, which is J with one column more. The fold is where τ_t
changes its sign. Source: Keller, Applications of Bifurcation Theory (1977), pseudo-arclength.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.branch import Place
from derive.linearize.critical import root
from derive.linearize.limits import (
    ARC,
    ARC_DIPS,
    ARC_LEAST,
    ARC_OFF,
    ARC_ROUNDS,
    ARC_STANDS,
    ARC_STEPS,
    ARC_TURN,
    LITTLE,
    RANK,
)
from derive.linearize.search import row_sizes, shifts_at, slopes_at, with_inputs
from derive.linearize.steady import Problem


@dataclass(frozen=True)
class _Point:
    """A point of the curve: z in the model's own units, and the tangent there."""

    z: np.ndarray
    tangent: np.ndarray

    @property
    def t(self) -> float:
        """How far on the way of the values it is."""
        return float(self.z[-1])

    @property
    def ahead(self) -> float:
        """τ_t: positive before the fold, negative beyond."""
        return float(self.tangent[-1])


@dataclass(frozen=True)
class _Curve:
    """R(z) = 0 in the unknowns that are not held, and t; `rank` is that of ∂R/∂z."""

    found: Problem
    first: Place
    way: tuple[np.ndarray, np.ndarray]  # of the values, from t = 0 to t = 1
    held: np.ndarray  # by what the inputs that are held change on this way
    free: np.ndarray  # which entries of (y, t) are in z
    units: np.ndarray
    rows: np.ndarray
    rank: int

    def place(self, z: np.ndarray) -> Place:
        """The motion at a point of the curve, and its values."""
        t, y = float(z[-1]), self.first.y + z[-1] * self.held
        y[self.free[:-1]] = (z * self.units)[:-1]
        return Place(self.first.p + t * self.way[0], self.first.s + t * self.way[1], y)

    def slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R and ∂R/∂z. Raises AssumptionError where they are not finite."""
        place = self.place(z)
        R, J = slopes_at(self.found, place.y, place.p, place.s)
        along = shifts_at(self.found, place.y, place.p, place.s) @ np.concatenate(self.way)
        G = np.column_stack([J, along + J @ self.held])[:, self.free] * self.units
        if not np.all(np.isfinite(G)):
            raise AssumptionError("the slopes of the steady motions are not finite here", "")
        return R / self.rows, G / self.rows[:, None]

    def start(self) -> _Point | None:
        """The first place, with its tangent to where t grows; None where it is at the fold."""
        y = np.append(self.first.y, 0.0)[self.free] / self.units
        ahead = np.zeros(len(y))
        ahead[-1] = 1.0
        return self._at(y, ahead, 0.0)

    def point(self, here: _Point, step: float) -> _Point | None:
        """The point a step further; None where it is not found or the curve turns too far."""
        z = here.z + step * here.tangent
        with suppress(AssumptionError), np.errstate(all="ignore"):
            for _ in range(ARC_ROUNDS):
                R, slopes = self.slopes(z)
                correction = self._split(slopes)[0] @ R
                z = z - correction
                if np.max(np.abs(correction)) <= ARC_STANDS * (1 + np.max(np.abs(z))):
                    return (
                        self._at(z, here.tangent, ARC_TURN) if self._smooth(here, step, z) else None
                    )
        return None

    def _smooth(self, here: _Point, step: float, z: np.ndarray) -> bool:
        """Whether each unknown came to about where the tangent led: else the way went across a
        fold, to another part of the curve. t may have turned back."""
        ahead = here.z + step * here.tangent
        off, change = np.abs(z - ahead)[:-1], np.abs(z - here.z)[:-1]
        room = change + LITTLE * np.max(change, initial=0.0)
        return bool(np.all(off <= ARC_OFF * room + ARC_STANDS * (1 + np.abs(z[:-1]))))

    def _at(self, z: np.ndarray, before: np.ndarray, least: float) -> _Point | None:
        """With the tangent that goes on as the one before: of several directions, as along a
        family, what they have of that one."""
        null = self._split(self.slopes(z)[1])[1]
        tangent = null.T @ (null @ before)
        size = float(np.linalg.norm(tangent))
        return _Point(z, tangent / size) if size > least else None

    def _split(self, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pseudo-inverse, and the null space as rows, by the rank of the whole curve."""
        U, sizes, V = np.linalg.svd(slopes)
        r = self.rank
        return V[:r].T @ (U[:, :r] / sizes[:r]).T, V[r:]


def _curve(found: Problem, place: Place, p: np.ndarray, s: np.ndarray) -> _Curve:
    """From a place towards the values (p, s)."""
    y, free = with_inputs(found, place.y, place.p, place.s)
    J = slopes_at(found, y, place.p, place.s)[1]
    curve = _Curve(
        found,
        Place(place.p, place.s, y),
        (p - place.p, s - place.s),
        with_inputs(found, y, p, s)[0] - y,
        np.append(free > 0, True),
        np.append(found.scale, 1.0)[np.append(free > 0, True)],
        row_sizes(found, J),
        0,
    )
    z = np.append(y, 0.0)[curve.free] / curve.units
    sizes = np.linalg.svd(curve.slopes(z)[1], compute_uv=False)
    return replace(curve, rank=int(np.sum(sizes > RANK * np.max(sizes, initial=0.0))))


@dataclass(frozen=True)
class Turn:
    """The way along a branch from a motion to where it turns back: points, with the step from each
    to the next, and from the last to the fold."""

    curve: _Curve
    points: tuple[_Point, ...]
    steps: tuple[float, ...]

    @property
    def fold(self) -> Place:
        """The motion at which the branch turns back."""
        return self.at(1.0)

    def at(self, part: float) -> Place:
        """The motion a part of this way from its beginning (0 … 1). Raises AssumptionError where
        there is none, as no point is found there."""
        whole, rest = divmod(part * len(self.steps), 1.0)
        k = min(int(whole), len(self.steps) - 1)
        share = rest + whole - k
        point = self.curve.point(self.points[k], share * self.steps[k])
        if point is None:
            raise AssumptionError("the branch of steady motions ends before it turns back", "")
        return self.curve.place(point.z)


def turn(found: Problem, place: Place, p: np.ndarray, s: np.ndarray) -> Turn | None:
    """To where the branch through `place` turns back on the way to the values (p, s); None where it
    comes there, or ends otherwise, as at a kink."""
    points, steps, step = list[_Point](), list[float](), ARC
    try:
        curve = _curve(found, place, p, s)
        here = curve.start()
    except AssumptionError:
        return None
    for _ in range(ARC_STEPS):
        if here is None or step < ARC_LEAST or not 0 <= here.t <= 1:
            return None
        there, middle = curve.point(here, step), curve.point(here, step / 2)
        if there is None or middle is None:
            step /= 2
            continue
        if middle.ahead < ARC_DIPS * min(here.ahead, there.ahead):  # it turns back, and on again
            there, step = middle, step / 2
            if middle.ahead > 0:
                continue
        points.append(here)
        if there.ahead <= 0:
            steps.append(_turning(curve, here, step))
            last = curve.point(here, steps[-1])
            reached = last is not None and 0 <= last.t <= 1
            return Turn(curve, tuple(points), tuple(steps)) if reached else None
        steps.append(step)
        here, step = there, 2 * step
    return None


def _turning(curve: _Curve, here: _Point, step: float) -> float:
    """The step from a point before the fold to the fold, which is less than this one."""

    def ahead(part: float) -> float:
        """τ_t a part of the way further; not a number where no point is found."""
        point = curve.point(here, part)
        return float("nan") if point is None else point.ahead

    return root(ahead, 0.0, step)
