"""Constraints, the language half: one file each, one line each in CONSTRAINTS.

The other half, the rows of the record that a file here makes, is one file in
derive/mechanics/constraints.
"""

from derive.model.constraints.coupling import COUPLING, GEAR
from derive.model.constraints.distance import DISTANCE
from derive.model.constraints.holonomic import HOLONOMIC
from derive.model.constraints.no_slip import NO_SLIP
from derive.model.constraints.nonholonomic import NONHOLONOMIC
from derive.model.constraints.point_on_surface import POINT_ON_SURFACE
from derive.model.constraints.prescribed import PRESCRIBED
from derive.model.constraints.rolling import ROLLING
from derive.model.language.kind import Kind
from derive.model.records import Constraint

CONSTRAINTS: tuple[Kind[Constraint], ...] = (
    HOLONOMIC,
    NONHOLONOMIC,
    NO_SLIP,
    ROLLING,
    DISTANCE,
    POINT_ON_SURFACE,
    GEAR,
    COUPLING,
    PRESCRIBED,
)
