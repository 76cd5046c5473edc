"""The rungs of the ladder, by subject; each is one function of the evidence and one line in RUNGS."""

from hamel.verify.checks import agreement, algebra, code, identities, inverse
from hamel.verify.checks.rung import Rung

RUNGS: tuple[Rung, ...] = (*agreement.RUNGS, *algebra.RUNGS, *identities.RUNGS, *inverse.RUNGS, *code.RUNGS)
QUICK = (*agreement.RUNGS, code.RUNGS[0])  # all that a build waits for: the reference on every term, and the loaded module
