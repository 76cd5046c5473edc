"""Models of coordinates and energies alone: which coordinates are points, what ties them, and dials
for the rest.

Coordinates of a length called x, y, z with the same ending (or beginning) are one point. A row of φ
whose second derivatives are c times the identity says |P − C| = constant, with C = P − ∇φ / c: a
rod. Other rows of one point leave it a curve or a surface, which is traced from where the point is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.mechanics.records import System
from derive.model.records import Model
from hamel.draw.mechanism.records import GROUND, Shape, Vector, spot

FORWARD = re.compile(r"([xyz])_?(\w*)")
BACKWARD = re.compile(r"(\w+?)_?([xyz])")
STEP, STEPS = 0.012, 420  # of a traced curve: relative to its size; at most each way
REACH = 48.0  # steps: where a curve is left
SAME = 1e-6
APART = 3.2  # between dials


@dataclass(frozen=True)
class Loose:
    """A point given by coordinates: their indices in q for x, y and z, −1 where there is none."""

    name: str
    indices: tuple[int, int, int]

    def owns(self, index: int) -> bool:
        """Whether a coordinate is one of its."""
        return index in self.indices


def loose_points(model: Model) -> tuple[Loose, ...]:
    """The points of a model without bodies."""
    groups: dict[str, dict[str, int]] = {}
    for index, x in enumerate(model.coordinates):
        if x.owner or x.unit != "m":
            continue
        letter, name = _parts(x.name)
        if letter:
            groups.setdefault(name, {})[letter] = index
    return tuple(
        Loose(name, (some.get("x", -1), some.get("y", -1), some.get("z", -1)))
        for name, some in groups.items()
        if len(some) > 1
    )


def _parts(name: str) -> tuple[str, str]:
    """The axis and the rest of a coordinate's name."""
    if match := FORWARD.fullmatch(name):
        return match[1], match[2]
    if match := BACKWARD.fullmatch(name):
        return match[2], match[1]
    return "", name


def plane_of(model: Model) -> str:
    """The plane that is drawn; "" in space."""
    if model.plane or model.bodies:
        return model.plane
    points = loose_points(model)
    used = "".join(x for k, x in enumerate("xyz") if any(p.indices[k] >= 0 for p in points))
    return {"xy": "xy", "xz": "xz", "yz": "yz", "xyz": ""}.get(used, "xy")


@dataclass(frozen=True)
class Dial:
    """A coordinate without a place, shown by itself: a needle, or a block that goes `factor` metres
    on the paper per unit. `centre` is along the first axis."""

    name: str
    index: int
    turns: bool
    factor: float
    centre: float

    @property
    def label(self) -> str:
        """The name of what it moves."""
        return f"dial of {self.name}"


def dials(model: Model, q: Vector, spans: Mapping[str, tuple[float, float]]) -> tuple[Dial, ...]:
    """For the coordinates of the analytic form that belong to no point."""
    if model.bodies:
        return ()
    points = loose_points(model)
    result: list[Dial] = []
    for index, x in enumerate(model.coordinates):
        if x.owner or any(point.owns(index) for point in points):
            continue
        far = max(abs(float(q[index])), *(abs(v) for v in spans.get(x.name, (0.0, 0.0))))
        turns = x.unit == "rad"
        factor = 1.0 if turns else 1.0 / (far or 1.0)
        result.append(Dial(x.name, index, turns, factor, APART * len(result)))
    return tuple(result)


# what ties points


@dataclass(frozen=True)
class Bonds:
    """Rods between spots, and curves of the ground."""

    rods: tuple[Shape, ...] = ()
    curves: tuple[Shape, ...] = ()
    ends: tuple[Vector, ...] = ()  # points of the ground that these reach


def bonds(system: System, points: Sequence[Loose], first: int, q: Vector, p: Vector) -> Bonds:
    """At q, t = 0; the point number k is carried by the body first + k."""
    if not points or not system.phi.numel():
        return Bonds()
    inputs = [system.t, system.q, system.own_p]
    value = ca.Function("phi", inputs, [system.phi, ca.jacobian(system.phi, system.q)])
    pattern = np.array(ca.jacobian(system.phi, system.q).sparsity().get_triplet()).T
    rods: list[Shape] = []
    ends: list[Vector] = []
    free: dict[int, list[int]] = {}
    for row in range(system.phi.numel()):
        columns = [int(j) for i, j in pattern if i == row]
        owners = [k for k, x in enumerate(points) if any(x.owns(j) for j in columns)]
        rod = _rod(system, (row, columns), [points[k] for k in owners], q, p)
        if rod is None:
            if len(owners) == 1:
                free.setdefault(owners[0], []).append(row)
        elif len(owners) == 2:
            spots = tuple(spot(first + k, np.zeros(3)) for k in owners)
            rods.append(Shape("line", "rod", spots))
        else:
            ends.append(rod)
            spots = (spot(GROUND, rod), spot(first + owners[0], np.zeros(3)))
            rods.append(Shape("line", "rod", spots))
    size = _size(points, q, ends)
    curves = [
        curve
        for k, rows in free.items()
        for curve in _curves(lambda x: value(0.0, x, p), points[k], rows, q, size)
    ]
    shapes = tuple(
        Shape("line", "curve", tuple(spot(GROUND, x) for x in curve)) for curve in curves
    )
    reach = [*ends, *(x for curve in curves for x in curve)]
    return Bonds(tuple(rods), shapes, tuple(reach))


def place(point: Loose, q: Vector) -> Vector:
    """Of a point in the ground (m)."""
    return np.array([q[k] if k >= 0 else 0.0 for k in point.indices])


def _size(points: Sequence[Loose], q: Vector, ends: Sequence[Vector]) -> float:
    """Of what there is to be drawn (m)."""
    places = np.array([np.zeros(3), *(place(x, q) for x in points), *ends])
    return float(np.max(np.ptp(places, axis=0))) or 1.0


def _rod(
    system: System,
    row: tuple[int, list[int]],
    owners: Sequence[Loose],
    q: Vector,
    p: Vector,
) -> Vector | None:
    """The fixed end of the rod that a row of φ says, or zeros for one between two points; None
    where it says something else."""
    index, columns = row
    if not owners or len(owners) > 2 or not columns:
        return None
    own = [j for x in owners for j in x.indices if j >= 0]
    if not set(columns) <= set(own):
        return None
    hessian, gradient = ca.hessian(system.phi[index], system.q)
    numbers = ca.Function("rod", [system.t, system.q, system.own_p], [hessian, gradient])
    H, g = (np.asarray(ca.densify(x)) for x in numbers(0.0, q, p))
    H, g = H[np.ix_(own, own)], g.ravel()[own]
    n = len(own) // len(owners)
    c = float(H[0, 0])
    pattern = np.array([[1.0]]) if len(owners) == 1 else np.array([[1.0, -1.0], [-1.0, 1.0]])
    if not abs(c) > 0 or np.abs(H - c * np.kron(pattern, np.eye(n))).max() > SAME * abs(c):
        return None
    if len(owners) == 2:
        return np.zeros(3)
    centre = place(owners[0], q)
    for slope, j in zip(g, own):
        centre[owners[0].indices.index(j)] -= slope / c
    return centre


def _curves(
    phi: Callable[[Vector], tuple[ca.DM, ca.DM]],
    point: Loose,
    rows: Sequence[int],
    q: Vector,
    size: float,
) -> list[list[Vector]]:
    """The curve on which rows leave a point; of a surface, its sections along the axes."""
    own = [j for j in point.indices if j >= 0]
    free = len(own) - len(rows)
    if free == 1:
        return [_traced(phi, point, (rows, ()), q, size)]
    if free == 2:
        return [_traced(phi, point, (rows, (j,)), q, size) for j in own]
    return []


def _traced(
    phi: Callable[[Vector], tuple[ca.DM, ca.DM]],
    point: Loose,
    held: tuple[Sequence[int], Sequence[int]],
    q: Vector,
    size: float,
) -> list[Vector]:
    """Both ways from the point, along the kernel of the rows and back onto them by Newton; `held`
    are rows of φ and coordinates that stay."""
    ways = [_way(phi, point, held, q, sign * STEP * size) for sign in (-1.0, 1.0)]
    return [*ways[0][::-1], place(point, q), *ways[1]]


def _way(
    phi: Callable[[Vector], tuple[ca.DM, ca.DM]],
    point: Loose,
    held: tuple[Sequence[int], Sequence[int]],
    q: Vector,
    step: float,
) -> list[Vector]:
    own = [j for j in point.indices if j >= 0]
    rows, still = held
    here, start = q.copy(), place(point, q)
    heading = np.zeros(len(own))
    path: list[Vector] = []
    for k in range(STEPS):
        values, slopes = phi(here)
        J = np.vstack([np.asarray(slopes)[np.ix_(rows, own)], *[_unit(own, j) for j in still]])
        tangent = np.linalg.svd(J)[2][-1]
        tangent *= np.sign(tangent @ heading) or np.sign(tangent[int(np.argmax(np.abs(tangent)))])
        heading = tangent
        here[own] += step * tangent
        values, slopes = phi(here)
        J = np.vstack([np.asarray(slopes)[np.ix_(rows, own)], *[_unit(own, j) for j in still]])
        error = np.concatenate([np.asarray(values).ravel()[list(rows)], np.zeros(len(still))])
        here[own] -= np.linalg.lstsq(J, error, rcond=None)[0]
        if not np.isfinite(here).all():
            break
        path.append(place(point, here))
        away = float(np.linalg.norm(path[-1] - start))
        if away > REACH * abs(step) or (k > 8 and away < 0.8 * abs(step)):
            break
    return path


def _unit(own: Sequence[int], j: int) -> Vector:
    return np.array([[1.0 if k == j else 0.0 for k in own]])
