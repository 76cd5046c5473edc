"""The rungs of the ladder, by subject; each is one function of the evidence and one line in RUNGS."""

from hamel.verify.checks import agreement, algebra, charts, code, configuration, engines, identities, inverse, motion, strange
from hamel.verify.checks.rung import Rung

RUNGS: tuple[Rung, ...] = (
    *agreement.RUNGS,
    *algebra.RUNGS,
    *identities.RUNGS,
    *inverse.RUNGS,
    *configuration.RUNGS,
    *code.RUNGS,
    *charts.RUNGS,
    *strange.RUNGS,
    *motion.RUNGS,
    *engines.RUNGS,
)
QUICK = agreement.RUNGS  # every term against the reference
LOADED = (*code.RUNGS[:1], *charts.RUNGS)  # the loaded module against the graph
