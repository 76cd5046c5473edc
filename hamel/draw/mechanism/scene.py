"""A model at one state in numbers: poses, joints as both their bodies carry them, and the points of
every body that something holds on to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from derive.diagnostics import HamelError
from derive.expressions.evaluate import float_functions, float_tables, value
from derive.expressions.tree import Call, Expression, Name
from derive.expressions.tree import Vector as Entries
from derive.mechanics.records import System
from derive.model.constraint_records import Distance, NoSlip, OnSurface, Rolling
from derive.model.load_records import Bushing, Contact, Force, PointSpring, Tension
from derive.model.records import GROUND as GROUND_NAME
from derive.model.records import Closure, Joint, Model, Path, Placement
from derive.textbook.formulas.labels import labels
from hamel.draw.mechanism.anchors import LOOSE, Anchor
from hamel.draw.mechanism.points import Bonds, Dial, Loose, bonds, dials, loose_points
from hamel.draw.mechanism.poses import Bodies
from hamel.draw.mechanism.records import GROUND, Pose, Spot, Vector, spot
from hamel.draw.mechanism.shifts import shifted
from hamel.draw.mechanism.view import View

IDENTITY = Pose(np.eye(3), np.zeros(3))
NEAR = 1e-6  # of the size of the mechanism: points that are one


class Numbers:
    """What the formulas of a model are worth at a state with rates and inputs of zero."""

    def __init__(self, system: System, q: Vector, p: Vector) -> None:
        model = system.model
        self.names: dict[str, float] = {x.name: float(x.value) for x in model.parameters}
        free = [x.name for x in model.parameters if x.name not in system.constants]
        self.names |= dict(zip(free, p.tolist()))
        self.names |= dict(zip((x.name for x in model.coordinates), q.tolist()))
        still = (*model.inputs, *model.velocities, *model.states)
        self.names |= {x.name: 0.0 for x in still} | {"t": 0.0}
        self._rates = {x.name: 0.0 for x in model.coordinates}
        self._functions = {**float_functions(), **float_tables(model.tables)}
        for name, expression in model.definitions:
            self.names[name] = self.scalar(expression)

    def scalar(self, expression: Expression) -> float:
        """NaN where the formula has no number here."""
        try:
            return float(value(expression, self.names, self._rates, self._functions))
        except (ArithmeticError, ValueError, KeyError, TypeError, HamelError):
            return float("nan")

    def vector(self, entries: Sequence[Expression]) -> Vector:
        """Three of them; zero where there is no number."""
        return np.nan_to_num(np.array([self.scalar(x) for x in entries]))


@dataclass(frozen=True)
class Scene:
    """Everything a drawing reads; `view` has its scale when shapes are drawn. `spans`: the lowest
    and highest value of coordinates that a motion reaches."""

    system: System
    numbers: Numbers
    names: tuple[str, ...]
    poses: tuple[Pose, ...]
    anchors: tuple[Anchor, ...]
    held: tuple[tuple[Vector, ...], ...]  # per body: points that something holds on to
    view: View
    traced: tuple[tuple[str, Spot], ...]  # outputs that are points
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reach: tuple[Vector, ...] = ()  # points of the ground that a motion reaches
    bonds: Bonds = field(default_factory=Bonds)
    loose: tuple[Loose, ...] = ()
    dials: tuple[Dial, ...] = ()

    @property
    def model(self) -> Model:
        """The model drawn."""
        return self.system.model

    @cached_property
    def labels(self) -> dict[str, str]:
        """What the derivation calls coordinates, parameters and inputs."""
        return labels(self.model)

    def pose(self, body: int) -> Pose:
        """Of a body, or of the ground."""
        return IDENTITY if body == GROUND else self.poses[body]

    def place(self, at: Spot) -> Vector:
        """A spot in ground axes."""
        return self.pose(at.body).point(at.at)

    def index(self, name: str) -> int:
        """Of a body by its name; the ground's is −1."""
        return GROUND if name == GROUND_NAME else self.names.index(name)

    def fixed(self, body: int, at: Vector) -> Spot:
        """The spot of a body that is now at a point of the ground."""
        return spot(body, self.pose(body).inside(at))

    def com(self, body: int) -> Vector:
        """The centre of mass of a body, in its frame; the origin where it is none of the model's
        bodies."""
        some = self.model.bodies
        return self.numbers.vector(some[body].com) if 0 <= body < len(some) else np.zeros(3)

    @cached_property
    def size(self) -> float:
        """The largest extent of the points held, in metres."""
        points = [self.pose(k - 1).point(x) for k, some in enumerate(self.held) for x in some]
        extent = float(np.max(np.ptp(np.array(points), axis=0))) if points else 0.0
        return extent or 1.0


def scene(
    system: System,
    q: Vector,
    p: Vector,
    view: View,
    spans: Mapping[str, tuple[float, float]] | None = None,
) -> Scene:
    """The model at q, t = 0."""
    model, numbers = system.model, Numbers(system, q, p)
    loose = loose_points(model)
    bodies = Bodies(system, loose, dials(model, q, spans or {}))
    poses = bodies.at(0.0, q, p)
    coms = [numbers.vector(body.com) for body in model.bodies]
    anchors = [*_anchors(model, bodies.names, numbers), *(_dial(bodies, x) for x in bodies.dials)]
    if not view.flat:
        anchors = shifted(anchors, poses, coms)
    traced = tuple(_traced(model, bodies.names, numbers))
    held = _held(model, bodies.names, numbers, anchors)
    for _, at in traced:
        held[at.body + 1].append(np.array(at.at))
    joined = bonds(system, loose, len(model.bodies), q, p)
    held[0] += [*joined.ends, *([np.zeros(3)] if loose else [])]
    for k in range(len(model.bodies), len(bodies.names)):
        held[k + 1].append(np.zeros(3))
    for x in bodies.dials:
        held[bodies.names.index(x.label) + 1] += [np.eye(3)[0]] if x.turns else []
    points = tuple(tuple(some) for some in held)
    reached = dict(spans or {}) | {x.name: (0.0, 0.0) for x in bodies.dials}
    return Scene(
        system, numbers, bodies.names, poses, tuple(anchors), points, view, traced, reached,
        bonds=joined, loose=loose, dials=bodies.dials,
    )  # fmt: skip


def _dial(bodies: Bodies, dial: Dial) -> Anchor:
    """A pivot or a guide on the ground that shows a coordinate."""
    index = bodies.names.index(dial.label)
    at = (np.array([dial.centre, 0.0, 0.0]), np.zeros(3))
    kind = "revolute" if dial.turns else "prismatic"
    axis = np.eye(3)[2 if dial.turns else 0]
    frames = (np.eye(3), np.eye(3))
    return Anchor(dial.name, kind, (GROUND, index), at, (axis, axis), frames, (dial.name,))


def _anchors(model: Model, names: Sequence[str], numbers: Numbers) -> list[Anchor]:
    """Joints but fixed ones, then closures."""
    known = {GROUND_NAME: GROUND} | {name: k for k, name in enumerate(names)}
    anchors = []
    for x in model.joints:
        sides = (known[x.parent], known[x.child])
        anchor = _anchor(numbers, x, sides, (x.at_parent, x.at_child))
        coordinates = tuple(x.coordinates)
        anchors.append(replace(anchor, coordinates=coordinates, orientation=x.orientation))
    for x in model.closures:
        first, second = (known[name] for name in x.bodies)
        anchors.append(_anchor(numbers, x, (first, second), x.placements))
    return anchors


def _anchor(
    numbers: Numbers, x: Joint | Closure, sides: tuple[int, int], at: tuple[Placement, Placement]
) -> Anchor:
    first, second = (_frame(numbers, placement) for placement in at)
    axis = _unit(numbers.vector(x.axis))
    return Anchor(
        name=x.name,
        type=x.type,
        bodies=sides,
        points=(numbers.vector(at[0].position), numbers.vector(at[1].position)),
        axes=(first @ axis, second @ axis),
        frames=(first, second),
        axis2=None if x.axis2 is None else second @ _unit(numbers.vector(x.axis2)),
    )


def _frame(numbers: Numbers, at: Placement) -> Vector:
    if at.rotation is None:
        return np.eye(3)
    return np.array([numbers.vector(row) for row in at.rotation])


def _unit(axis: Vector) -> Vector:
    length = float(np.linalg.norm(axis))
    return axis / length if length > 0 else np.array([0.0, 0.0, 1.0])


def _held(
    model: Model, names: Sequence[str], numbers: Numbers, anchors: Sequence[Anchor]
) -> list[list[Vector]]:
    """Points per body, the ground first."""
    held: list[list[Vector]] = [[] for _ in range(len(names) + 1)]
    for anchor in anchors:
        for side, body in enumerate(anchor.bodies):
            if anchor.type not in LOOSE:
                held[body + 1].append(anchor.at(side))
    known = {GROUND_NAME: 0} | {name: k for k, name in enumerate(names, 1)}
    for x in (*model.constraints, *model.loads, *paths(model)):
        for body, point in _points(x):
            held[known[body]].append(numbers.vector(point))
    return held


def paths(model: Model) -> list[Path]:
    """Of the model and of its tensions, each once."""
    named = {path.name: path for path in model.paths}
    return list(
        (named | {x.path.name: x.path for x in model.loads if isinstance(x, Tension)}).values()
    )


def _points(x: object) -> list[tuple[str, Sequence[Expression]]]:
    """Of a constraint, a load or a path: bodies and the points where it takes hold."""
    match x:
        case Rolling():
            return [(x.body, x.centre)]
        case NoSlip() | OnSurface() | Force():
            return [(x.body, x.point)]
        case Distance() | PointSpring():
            return list(zip(x.bodies, x.points))
        case Path():
            return [(way.body, way.point) for way in x.points]
        case Contact():
            return [(x.body, x.centre)]
        case Bushing():
            return [(body, at.position) for body, at in zip(x.bodies, x.placements)]
        case _:
            return []


def _traced(model: Model, names: Sequence[str], numbers: Numbers) -> list[tuple[str, Spot]]:
    """Outputs that are the position of a point of a body."""
    spots = []
    for output in model.outputs:
        formula = output.expression
        if not (isinstance(formula, Call) and formula.function == "position"):
            continue
        body, *point = formula.arguments
        entries = point[0].entries if point and isinstance(point[0], Entries) else None
        at = np.zeros(3) if entries is None else numbers.vector(entries)
        if isinstance(body, Name) and body.name in names and len(at) == 3:
            spots.append((output.name, spot(names.index(body.name), at)))
    return spots
