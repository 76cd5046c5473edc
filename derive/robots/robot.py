"""What the readers make and the writer takes: a robot with names that are legal, SI units, and the
place of everything."""

from __future__ import annotations

from dataclasses import dataclass, field

from derive.diagnostics import Diagnostic, ModelError, did_you_mean, listed
from derive.robots.limits import SMOOTHING
from derive.robots.markup import Element
from derive.robots.naming import PLAIN, SUFFIXES, Names
from derive.robots.rotations import IDENTITY, ORIGIN, Matrix, Vector, from_rpy

GROUND = "ground"
ONE_RATE = ("revolute", "prismatic")
BASE_RATES = {
    "ball": ("wx", "wy", "wz"),
    "free": ("vx", "vy", "vz", "wx", "wy", "wz"),
    "planar": ("vx", "vy", "w"),
}


@dataclass
class Body:
    """Inertia about the centre of mass in the body's frame (xx, yy, zz, xy, xz, yz); no mass at all
    where `mass` is 0. `physical`: whether the inertia has to be that of a body. `first_moment`
    (kg m) stands in the place of the centre of mass, and the inertia is about the origin then.
    `moments`: the element that says the inertia. `symbols`: names of parameters in the place of
    numbers, by `m`, `c_x` or `h_x`, `I_xx`."""

    name: str
    place: Element
    mass: float = 0.0
    com: Vector = ORIGIN
    inertia: tuple[float, ...] = ()
    physical: bool = True
    first_moment: Vector | None = None
    moments: Element | None = None
    symbols: dict[str, str] = field(default_factory=dict[str, str])
    notes: list[str] = field(default_factory=list[str])


@dataclass
class Joint:
    """`rpy` is used where a file gives roll, pitch and yaw, else `rotation`: parent ← joint frame;
    `rotation_child`: the same for the child. `spring`: stiffness and rest. `coulomb`: of dry
    friction, whose jump at rest is `smoothing` wide. `armature`: inertia of the rotor as the joint
    feels it. `follows`: the joint that it mimics, and its speed at that one's unit speed."""

    name: str
    type: str
    parent: str
    child: str
    place: Element
    at: Vector = ORIGIN
    at_child: Vector = ORIGIN
    rpy: Vector | None = None
    rotation: Matrix = IDENTITY
    rotation_child: Matrix = IDENTITY
    axis: Vector | None = None
    limits: tuple[float, float] | None = None
    spring: tuple[float, float] | None = None
    damper: float = 0.0
    coulomb: float = 0.0
    smoothing: float = SMOOTHING
    armature: float = 0.0
    follows: tuple[str, float] | None = None
    notes: list[str] = field(default_factory=list[str])

    def turn(self) -> Matrix:
        """Parent ← joint frame."""
        return self.rotation if self.rpy is None else from_rpy(self.rpy)

    def rates(self) -> tuple[str, ...]:
        """Its generalized velocities, as loads and inputs name them."""
        if self.type in ONE_RATE:
            return (f"der({self.name})",)
        return tuple(f"{self.name}.{rate}" for rate in BASE_RATES.get(self.type, ()))


@dataclass
class Closure:
    name: str
    type: str
    between: tuple[str, str]
    at: tuple[Vector, Vector]
    place: Element
    rotation: Matrix = IDENTITY


@dataclass
class Entry:
    """A line of the model that needs no more than its text: a load, a constraint, an input, an
    initial value."""

    name: str
    text: str
    place: Element
    note: str = ""


@dataclass
class Robot:
    """`changed`, `assumed` and `left_out` are sentences for the head of the file. What is assumed
    differs from the robot as its maker may mean it (friction smoothed, limits without force); what
    is left out acts on the robot and not on the model."""

    name: str
    kind: str
    root: Element
    gravity: Vector = (0.0, 0.0, -9.81)
    bodies: list[Body] = field(default_factory=list[Body])
    joints: list[Joint] = field(default_factory=list[Joint])
    closures: list[Closure] = field(default_factory=list[Closure])
    paths: list[Entry] = field(default_factory=list[Entry])
    constraints: list[Entry] = field(default_factory=list[Entry])
    loads: list[Entry] = field(default_factory=list[Entry])
    inputs: list[Entry] = field(default_factory=list[Entry])
    states: list[Entry] = field(default_factory=list[Entry])
    initial: list[Entry] = field(default_factory=list[Entry])
    frames: list[Entry] = field(default_factory=list[Entry])
    parameters: list[Entry] = field(default_factory=list[Entry])
    names: Names = field(default_factory=Names)  # of joints, inputs and parameters, taken so far
    body_names: Names = field(default_factory=Names)
    changed: list[str] = field(default_factory=list[str])
    assumed: list[str] = field(default_factory=list[str])
    left_out: list[str] = field(default_factory=list[str])


class Reading:
    """A file being read: names, and problems that are collected so that all can be told at once."""

    def __init__(self) -> None:
        self.problems: list[Diagnostic] = []
        self.symbols, self.bodies = Names(), Names()
        self.renamed = 0

    def report(
        self,
        element: Element,
        message: str,
        expected: str = "",
        hint: str = "",
        attribute: str = "",
    ) -> None:
        """Note a problem and go on."""
        self.problems.append(element.diagnostic(message, expected, hint, attribute))

    def finish(self) -> None:
        """Raise what was noted."""
        if self.problems:
            raise ModelError(
                sorted(
                    dict.fromkeys(self.problems), key=lambda problem: (problem.line, problem.column)
                )
            )

    def unknown(self, element: Element, attribute: str, what: str, known: list[str]) -> None:
        """Note a name that nothing has."""
        name = element.get(attribute)
        self.report(
            element, f"unknown {what} '{name}'", listed(known), did_you_mean(name, known), attribute
        )

    def body_name(self, original: str, notes: list[str]) -> str:
        """A legal, unused name for a body; a note tells where it differs from the original."""
        return self._name_with_note(self.bodies(original, "body"), original, notes)

    def joint_name(self, original: str, kind: str, notes: list[str]) -> str:
        """A legal, unused name for a joint. The names that its coordinates and velocities will have
        must be free as well: `kind` tells which those are."""
        suffixes = () if kind == "fixed" else PLAIN if kind in ONE_RATE else SUFFIXES
        return self._name_with_note(self.symbols(original, "joint", suffixes), original, notes)

    def input_name(self, wanted: str, original: str, notes: list[str]) -> str:
        """A legal, unused name for an input; a note tells where it differs from the original."""
        return self._name_with_note(self.symbols(wanted, "input"), original, notes)

    def _name_with_note(self, name: str, original: str, notes: list[str]) -> str:
        if name != original and original:
            self.renamed += 1
            notes.append(f"was {quoted(original)}")
        return name


def quoted(text: str) -> str:
    """A name of the file as a comment can show it, on one line."""
    return repr(text if len(text) <= 80 else text[:79] + "…").replace("\\x", "\\u00")
