"""Robot files: how a URDF or MJCF file is named, and how it is to be read.

Importing this costs nothing; `derive.robots.reading` makes models of the files.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

ROBOTS = (".urdf", ".xml", ".mjcf", ".xacro")
UNREAD = (".sdf", ".world")


@dataclass(frozen=True)
class RobotFile:
    """A URDF or MJCF file and how it is read; stands wherever the path of a file does.

    `floating`: the root link moves freely. `exact`: angles are taken to the last digit, else 1.5708
    is read as a right angle. `include`: folders that MJCF files may include from, beside their own.
    `unphysical`: an inertia that no body can have is taken as it is, else refused. `parameters`:
    "inertial" makes masses, centres of mass and inertias parameters, and adds a payload;
    "barycentric" masses, first moments and inertias about the origin.
    """

    path: str | PathLike[str]
    floating: bool = False
    exact: bool = False
    include: tuple[str, ...] = ()
    unphysical: bool = False
    parameters: str = ""

    def __fspath__(self) -> str:
        return str(self.path)

    __str__ = __fspath__


def Floating(path: str | PathLike[str]) -> RobotFile:
    """A robot file taken with its root link moving freely."""
    return RobotFile(path, floating=True)


File = str | PathLike[str]  # the path of a file, or RobotFile
