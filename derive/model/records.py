"""The Model record: what a model file says, with names resolved, units in SI and source spans kept.

Everything is embedded in space: a planar model stores points as (a, b) placed on its two axes, its
rotation axis, and one moment of inertia; `plane` says so. Formulas stay expression trees
(derive.expressions.tree); parameters stay parameters here. Placements say where a joint frame sits
in a body: `position` in body coordinates, `rotation` body ← joint frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

from derive.diagnostics import Diagnostic
from derive.expressions.tables import Table
from derive.expressions.tree import ONE, ZERO, Expression

Vector3 = tuple[Expression, Expression, Expression]
GROUND = "ground"
CHOICE_KINDS = (
    "auto",
    "orthonormal",
    "frozen",
    "mass_orthogonal",
)  # of quasi-velocities, besides rows


@dataclass(frozen=True)
class Span:
    """Where in the file (1-based line and column; `length` characters from there).

    `file`: 0 is the model's own, k the k-th of its `sources`. `where`: of what stands for several,
    which one this is ("i = 3", "left, used at robot.yaml:12:3").
    """

    line: int
    column: int
    length: int = 1
    file: int = 0
    where: str = ""


@dataclass(frozen=True)
class Parameter:
    name: str
    value: float
    unit: str
    about: str
    span: Span


@dataclass(frozen=True)
class Coordinate:
    """`owner` is the joint it belongs to, or "" for a coordinate of the analytic form; `about` is
    for readers."""

    name: str
    unit: str
    owner: str
    span: Span


@dataclass(frozen=True)
class Velocity:
    """A generalized velocity: `der(q1)` where it is the rate of a coordinate (`rate_of`), else
    `joint.vx`, `joint.w` …"""

    name: str
    unit: str
    owner: str
    rate_of: str
    span: Span


@dataclass(frozen=True)
class Placement:
    position: Vector3
    rotation: tuple[Vector3, Vector3, Vector3] | None  # rows; None is the identity


@dataclass(frozen=True)
class NamedFrame:
    """A frame fixed to a body, that functions and loads can be asked for by name: a tool, a camera,
    a body's own frame, or a joint's on its child."""

    name: str
    body: str
    at: Placement


@dataclass(frozen=True)
class Waypoint:
    """A point of a body that a path goes through or, with a radius, the centre of a pulley that it
    goes round. `side` is 1 where the path turns counter-clockwise about `axis` (body frame; the
    normal of a planar model), −1 where clockwise; `turns` are whole turns besides."""

    body: str
    point: Vector3
    radius: Expression
    side: int
    axis: Vector3
    turns: int


@dataclass(frozen=True)
class Path:
    """The shortest way through its points and round its pulleys, without friction."""

    name: str
    points: tuple[Waypoint, ...]
    span: Span


@dataclass(frozen=True)
class Measure:
    """One number of the kinematics that formulas use by `name`: of a body or frame `frame`, seen
    from `relative` and along its axes.

    `quantity` is "position" of `point` (m, own axes) or its rate "velocity"; "orientation", the
    entry (row, column) of relative ← frame, or its rate "turning"; "angular_velocity", about the
    normal in a planar model; "angle" of a planar one; "length" of the path `frame` and its rate
    "lengthening". Accelerations are the rates of these rates: "acceleration", "second_turning",
    "angular_acceleration", "second_lengthening", and "speeding" of the rate of the coordinate
    `frame`, or of the generalized velocity of that name. `component`: which entry.
    """

    name: str
    quantity: str
    frame: str
    point: Vector3
    relative: str
    component: tuple[int, ...]


@dataclass(frozen=True)
class Body:
    """Mass (kg), centre of mass (m, body frame), inertia (kg m², entries xx, yy, zz, xy, xz, yz
    about the centre of mass).

    `first_moment` (kg m) and `about_origin` (kg m², the same entries) where the file gives these:
    they are then what equations are made of, and the others follow. `possible`: false where the
    file waives that a body can have such an inertia, and none can.
    """

    name: str
    mass: Expression
    com: Vector3
    inertia: tuple[Expression, Expression, Expression, Expression, Expression, Expression]
    span: Span
    first_moment: Vector3 | None = None
    about_origin: tuple[Expression, ...] | None = None
    about: str = ""  # what the file says of it
    possible: bool = True


@dataclass(frozen=True)
class Joint:
    """`orientation` is "" or, for a free or ball joint, "quaternion" or an Euler sequence such as
    "zxy" (intrinsic).

    `pitch` (m per turn) is a screw's; `axis2` a universal joint's second axis, at right angles to
    `axis`; `limits` of the first coordinate are for readers, no force comes of them.
    """

    name: str
    type: str
    parent: str
    child: str
    at_parent: Placement
    at_child: Placement
    axis: Vector3
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    orientation: str
    span: Span
    pitch: Expression = ZERO
    axis2: Vector3 | None = None
    limits: tuple[Expression, Expression] | None = None


@dataclass(frozen=True)
class Closure:
    """A joint that closes a loop; the first body is the joint's parent, `pitch` and `axis2` are as
    with joints.

    `along` says along whose axes points that meet are measured, and across whose an axis or shift:
    0 and 1 are the joint frames on the two bodies, 2 to 4 the frame of the body `seen_from`, whose
    axes but the first, second or third turns and shifts across the joint's axis are measured about.
    The ground's and the first one's, unless these say what others do not.
    """

    name: str
    type: str
    bodies: tuple[str, str]
    placements: tuple[Placement, Placement]
    axis: Vector3
    span: Span
    axis2: Vector3 | None = None
    pitch: Expression = ZERO
    along: int = -1
    seen_from: str = GROUND


class Constraint(Protocol):
    """The record of any constraint: those of this file, and of whoever adds one."""

    @property
    def name(self) -> str: ...

    @property
    def span(self) -> Span: ...


class Load(Protocol):
    """The record of any load: those of this file, and of whoever adds one."""

    @property
    def name(self) -> str: ...

    @property
    def span(self) -> Span: ...


@dataclass(frozen=True)
class Input:
    """An actuator: adds gear · itself to the force conjugate to `velocity`; "" when it only occurs
    in expressions."""

    name: str
    velocity: str
    unit: str
    about: str
    span: Span
    gear: Expression = ONE
    table: str = ""  # over time, that it follows


@dataclass(frozen=True)
class FirstOrderState:
    """A number that follows a first-order equation of its own, ż = `rate`: a current, a pressure,
    an activation. `initial` is of parameters; `energy` (J), of parameters and states, is what it
    stores."""

    name: str
    rate: Expression
    initial: Expression
    energy: Expression | None
    unit: str
    about: str
    span: Span


@dataclass(frozen=True)
class Output:
    """`expression` is a scalar, a Vector of scalars, or a Call of position/velocity/angle/reaction
    with the body or constraint as a Name."""

    name: str
    expression: Expression
    text: str
    unit: str
    span: Span


@dataclass(frozen=True)
class Event:
    """Where `expression`, a formula of the motion and of outputs, changes its sign: upwards where
    `direction` is 1, downwards where it is −1, either way where it is 0. `stop`: the motion ends
    there."""

    name: str
    expression: Expression
    text: str
    direction: int
    stop: bool
    span: Span


@dataclass(frozen=True)
class Choice:
    """One choice of quasi-velocities. `kind` is "rows" (linear in the velocities), or a kind of its
    own without rows."""

    name: str
    kind: str
    rows: tuple[tuple[str, Expression], ...]
    span: Span


@dataclass(frozen=True)
class Speed:
    """A declared quasi-velocity that is held or guessed by name: NAME, or CHOICE.NAME."""

    name: str
    formula: Expression
    unit: str


@dataclass(frozen=True)
class InitialValue:
    """A coordinate, generalized velocity or declared quasi-velocity at t = 0. `held` values are
    kept when the state is made consistent, guesses move."""

    name: str
    value: Expression
    held: bool
    span: Span


@dataclass(frozen=True)
class SteadyMotion:
    """What is held along a steady motion: coordinate, velocity or input name → expression of
    parameters and sweepable names.

    Inputs that are not named are zero, `free` ones are found. `guesses` are where the search for
    the rest starts; `cyclic` coordinates, where given, are the ones to leave out; `ranges`:
    sweepable name or parameter → first, last and how many values. Names may be those of declared
    quasi-velocities.
    """

    name: str
    values: tuple[tuple[str, Expression], ...]
    sweepable: tuple[str, ...]
    span: Span
    free: tuple[str, ...] = ()
    guesses: tuple[tuple[str, Expression], ...] = ()
    cyclic: tuple[str, ...] | None = None
    ranges: tuple[tuple[str, float, float, int], ...] = ()


@dataclass(frozen=True)
class Published:
    """Values quoted from elsewhere: `time` (s) after the initial state; name → value with a
    relative tolerance.

    Names are those of coordinates, velocities, `der(velocity)`, outputs (`tip[0]`), T and V.
    """

    name: str
    source: str
    time: float
    tolerance: float
    values: tuple[tuple[str, Expression], ...]
    span: Span


@dataclass(frozen=True)
class Extreme:
    """An extreme case: `values` set, then a motion of `time` seconds; `end` in closed form where
    there is one.

    `tolerance` None: the error is only reported. `refused`: words of the message that is expected
    instead of a motion. `spoiled`: no motion, but numbers that are none, infinite or next to
    nothing in every argument of every function.
    """

    name: str
    about: str
    values: tuple[tuple[str, str], ...]
    time: float
    spoiled: bool
    integrator: str
    enforcement: str
    real: str
    choice: str
    rtol: float
    tolerance: float | None
    end: tuple[tuple[str, Expression], ...]
    refused: str
    span: Span


@dataclass(frozen=True)
class Model:
    name: str
    description: str
    file: str
    text: str
    plane: str  # "xy", "xz", "yz", or "" in space
    gravity: Vector3 | None
    parameters: tuple[Parameter, ...]
    coordinates: tuple[Coordinate, ...]  # in the order of q
    velocities: tuple[Velocity, ...]  # in the order of v
    definitions: tuple[tuple[str, Expression], ...]  # `where:`, each may use the earlier ones
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]  # parents before children
    closures: tuple[Closure, ...]
    constraints: tuple[Constraint, ...]
    loads: tuple[Load, ...]
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    choices: tuple[Choice, ...]  # never empty: at least one of kind "auto"
    initial: tuple[InitialValue, ...]
    steady_motions: tuple[SteadyMotion, ...]
    kinetic: Expression | None
    potential: Expression | None
    published: tuple[Published, ...] = ()
    extremes: tuple[Extreme, ...] = ()
    events: tuple[Event, ...] = ()
    frames: tuple[NamedFrame, ...] = ()  # those of `frames:`; bodies and joints have theirs
    symbols: tuple[tuple[str, str], ...] = ()  # of parameters and coordinates, as LaTeX
    body_symbols: tuple[tuple[str, str], ...] = ()
    measures: tuple[Measure, ...] = ()  # kinematics that formulas use
    accelerations: tuple[Measure, ...] = ()  # the same of outputs, which depend on v̇
    paths: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()  # what is taken otherwise than a reader might expect
    tables: tuple[Table, ...] = ()
    states: tuple[FirstOrderState, ...] = ()  # in the order of z
    speeds: tuple[Speed, ...] = ()  # declared quasi-velocities by the names that stand for one
    sources: tuple[tuple[str, str], ...] = ()  # name and text of the files it refers to
    origins: tuple[Diagnostic, ...] = ()  # of each line of the text, where it was made of a robot
    redundant: str = "drop"  # what becomes of constraint rows that repeat others: "drop" or "keep"
    fixed: tuple[
        tuple[str, float], ...
    ] = ()  # inputs and parameters of the file that are numbers here, in SI units

    def content(self) -> str:
        """All the text that it was read from."""
        return repr((self.text, self.sources))

    def body(self, name: str) -> Body:
        """The body of that name. Raises KeyError where there is none."""
        return self._bodies[name]

    def path(self, name: str) -> Path:
        """The path of that name. Raises KeyError where there is none."""
        return {path.name: path for path in self.paths}[name]

    def coordinate_index(self, name: str) -> int:
        """Which entry of q that coordinate is. Raises ValueError where there is none."""
        return _index(self._coordinates, name)

    def is_taken(self, name: str) -> bool:
        """Whether something that stands beside quasi-velocities has that name: a coordinate, a
        first-order state, a parameter, an input or an output."""
        others = (*self.states, *self.parameters, *self.inputs, *self.outputs)
        return name in self._coordinates or any(item.name == name for item in others)

    def velocity_index(self, name: str) -> int:
        """Which entry of v that generalized velocity is. Raises ValueError where there is none."""
        return _index(self._velocities, name)

    def conjugate_index(self, velocity: str) -> int | None:
        """Which entry of v that is, by the velocity's own name or by der(q) where it is the rate of
        a coordinate; None where it is none of them."""
        return self._conjugates.get(velocity)

    @cached_property
    def _conjugates(self) -> dict[str, int]:
        rates = {f"der({x.rate_of})": i for i, x in enumerate(self.velocities) if x.rate_of}
        return {**rates, **self._velocities}

    @cached_property
    def other_rates(self) -> dict[str, Velocity]:
        """By der(q) the rates of coordinates that are no generalized velocities."""
        return {
            name: Velocity(name, f"{x.unit or '1'}/s", x.owner, x.name, x.span)
            for x in self.coordinates
            if self.conjugate_index(name := f"der({x.name})") is None
        }

    @cached_property
    def _bodies(self) -> dict[str, Body]:
        return {body.name: body for body in self.bodies}

    @cached_property
    def _coordinates(self) -> dict[str, int]:
        return {coordinate.name: i for i, coordinate in enumerate(self.coordinates)}

    @cached_property
    def _velocities(self) -> dict[str, int]:
        return {velocity.name: i for i, velocity in enumerate(self.velocities)}

    def place(self, name: str) -> Span | None:
        """Where the closure or the constraint of that name stands; None where it is neither."""
        return {tie.name: tie.span for tie in (*self.constraints, *self.closures)}.get(name)

    def diagnostic(self, span: Span | None, message: str, expected: str = "") -> Diagnostic:
        """The problem at a place of the file; of the file as a whole where it has no such line."""
        files = ((self.file, self.text), *self.sources)
        file, text = files[span.file if span else 0]
        lines = text.splitlines()
        if span is None or not 0 < span.line <= len(lines):
            return Diagnostic(file=self.file, message=message, expected=expected)
        if self.origins and not span.file:
            origin = self.origins[span.line - 1]
            return replace(origin, message=message, expected=expected, where=span.where)
        return Diagnostic(
            file=file,
            line=span.line,
            column=span.column,
            length=span.length,
            message=message,
            expected=expected,
            source_line=lines[span.line - 1],
            where=span.where,
        )


def _index(places: Mapping[str, int], name: str) -> int:
    if name not in places:
        raise ValueError(f"{name} is not in list")
    return places[name]
