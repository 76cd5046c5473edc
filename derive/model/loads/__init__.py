"""Loads, the language half: one file each, one line each in LOADS.

The other half, the force or energy of the record that a file here makes, is one file in
derive/mechanics/loads.
"""

from derive.model.language.kind import Kind
from derive.model.loads.armature import ARMATURE
from derive.model.loads.bushing import BUSHING
from derive.model.loads.contact import CONTACT
from derive.model.loads.damper import DAMPER
from derive.model.loads.expression import EXPRESSION
from derive.model.loads.force import FORCE
from derive.model.loads.friction import FRICTION
from derive.model.loads.spring import SPRING
from derive.model.loads.tension import TENSION
from derive.model.loads.torque import TORQUE
from derive.model.loads.wrench import WRENCH
from derive.model.records import Load

LOADS: tuple[Kind[Load | None], ...] = (
    SPRING,
    DAMPER,
    FORCE,
    TORQUE,
    EXPRESSION,
    BUSHING,
    FRICTION,
    ARMATURE,
    WRENCH,
    TENSION,
    CONTACT,
)
