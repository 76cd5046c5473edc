"""The rungs of the ladder, by subject; each is one function of the evidence and one line in RUNGS."""

from hamel.verify.checks import agreement, algebra, code, identities
from hamel.verify.checks.rung import Rung

RUNGS: tuple[Rung, ...] = (*agreement.RUNGS, *algebra.RUNGS, *identities.RUNGS, *code.RUNGS)
