"""A joint, or a closure, as its two bodies carry it."""

from __future__ import annotations

from dataclasses import dataclass

from hamel.draw.mechanism.records import Spot, Vector, spot

LOOSE = ("planar", "point", "free")  # joints that hold a body at no point


@dataclass(frozen=True)
class Anchor:
    """Its point and its axis in either body; `coordinates` are empty for closures. The symbol
    stands on the axis, `shift` (m) from the point."""

    name: str
    type: str
    bodies: tuple[int, int]
    points: tuple[Vector, Vector]
    axes: tuple[Vector, Vector]
    frames: tuple[Vector, Vector]  # body ← joint frame
    coordinates: tuple[str, ...] = ()
    orientation: str = ""
    axis2: Vector | None = None  # of a universal joint, in the second body
    shift: float = 0.0

    def at(self, side: int) -> Vector:
        """Where the symbol stands, in one of the bodies."""
        return self.points[side] + self.shift * self.axes[side]

    def spot(self, side: int) -> Spot:
        """The same as a spot."""
        return spot(self.bodies[side], self.at(side))
