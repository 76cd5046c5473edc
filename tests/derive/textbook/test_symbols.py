"""No two things on a page look alike, and what belongs together looks so.

Of derive.textbook.formulas: labels, notation.
Of derive.textbook: names, outputs.
"""

import re

import pytest

from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from derive.textbook.derivation import derivation
from derive.textbook.formulas.labels import labels
from derive.textbook.records import Display, Document, Math, Table
from derive.textbook.writing.latex import article
from tests.scenes import MODELS

TWINS = """
model: twins
plane: xy
parameters: {m1: 1 kg, m_1: 2 kg, l: 1 m, th: 0.3 rad, x_dot: 0.4 N}
bodies:
  {b1: {mass: m1, inertia: 0.1}, b_1: {mass: m_1, inertia: 0.2}, b2: {mass: 1, inertia: 1}, b3: {mass: 1}}
joints:
  j1: {type: prismatic, parent: ground, child: b1, axis: x, coordinate: q1}
  j_1: {type: prismatic, parent: ground, child: b_1, axis: y, coordinate: q_1}
  j2: {type: revolute, parent: b_1, child: b2, coordinate: theta}
  j3: {type: prismatic, parent: ground, child: b3, axis: x, coordinate: x}
inputs: {u1: {joint: j1}, u_1: {joint: j_1}}
loads: {k: {type: expression, joint: j1, expression: -(3 N/m)*q1 + x_dot*sin(q_1/l - th)}}
outputs: {y1: q1, y_1: q_1}
"""


def written(text: str, road: str = "block_inversion") -> Document:
    return derivation(equations(system(load_text(text))), (road,))


def symbols(document: Document) -> dict[str, list[str]]:
    """Of the table of symbols: what each symbol is said to be."""
    (section,) = [x for x in document.sections if x.title == "Symbols"]
    (table,) = [x for x in section.blocks if isinstance(x, Table)]
    found: dict[str, list[str]] = {}
    for (symbol,), about, _ in table.rows:
        assert isinstance(symbol, Math)
        for one in symbol.latex.split(r",\; "):
            found.setdefault(one, []).append("".join(str(run) for run in about))
    return found


def test_no_two_names_look_alike() -> None:
    called = labels(load_text(TWINS))
    assert len({*called.values()}) == len(called)
    assert called["m1"] == "m_{1}" and called["m_1"] == r"\mathrm{m\,1}"


def test_the_rate_of_a_coordinate_is_its_symbol_with_a_dot() -> None:
    called = labels(load_text(TWINS))
    assert called["theta"] == r"\theta" and called["th"] == r"\mathrm{th}"
    assert called["der(theta)"] == r"\dot{\theta}"
    assert called["der(x)"] == r"\dot{x}" and called["x_dot"] == r"\mathrm{x\,dot}"
    assert called["der(q_1)"] == r"\dot{\mathrm{q\,1}}"
    assert not re.search(r"\\mathrm\{der", article(written(TWINS)))


def test_tables_of_what_is_given_call_things_as_formulas_do() -> None:
    (given,) = [x for x in written(TWINS).sections if x.title == "Given"]
    table = next(x for x in given.blocks if isinstance(x, Table))
    first = [cell[0].latex for cell, *_ in table.rows if isinstance(cell[0], Math)]
    assert first == ["m_{1}", r"\mathrm{m\,1}", "l", r"\mathrm{th}", r"\mathrm{x\,dot}"]


def test_symbols_are_listed_once_and_as_formulas_have_them() -> None:
    found = symbols(written(TWINS))
    assert r"\tilde{y_{1}}" in found
    assert not {symbol: told for symbol, told in found.items() if len(told) > 1}


@pytest.mark.parametrize(
    "model, roads",
    [
        ("snakeboard", ("block_inversion",)),  # an arm on a platform
        ("rolling_disk", ("gibbs_appell",)),  # gravity, and a bias without it
        ("four_bar", ("kane", "boltzmann_hamel")),
    ],
)
def test_a_symbol_has_one_meaning(model: str, roads: tuple[str, ...]) -> None:
    found = symbols(derivation(equations(system(load(MODELS / f"{model}.yaml"))), roads))
    assert not {symbol: told for symbol, told in found.items() if len(told) > 1}


def test_the_energy_of_accelerations_is_no_parameter() -> None:
    text = TWINS.replace("th: 0.3 rad", "th: 0.3 rad, G: 1 kg").replace("mass: m1,", "mass: G,")
    found = symbols(written(text, "gibbs_appell"))
    assert len(found["G"]) == len(found[r"\tilde{G}"]) == 1


SPATIAL = """
model: spatial
gravity: [0, 0, -9.81 m/s^2]
bodies:
  one: {mass: 1, com: [0.2, 0, 0], inertia: [0.1, 0.2, 0.25]}
  two: {mass: 2, com: [0, 0.2, 0.1], inertia: [0.1, 0.2, 0.25, 0.01, 0.02, 0.03]}
  three: {mass: 3, com: [0, 0.2, 0.1], inertia: [0.1, 0.2, 0.25]}
joints:
  j1: {type: universal, parent: ground, child: one, axis: z, axis2: y, coordinates: [th, th1]}
  j2: {type: ball, parent: one, child: two, at: [0.2, 0, 0]}
  j3: {type: revolute, parent: two, child: three, at: [0, 0.2, 0], axis: x, coordinate: q1, rpy: [0.1, 0.2, 0.3]}
"""


def test_no_quantity_is_an_alias_of_an_abbreviation() -> None:
    document = written(SPATIAL)
    lines = [
        line
        for section in document.sections
        for block in section.blocks
        if isinstance(block, Display)
        for line in block.lines
    ]
    assert any(line.where for line in lines)
    rights = ["".join(line.right) for line in lines]
    aliases = [x for x in rights if re.fullmatch(r"-?z_\{\d+\}", x)]
    used = " ".join(x for x in rights if x not in aliases)
    assert not [x for x in aliases if x.strip("-") not in used]


def test_the_symbol_of_a_body_stands_beside_its_name() -> None:
    text = TWINS.replace("b2: {mass: 1,", r"b2: {symbol: '\Upsilon', mass: 1,")
    assert r"b2, $\Upsilon$ & $1$ &" in article(written(text))
