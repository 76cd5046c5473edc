"""Mechanisms that fit together at singular positions alone.

Of derive.choices: stretched, survey.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hamel
from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError, ModelError
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


RODS = """
model: rods
plane: xy
parameters: {r: 1 m, apart: APART m}
bodies: {A: {mass: 1 kg, inertia: 0.01}, B: {mass: 1 kg, inertia: 0.01}}
joints:
  j1: {type: point, parent: ground, child: A, coordinates: [x, y]}
  j2: {type: revolute, parent: ground, child: B, at: [3, 0]}
constraints:
  c: {type: distance, between: [ground, A], at: [[0, 0], [0, 0]], length: r}
  d: {type: distance, between: [ground, A], at: [[apart, 0], [0, 0]], length: r}
initial: {guess: {x: 0.9 m, y: 0.2 m}}
"""
CHAIN = """
model: stretched
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.01}, B: {mass: 1 kg, inertia: 0.01}}
joints:
  j1: {type: revolute, parent: ground, child: A, coordinate: q1}
  j2: {type: revolute, parent: A, child: B, at: [1, 0], coordinate: q2}
constraints: {rod: {type: distance, between: [ground, B], at: [[0, 0], [1, 0]], length: 2 m}}
"""
LINKS = """
model: links
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.01}, B: {mass: 1 kg, inertia: 0.01}}
joints:
  j1: {type: revolute, parent: ground, child: A, coordinate: q1}
  j2: {type: revolute, parent: A, child: B, at: [1, 0], coordinate: q2}
constraints: {rod: {type: distance, between: [ground, B], at: [[APART m, 0], [1, 0]], length: 1 m}}
initial: {guess: {q1: FIRST deg, q2: SECOND deg}}
"""


def links(apart: str, first: str, second: str) -> str:
    return LINKS.replace("APART", apart).replace("FIRST", first).replace("SECOND", second)


@pytest.mark.parametrize(("first", "second"), [("0", "0"), ("10", "-20"), ("1", "-3")])
def test_a_single_place_to_be_is_told_as_such(first: str, second: str, tmp_path: Path) -> None:
    """A row that is nowhere less than zero: walks find nothing else beside it, and Newton's steps
    come to it slowly. It was said that no configuration satisfies the constraints."""
    file = tmp_path / "links.yaml"
    file.write_text(links("3", first, second), encoding="utf-8")
    with pytest.raises(AssumptionError, match="fits together at singular positions alone"):
        hamel.check(file)


def test_what_cannot_be_reached_is_told_as_such() -> None:
    with pytest.raises(ModelError, match=r"no configuration near .* \(rod is off by"):
        survey_of(system(load_text(links("3.0001", "10", "-20"))))


@pytest.mark.parametrize("text", [RODS.replace("APART", "2"), CHAIN], ids=["rods", "chain"])
def test_what_is_stretched_to_fit_is_refused(text: str) -> None:
    """They were built with digits that mean nothing: a reaction of 3e6 N."""
    with pytest.raises(AssumptionError, match="fits together at singular positions alone"):
        survey_of(system(load_text(text)))


def test_small_and_nearly_stretched_mechanisms_beside_large_ones_are_not() -> None:
    """A crank of a micrometre beside one of ten metres; rods with a millimetre of play."""
    assert survey_of(system(load_text(RODS.replace("APART", "1.999999")))).rank == 2
    sizes = {"a": 1e-6, "b": 10.0}
    loops = [
        f"  {n}1: {{type: revolute, parent: ground, child: {n}1, coordinate: {n}p}}\n"
        f"  {n}2: {{type: revolute, parent: {n}1, child: {n}2, at: [{r}, 0], coordinate: {n}r}}\n"
        for n, r in sizes.items()
    ]
    bodies = ", ".join(f"{n}{k}: {{mass: 1, inertia: 1}}" for n in sizes for k in (1, 2))
    rods = [
        f"  {n}d: {{type: distance, between: [ground, {n}2], at: [[{2 * r}, 0], [{r}, 0]], "
        f"length: {r} m}}\n"
        for n, r in sizes.items()
    ]
    text = f"model: sizes\nplane: xy\nbodies: {{{bodies}}}\njoints:\n{''.join(loops)}"
    assert survey_of(system(load_text(f"{text}constraints:\n{''.join(rods)}"))).rank == 2
