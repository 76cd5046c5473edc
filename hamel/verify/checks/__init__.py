"""The checks of the suite, by subject; each is one function of the evidence and one line in
CHECKS."""

from hamel.verify.checks import (
    agreement,
    algebra,
    charts,
    code,
    configuration,
    engines,
    identities,
    inverse,
    kinks,
    linear,
    manifold,
    momenta,
    motion,
    named_frames,
    quasi,
    regressor,
    steps,
    strange,
    udwadia,
)
from hamel.verify.checks.check import Check

CHECKS: tuple[Check, ...] = (
    *agreement.CHECKS,
    *udwadia.CHECKS,
    *algebra.CHECKS,
    *identities.CHECKS,
    *inverse.CHECKS,
    *configuration.CHECKS,
    *manifold.CHECKS,
    *kinks.CHECKS,
    *linear.CHECKS,
    *named_frames.CHECKS,
    *quasi.CHECKS,
    *regressor.CHECKS,
    *code.CHECKS,
    *charts.CHECKS,
    *steps.CHECKS,
    *strange.CHECKS,
    *motion.CHECKS,
    *momenta.CHECKS,
    *engines.CHECKS,
)
QUICK = (
    *agreement.CHECKS,
    *manifold.CHECKS,
    *kinks.CHECKS,
    *linear.CHECKS,
    *named_frames.CHECKS,
    *quasi.CHECKS,
    *regressor.CHECKS,
)  # every term against the reference, what keeps to it, and what was derived from ẋ on request
# the loaded module against the graph
LOADED = (*code.CHECKS[:1], *charts.CHECKS, *steps.CHECKS)
