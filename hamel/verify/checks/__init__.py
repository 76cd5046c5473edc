"""The rungs of the ladder, by subject; each is one function of the evidence and one line in RUNGS."""

from hamel.verify.checks import (
    agreement,
    algebra,
    charts,
    code,
    configuration,
    engines,
    identities,
    inverse,
    linear,
    momenta,
    motion,
    strange,
    udwadia,
)
from hamel.verify.checks.check import Rung

RUNGS: tuple[Rung, ...] = (
    *agreement.RUNGS,
    *udwadia.RUNGS,
    *algebra.RUNGS,
    *identities.RUNGS,
    *inverse.RUNGS,
    *configuration.RUNGS,
    *linear.RUNGS,
    *code.RUNGS,
    *charts.RUNGS,
    *strange.RUNGS,
    *motion.RUNGS,
    *momenta.RUNGS,
    *engines.RUNGS,
)
QUICK = (*agreement.RUNGS, *linear.RUNGS)  # every term against the reference, and what was derived from ẋ on request
LOADED = (*code.RUNGS[:1], *charts.RUNGS)  # the loaded module against the graph
