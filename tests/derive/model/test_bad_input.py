"""What has no end, no order or no normal is refused where it stands, with what to do."""

from pathlib import Path

import pytest

from derive.diagnostics import HamelError
from derive.model import load
from derive.states import system

SLIDE = """model: m
plane: xy
bodies: {b: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: q}}
"""
FREE = """model: m
bodies: {b: {mass: 1 kg, inertia: 0.1}}
joints: {j: {type: free, parent: ground, child: b, position: [x, y, z]}}
"""
SQUARE = "surface: (z - 0.1*x)^2"
CASES = {
    "a repetition without end": (
        SLIDE + "repeat: {i: 1..}\n",
        "5:13: error: the range '1..' has no end",
        "a range such as 1..40",
    ),
    "a repetition that is too long": (
        SLIDE + "repeat: {i: 1..1000000000000}\n",
        "5:13: error: 1000000000000 repetitions",
        "at most 10000",
    ),
    "a file that includes itself": (
        SLIDE + "submodels: {a: {use: m.yaml}}\n",
        "5:22: error: 'm.yaml' uses itself: m.yaml → m.yaml",
        "files without a circle",
    ),
    "a table that does not increase": (
        SLIDE + "tables: {p: {points: [[0, 1], [2, 3], [1, 4]]}}\n",
        "5:39: error: x = 1 after x = 2 in the table 'p'",
        "x strictly increasing",
    ),
    "a table with one place twice": (
        SLIDE + "tables: {p: {points: [[0, 1], [0, 3]]}}\n",
        "5:31: error: x = 0 after x = 0 in the table 'p'",
        "x strictly increasing",
    ),
    "a state that needs its own rate": (
        SLIDE + 'states: {a: {rate: (1 1/s) - der(a), unit: "1"}}\n',
        "5:34: error: der() of the state 'a'",
        "is no explicit equation",
    ),
    "states that need each other's rates": (
        SLIDE + "states: {a: {rate: der(c)}, c: {rate: der(a)}}\n",
        "5:24: error: der() of the state 'c'",
        "the formula under its `rate:`",
    ),
    "a state that depends on itself through definitions": (
        SLIDE + "where: {d: e, e: d}\nstates: {a: {rate: d}}\n",
        "5:9: error: 'd' is defined by itself: d → e → d",
        "formulas without a circle",
    ),
    "a rolling surface without a slope": (
        f"{FREE}constraints: {{c: {{type: rolling, body: b, shape: {{sphere: {{radius: 0.1 m}}}}, {SQUARE}}}}}\n",
        "4:15: error: the slope of the surface vanishes",
        "a formula that changes its sign across the surface",
    ),
    "a point on a surface without a slope": (
        f"{FREE}constraints: {{c: {{type: point_on_surface, body: b, {SQUARE}}}}}\n",
        "4:15: error: the slope of the surface vanishes",
        "a formula that changes its sign across the surface",
    ),
    "a contact with a surface without a slope": (
        f"{FREE}loads: {{c: {{type: contact, body: b, {SQUARE}, stiffness: 1 N/m}}}}\n",
        "4:9: error: the slope of the surface vanishes",
        "a formula that changes its sign across the surface",
    ),
    "a contact with a surface that is nowhere": (
        f"{FREE}loads: {{c: {{type: contact, body: b, surface: 0*z + 1, stiffness: 1 N/m}}}}\n",
        "4:9: error: the slope of the surface vanishes",
        "a formula that changes its sign across the surface",
    ),
    "a formula with a comma that is not in quotes": (
        SLIDE + "loads: {f: {type: expression, joint: j, expression: max(0 N, 1 N)}}\n",
        "5:62: error: unknown key '1 N)'",
        "a formula with a comma stands in quotes",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_is_refused_at_its_place(name: str, tmp_path: Path) -> None:
    text, place, advice = CASES[name]
    file = tmp_path / "m.yaml"
    file.write_text(text, "utf-8")
    with pytest.raises(HamelError) as error:
        system(load(file))
    assert f"m.yaml:{place}" in str(error.value)
    assert advice in str(error.value)
