"""Constraint rows about the axes of a link, where these are not the ground's."""

from __future__ import annotations

import pytest

from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

SLIDER = """
model: slider
plane: {plane}
bodies: {{a: {{mass: 1 kg, inertia: 0.1}}, b: {{mass: 1 kg, inertia: 0.1}}, c: {{mass: 1 kg}}}}
joints:
  A: {{type: revolute, parent: ground, child: a, coordinate: q}}
  B: {{type: revolute, parent: a, child: b, at: [0.3, 0], coordinate: r}}
  S: {{type: prismatic, parent: ground, child: c, axis: [0.6, 0.8], coordinate: s}}
closures: {{C: {{type: revolute, between: [b, c], at: [[0.9, 0], [0, 0]]}}}}
initial: {{guess: {{q: 0.5, r: -0.7, s: 1}}}}
"""
WELDED = """
model: welded
plane: xy
bodies: {a: {mass: 1 kg, inertia: 0.1}, b: {mass: 1 kg, inertia: 0.1}}
joints:
  A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: q}
  B: {type: prismatic, parent: ground, child: b, axis: [0.6, 0.8], coordinate: r}
closures: {C: {type: fixed, between: [b, ground], at: [[0.1, 0.2], [0.4, 0.6]]}}
initial: {guess: {r: 0.5 m}}
"""
MODELS = {plane: SLIDER.format(plane=plane) for plane in ("xy", "xz", "yz")} | {"welded": WELDED}


@pytest.mark.parametrize("name", MODELS)
def test_a_slide_across_the_axes_of_the_plane_closes_a_loop(name: str) -> None:
    """The slide is the third axis of its link, and the normal of the plane another one."""
    mechanics = system(load_text(MODELS[name]))
    seen = evidence(reference(mechanics.model), equations(mechanics), None, 4)
    assert [check.name for check in results(seen, QUICK) if not check.passed] == []
