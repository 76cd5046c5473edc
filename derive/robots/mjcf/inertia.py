"""Mass, centre of mass and inertia of an MJCF body: from its <inertial>, or from its geoms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.diagnostics import counted
from derive.robots.limits import ROUNDING
from derive.robots.markup import Element
from derive.robots.mjcf.meshes import HINT, solid_of
from derive.robots.mjcf.settings import Settings, along_z, orientation
from derive.robots.numbers import listing, scalar, vector
from derive.robots.robot import Body, Reading
from derive.robots.rotations import (
    IDENTITY,
    ORIGIN,
    Matrix,
    Vector,
    minus,
    plus,
    product,
    rotated,
    times,
    turned_tensor,
)

WATER = 1000.0  # kg/m³, the density of a geom that says nothing
SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
WITHOUT_MASS = ("plane", "hfield")


@dataclass(frozen=True)
class Frame:
    """Pose of a frame in a body: point and orientation."""

    at: Vector = ORIGIN
    turn: Matrix = IDENTITY

    def then(self, at: Vector, turn: Matrix) -> Frame:
        """A frame placed in this one."""
        return Frame(plus(self.at, rotated(self.turn, at)), product(self.turn, turn))


@dataclass(frozen=True)
class Piece:
    mass: float
    com: Vector
    tensor: tuple[float, ...]  # about its centre of mass, in the body's axes


def explicit(reading: Reading, inertial: Element, frame: Frame, found: Settings) -> Piece:
    """What an <inertial> says."""
    if "mass" not in inertial.attributes or "pos" not in inertial.attributes:
        missing = "mass" if "mass" not in inertial.attributes else "pos"
        reading.report(inertial, f"an inertial without '{missing}'", f'<inertial {missing}="…">')
    mass = scalar(reading, inertial, "mass")
    if mass < 0.0:
        reading.report(inertial, f"the mass is {mass:g} kg", "zero or more", attribute="mass")
    full = listing(reading, inertial, "fullinertia", 6)
    diagonal = listing(reading, inertial, "diaginertia", 3)
    tensor = full or [*(diagonal or (0.0, 0.0, 0.0)), 0.0, 0.0, 0.0]
    own = frame.then(vector(reading, inertial, "pos"), orientation(reading, inertial, found))
    return Piece(mass, own.at, turned_tensor(own.turn, tensor))


def of_geom(reading: Reading, geom: Element, frame: Frame, found: Settings) -> Piece | None:
    """The piece a geom is; None where it has no mass."""
    low, high = found.groups
    kind = geom.get("type", "mesh" if "mesh" in geom.attributes else "sphere")
    given = scalar(reading, geom, "mass", -1.0)
    density = scalar(reading, geom, "density", WATER)
    weightless = given == 0.0 if given >= 0.0 else density == 0.0
    if not low <= scalar(reading, geom, "group") <= high or weightless or kind in WITHOUT_MASS:
        return None
    if kind == "mesh" and "mesh" in geom.attributes:
        return _enclosed(reading, geom, given, density, frame, found)
    if kind not in SIZES or "mesh" in geom.attributes:
        reading.report(
            geom,
            f"the mass of a {kind if 'mesh' not in geom.attributes else 'mesh'} geom",
            ", ".join(SIZES),
            HINT,
            "type",
        )
        return None
    if geom.get("shellinertia", "false") == "true":
        reading.report(
            geom,
            "the inertia of a shell",
            "solid geoms, or an <inertial>",
            attribute="shellinertia",
        )
    return _solid(reading, geom, kind, given, density, frame, found)


def _enclosed(
    reading: Reading, geom: Element, given: float, density: float, frame: Frame, found: Settings
) -> Piece | None:
    """What a mesh encloses; None after reporting."""
    solid = solid_of(reading, geom, found)
    if solid is None:
        return None
    own = frame.then(vector(reading, geom, "pos"), orientation(reading, geom, found))
    mass = given if given >= 0.0 else density * solid.volume
    tensor = [mass / solid.volume * moment for moment in solid.tensor]
    com = plus(own.at, rotated(own.turn, solid.centre))
    return Piece(mass, com, turned_tensor(own.turn, tensor))


def _solid(
    reading: Reading,
    geom: Element,
    kind: str,
    given: float,
    density: float,
    frame: Frame,
    found: Settings,
) -> Piece | None:
    at, turn, size = _placed(reading, geom, kind, found)
    if size is None:
        return None
    volume, moments = _SOLIDS[kind](size)
    mass = given if given >= 0.0 else density * volume
    own = frame.then(at, turn)
    tensor = [mass * moment for moment in moments] + [0.0, 0.0, 0.0]
    return Piece(mass, own.at, turned_tensor(own.turn, tensor))


def _placed(
    reading: Reading, geom: Element, kind: str, found: Settings
) -> tuple[Vector, Matrix, list[float] | None]:
    """Centre, orientation and half sizes; `fromto` gives the ends of the long axis."""
    size = listing(reading, geom, "size")
    ends = listing(reading, geom, "fromto", 6) if kind != "sphere" else None
    unread = (size is None, ends is None and kind != "sphere")
    if any(n and name in geom.attributes for n, name in zip(unread, ("size", "fromto"))):
        return ORIGIN, IDENTITY, None  # reported
    size = size or []
    if ends:
        along = minus(ends[3:], ends[:3])
        turn = along_z(along)
        if turn is None:
            reading.report(geom, "a geom of length zero", "two different ends", attribute="fromto")
        half = math.hypot(*along) / 2.0
        across = size[:1] if SIZES[kind] == 2 else [*size[:1], *size[:1]]
        at, size = times(0.5, plus(ends[:3], ends[3:])), [*across, half]
    else:
        at, turn = vector(reading, geom, "pos"), orientation(reading, geom, found)
    if len(size) < SIZES[kind] or min(size[: SIZES[kind]], default=0.0) <= 0.0:
        own = len(geom.get("size").split())
        needed = 1 if ends else SIZES[kind]
        problem = f"a {kind} with a size of zero"
        if len(size) < SIZES[kind]:
            problem = f"the size of a {kind} has {counted(own, 'number')}"
            problem = problem if own else f"a {kind} without a size"
        expected = f"a size of {counted(needed, 'number')}, more than zero"
        reading.report(geom, problem, expected, attribute="size")
        return at, turn or IDENTITY, None
    return at, turn or IDENTITY, size[: SIZES[kind]]


def _sphere(size: Sequence[float]) -> tuple[float, Vector]:
    (r,) = size
    moment = 0.4 * r * r
    return 4.0 / 3.0 * math.pi * r**3, (moment, moment, moment)


def _cylinder(size: Sequence[float]) -> tuple[float, Vector]:
    r, half = size
    across = (3.0 * r * r + 4.0 * half * half) / 12.0
    return 2.0 * math.pi * r * r * half, (across, across, 0.5 * r * r)


def _capsule(size: Sequence[float]) -> tuple[float, Vector]:
    """A cylinder and two half balls, whose centres of mass are 3/8 r above their discs."""
    r, half = size
    tube, (across, _, along) = _cylinder(size)
    ball = 4.0 / 3.0 * math.pi * r**3
    ends = 0.4 * r * r + half * half + 0.75 * half * r
    volume = tube + ball
    return volume, (
        (tube * across + ball * ends) / volume,
        (tube * across + ball * ends) / volume,
        (tube * along + ball * 0.4 * r * r) / volume,
    )


def _box(size: Sequence[float]) -> tuple[float, Vector]:
    a, b, c = (x * x for x in size)
    return 8.0 * math.prod(size), ((b + c) / 3.0, (a + c) / 3.0, (a + b) / 3.0)


def _ellipsoid(size: Sequence[float]) -> tuple[float, Vector]:
    a, b, c = (x * x for x in size)
    return 4.0 / 3.0 * math.pi * math.prod(size), ((b + c) / 5.0, (a + c) / 5.0, (a + b) / 5.0)


# half sizes → volume, and moments of inertia per mass
_SOLIDS = {
    "sphere": _sphere,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "box": _box,
    "ellipsoid": _ellipsoid,
}


def together(pieces: Sequence[Piece]) -> Piece:
    """One rigid piece of several: parallel axes."""
    if len(pieces) == 1:
        return pieces[0]
    mass = sum(piece.mass for piece in pieces)
    com = (
        times(1.0 / mass, [sum(piece.mass * piece.com[k] for piece in pieces) for k in range(3)])
        if mass
        else ORIGIN
    )
    tensor = [0.0] * 6
    for piece in pieces:
        x, y, z = minus(piece.com, com)
        shift = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
        tensor = [
            total + own + piece.mass * s for total, own, s in zip(tensor, piece.tensor, shift)
        ]
    return Piece(mass, com, tuple(tensor))


def fill(body: Body, piece: Piece, found: Settings) -> None:
    """Mass properties of a body, not below the bounds of <compiler>."""
    body.mass, body.com = piece.mass, piece.com
    body.inertia = piece.tensor if any(piece.tensor) else ()
    if found.least_mass and body.mass < found.least_mass:
        body.mass = found.least_mass
    if found.least_inertia:
        body.inertia = _bounded(body.inertia or (0.0,) * 6, found.least_inertia)


def _bounded(tensor: Sequence[float], least: float) -> tuple[float, ...]:
    """With principal moments of at least that."""
    xx, yy, zz, xy, xz, yz = tensor
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments[0] >= least:
        return tuple(tensor)
    bounded = (axes * np.maximum(moments, least)) @ axes.T
    full = np.where(np.abs(bounded) < ROUNDING * moments[2], 0.0, bounded)
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return tuple(float(full[place]) for place in places)
