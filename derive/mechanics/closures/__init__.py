"""Joints that close loops: one file each, one line each in CLOSINGS.

Every joint type of derive.joints but the free one has its closure here.
"""

from derive.mechanics.closures.ball import BALL
from derive.mechanics.closures.cylindrical import CYLINDRICAL
from derive.mechanics.closures.fixed import FIXED
from derive.mechanics.closures.planar import PLANAR
from derive.mechanics.closures.prismatic import PRISMATIC
from derive.mechanics.closures.records import Closing
from derive.mechanics.closures.revolute import REVOLUTE
from derive.mechanics.closures.screw import SCREW
from derive.mechanics.closures.universal import UNIVERSAL

__all__ = ["CLOSINGS", "CLOSING_OF", "Closing"]

CLOSINGS = (REVOLUTE, BALL, FIXED, PRISMATIC, CYLINDRICAL, PLANAR, UNIVERSAL, SCREW)
CLOSING_OF = {closing.name: closing.parts for closing in CLOSINGS}
