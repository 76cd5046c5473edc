"""Roads from the shared first half of a derivation to the same final equations: one table."""

from __future__ import annotations

from derive.textbook.roads.block_inversion import BLOCK_INVERSION, MAGGI
from derive.textbook.roads.boltzmann_hamel import BOLTZMANN_HAMEL
from derive.textbook.roads.kane import GIBBS_APPELL, KANE
from derive.textbook.roads.multipliers import LAGRANGE, UDWADIA_KALABA
from derive.textbook.roads.records import Road

ROADS: tuple[Road, ...] = (
    BLOCK_INVERSION,
    MAGGI,
    KANE,
    BOLTZMANN_HAMEL,
    GIBBS_APPELL,
    LAGRANGE,
    UDWADIA_KALABA,
)

__all__ = ["ROADS", "Road"]
