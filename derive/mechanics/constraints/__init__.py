"""Constraints as positions φ and velocity rows: one file each, one line each in TIES.

The language half of a constraint is one file in derive/model/constraints; couplings, gears and
prescribed motions are formulas to the mechanics.
"""

from derive.mechanics.constraints.distance import DISTANCE
from derive.mechanics.constraints.holonomic import HOLONOMIC
from derive.mechanics.constraints.no_slip import NO_SLIP
from derive.mechanics.constraints.nonholonomic import NONHOLONOMIC
from derive.mechanics.constraints.point_on_surface import POINT_ON_SURFACE
from derive.mechanics.constraints.records import Tie
from derive.mechanics.constraints.rolling import ROLLING

__all__ = ["TIES", "TIE_OF", "Tie"]

TIES = (HOLONOMIC, NONHOLONOMIC, NO_SLIP, ROLLING, DISTANCE, POINT_ON_SURFACE)
TIE_OF = {tie.record: tie.block for tie in TIES}
