"""Labels put where they cover nothing: best places first, in a fixed order.

Each label tries the places around what it names, ring by ring outwards. A place on another label is
never taken; one on a drawn line costs by how much of it is covered.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from hamel.draw.mechanism.records import Box, Label, Lettering, Mark, Point
from hamel.draw.mechanism.typeset import extent

RINGS = (0.0, 5.0, 11.0, 18.0, 26.0, 36.0, 48.0, 62.0, 80.0, 100.0, 125.0, 155.0)
TURNS = (0, 45, 90, 135, 180, 225, 270, 315, 22, 68, 112, 158, 202, 248, 292, 338)
CLEAR = 2.0  # pixels between labels
COVERED, FURTHER, ELSEWHERE = 9.0, 0.55, 1.5  # what a covered point, a pixel and a direction cost
FAR = 17.0  # pixels from which a line leads to what is named
GRID = 3.0  # pixels between points of a line that are looked at
HALF_BAR = 6.0  # pixels
ENOUGH = 0.4  # a place that costs less is taken at once


class Ground:
    """What is drawn, as points on a grid of cells."""

    def __init__(self, marks: Iterable[Mark]) -> None:
        self._cells: dict[tuple[int, int], list[Point]] = {}
        for mark in marks:
            for x, y in _sampled(mark):
                self._cells.setdefault((int(x // 16), int(y // 16)), []).append((x, y))

    def covered(self, box: Box) -> int:
        """How many points a box would hide."""
        count = 0
        for i in range(int(box.left // 16), int(box.right // 16) + 1):
            for j in range(int(box.top // 16), int(box.bottom // 16) + 1):
                for x, y in self._cells.get((i, j), ()):
                    inside = box.left < x < box.right and box.top < y < box.bottom
                    count += inside
        return count


FAINT = ("grid", "floor", "trace", "core")  # a label may stand on these


def _sampled(mark: Mark) -> list[Point]:
    if mark.style in FAINT:
        return []
    if mark.radius:
        (x, y), r = mark.points[0], mark.radius
        count = max(8, int(2 * math.pi * r / GRID))
        angles = [2 * math.pi * k / count for k in range(count)]
        return [(x, y), *((x + r * math.cos(a), y + r * math.sin(a)) for a in angles)]
    if mark.style == "bar":
        return _edges(mark)
    points: list[Point] = []
    ends = (*mark.points, mark.points[0]) if mark.closed else mark.points
    for (x0, y0), (x1, y1) in pairwise(ends):
        count = max(1, int(math.dist((x0, y0), (x1, y1)) / GRID))
        points += [(x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count) for k in range(count)]
    return [*points, ends[-1]]


def _edges(mark: Mark) -> list[Point]:
    """Of a bar, which is wide."""
    (x0, y0), (x1, y1) = mark.points[0], mark.points[-1]
    length = math.dist((x0, y0), (x1, y1)) or 1.0
    across = (-(y1 - y0) / length * HALF_BAR, (x1 - x0) / length * HALF_BAR)
    points: list[Point] = []
    for s in (-1, 0, 1):
        a = (x0 + s * across[0], y0 + s * across[1])
        b = (x1 + s * across[0], y1 + s * across[1])
        points += _sampled(Mark("edge", (a, b)))
    return points


def placed(labels: Sequence[Label], marks: Iterable[Mark]) -> tuple[list[Lettering], list[Label]]:
    """Every label in a place of its own, and those for which there is none."""
    ground = Ground(marks)
    letterings: list[Lettering] = []
    left: list[Label] = []
    for label in labels:
        lettering = _best(label, ground, [x.box for x in letterings])
        if lettering is None:
            left.append(label)
        else:
            letterings.append(lettering)
    return letterings, left


def _best(label: Label, ground: Ground, taken: Sequence[Box]) -> Lettering | None:
    best: tuple[float, Box, float] | None = None
    for further in RINGS:
        if best is not None and best[0] <= FURTHER * further:
            break
        for rank, direction in enumerate(_directions(label)):
            box = _box(label, direction, label.away + further)
            if any(box.grown(CLEAR).overlaps(other) for other in taken):
                continue
            cost = (
                FURTHER * further + _strange(label, rank) + COVERED * ground.covered(box.grown(1.5))
            )
            if best is None or cost < best[0] - 1e-9:
                best = (cost, box, further)
        if best is not None and best[0] < ENOUGH:
            break
    if best is None:
        return None
    _, box, further = best
    return Lettering(label, box, _leader(label, box) if further >= FAR else ())


def _directions(label: Label) -> list[float]:
    """Those wished for, then all around by how near they are to the first of these."""
    wished = list(label.directions)
    first = wished[0] if wished else 45.0
    others = sorted(TURNS, key=lambda a: (abs((a - first + 180) % 360 - 180), a))
    return wished + [float(a) for a in others]


def _strange(label: Label, rank: int) -> float:
    """What a direction costs that was not wished for."""
    wished = max(len(label.directions), 1)
    return 0.05 * rank if rank < wished else ELSEWHERE + 0.1 * (rank - wished)


def _box(label: Label, direction: float, away: float) -> Box:
    """The letters' box whose nearest edge is so far from the point, in a direction."""
    width, above, below = extent(label.latex)
    height = above + below
    dx, dy = math.cos(math.radians(direction)), -math.sin(math.radians(direction))
    x = label.at[0] + dx * away + dx * width / 2
    y = label.at[1] + dy * away + dy * height / 2
    return Box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def _leader(label: Label, box: Box) -> tuple[Point, ...]:
    """From the box to the point, short of both."""
    x, y = label.at
    near = (min(max(x, box.left), box.right), min(max(y, box.top), box.bottom))
    length = math.dist(near, (x, y))
    if length < FAR:
        return ()
    short = 1 - 6.0 / length
    return (near, (near[0] + (x - near[0]) * short, near[1] + (y - near[1]) * short))
