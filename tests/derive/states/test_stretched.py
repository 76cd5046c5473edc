"""Mechanisms that fit together at singular positions alone.

Of derive.choices: survey.
"""

from __future__ import annotations

import pytest

from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError
from derive.model import load_text
from derive.states import system

# Peaucellier's inversor: with 2 c = L − s it closes with its rhombus folded alone.
INVERSOR = """
model: inversor
plane: xy
parameters: {L: 0.5 m, s: 0.2 m, c: CRANK m}
bodies:
  crank: {mass: 1 kg, inertia: 0.01}
  la: {mass: 1 kg, inertia: 0.01}
  lb: {mass: 1 kg, inertia: 0.01}
  pa: {mass: 1 kg, inertia: 0.01}
  pb: {mass: 1 kg, inertia: 0.01}
  ra: {mass: 1 kg, inertia: 0.01}
  rb: {mass: 1 kg, inertia: 0.01}
joints:
  A: {type: revolute, parent: ground, child: la, coordinate: a}
  B: {type: revolute, parent: ground, child: lb, coordinate: b}
  C: {type: revolute, parent: ground, child: crank, at: [c, 0], coordinate: q}
  PA: {type: revolute, parent: la, child: pa, at: [L, 0], coordinate: p1}
  PB: {type: revolute, parent: lb, child: pb, at: [L, 0], coordinate: p2}
  RA: {type: revolute, parent: la, child: ra, at: [L, 0], coordinate: r1}
  RB: {type: revolute, parent: lb, child: rb, at: [L, 0], coordinate: r2}
closures:
  X: {type: revolute, between: [pa, pb], at: [[s, 0], [s, 0]]}
  Y: {type: revolute, between: [ra, crank], at: [[s, 0], [c, 0]]}
  Z: {type: revolute, between: [rb, crank], at: [[s, 0], [c, 0]]}
initial: {q: 20 deg, guess: {a: 32 deg, b: -12 deg, p1: -67 deg, p2: 67 deg, r1: -150 deg, r2: 150 deg}}
"""


def test_what_fits_folded_alone_is_refused() -> None:
    """It was said to be well, and its module was not finite."""
    with pytest.raises(AssumptionError, match="fits together at singular positions alone"):
        survey_of(system(load_text(INVERSOR.replace("CRANK", "0.15"))))


@pytest.mark.parametrize("crank", ["0.16", "0.2"])
def test_what_has_some_play_is_not(crank: str) -> None:
    assert survey_of(system(load_text(INVERSOR.replace("CRANK", crank)))).rank == 6
