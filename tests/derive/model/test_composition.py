"""Repetitions, submodels and models made in Python are written out before the model is read: the
result equals what a longer file says, and what is wrong is told at its place.

Of derive.model: builder.
Of derive.model.composing: composition, expansion, files, renaming, repetition.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import ModelError
from derive.model import Model, load, load_text, schema
from derive.robots.reading import load as load_any
from tests.loops import four_bars

GALLERY = Path(__file__).parents[3] / "models" / "gallery"
PARTS = ("parameters", "definitions", "bodies", "joints", "closures", "constraints", "loads")
MORE = ("coordinates", "inputs", "outputs", "initial", "choices")


def said(model: Model, parts: tuple[str, ...] = (*PARTS, *MORE)) -> dict[str, list[str]]:
    """What a model says, without places, in any order."""
    places = r"Span\([^)]*\)|at=\d+|text='[^']*'"
    return {
        part: sorted(re.sub(places, "", repr(item)) for item in getattr(model, part))
        for part in parts
    }


LEG = """model: leg
plane: xy
parameters: {l: 0.4 m, m: 2 kg, k: 3 N*m/rad}
where: {J: m*l^2/12}
bodies:
  thigh: {mass: m, com: [0, -l/2], inertia: J}
  shank: {mass: m/2, com: [0, -l/2], inertia: J/2, about: m and l are its own}
joints:
  hip: {type: revolute, parent: ground, child: thigh}
  knee: {type: revolute, parent: thigh, child: shank, at: [0, -l], coordinate: bend}
loads:
  tendon: {type: spring, joint: knee, stiffness: k, rest: 10 deg}
  push: {type: expression, joint: hip, expression: "(2 N*m)*sin(bend)"}
inputs: {tau: {joint: hip}}
outputs: {foot: "position(shank, [0, -l])"}
initial: {hip: 20 deg, bend: -10 deg, knee.w: 1 rad/s}
"""
TRUNK = """model: biped
plane: xy
parameters: {L: 0.5 m}
bodies: {trunk: {mass: 20 kg, com: [0, 0.3 m], inertia: 1 kg*m^2}}
joints: {base: {type: planar, parent: ground, child: trunk, coordinates: [x, y, tilt]}}
"""


def folder_with(tmp_path: Path, **files: str) -> Path:
    for name, text in files.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


def refusal(text: str, folder: Path | None = None) -> str:
    with pytest.raises(ModelError) as caught:
        load_text(text, "whole.yaml" if folder is None else str(folder / "whole.yaml"), folder)
    return str(caught.value)


def test_forty_four_bars_in_twenty_lines_are_the_file_written_by_a_program() -> None:
    path = GALLERY / "forty_four_bars.yaml"
    assert len(path.read_text().splitlines()) <= 20
    short, long = load(path), load_text(four_bars(40))
    assert len(short.closures) == 40
    for part in ("bodies", "closures"):
        assert len(getattr(short, part)) == len(getattr(long, part))
    assert {b.mass for b in short.bodies} == {b.mass for b in long.bodies}


def test_a_stewart_platform_in_twenty_five_lines() -> None:
    path = GALLERY / "stewart.yaml"
    assert len(path.read_text().splitlines()) <= 25
    model = load(path)
    assert (len(model.bodies), len(model.closures), len(model.inputs)) == (13, 6, 6)
    assert [len(choice.rows) for choice in model.choices] == [6, 6]


def test_entries_with_an_index_are_those_written_one_by_one() -> None:
    head = "model: chain\nplane: xy\nparameters: {m: 1 kg, l: 1 m}\n"
    short = load_text(
        head + "repeat: {i: 1..3}\nbodies:\n  b0: {mass: m}\n  b{i}: {mass: m*i, com: [l/i, 0]}\n"
        "joints:\n  j0: {type: revolute, parent: ground, child: b0}\n"
        '  j{i}: {type: revolute, parent: "b{i-1}", child: "b{i}", at: [i*l, 0], coordinate: "q{2*i}"}\n'
        'initial: {"q{2*i}": i*(10 deg)}\n'
        'quasi_velocities: {all: [der(j0), "der(q{2*i})"]}\n'
    )
    bodies = "".join(f"  b{i}: {{mass: m*{i}, com: [l/{i}, 0]}}\n" for i in (1, 2, 3))
    joints = "".join(
        f"  j{i}: {{type: revolute, parent: b{i - 1}, child: b{i}, at: [{i}*l, 0], "
        f"coordinate: q{2 * i}}}\n"
        for i in (1, 2, 3)
    )
    start = ", ".join(f"q{2 * i}: {i}*(10 deg)" for i in (1, 2, 3))
    long = load_text(
        f"{head}bodies:\n  b0: {{mass: m}}\n{bodies}joints:\n"
        f"  j0: {{type: revolute, parent: ground, child: b0}}\n{joints}initial: {{{start}}}\n"
        "quasi_velocities: {all: [der(j0), der(q2), der(q4), der(q6)]}\n"
    )
    assert said(short) == said(long)


def test_words_negative_numbers_and_remainders() -> None:
    model = load_text(
        "model: ring\nplane: xy\nrepeat: {side: [left, right], i: 0..3}\n"
        "bodies:\n  b: {mass: 1 kg}\n"
        "joints: {j: {type: prismatic, parent: ground, child: b, axis: x}}\n"
        'where: {"{side}_{i}": "i*mod(i, 2)*(1 m)" }\n'.replace("mod(i, 2)", "2")
        + 'outputs: {"next{mod(i + 1, 4)}": "{side}"}\n'.replace('"{side}"', "j")
        + 'parameters: {"{side}": 1 m}\n'
        'events: {"e{i}{side}": "j - {side}*i"}\n'
    )
    assert [name for name, _ in model.definitions][:2] == ["left_0", "left_1"]
    assert [output.name for output in model.outputs] == ["next1", "next2", "next3", "next0"]
    assert len(model.events) == 8
    minus = load_text(
        "model: two\nplane: xy\nrepeat: {k: [-1, 1]}\nparameters: {h: 1 m}\nbodies:\n"
        '  "b{k+1}": {mass: 2 kg, com: [k*h, h/k]}\n'
        'joints: {"j{k+1}": {type: revolute, parent: ground, child: "b{k+1}"}}\n'
    )
    assert len(minus.bodies) == 2


def test_points_of_a_path_are_repeated_by_what_stands_under_their_keys() -> None:
    head = (
        "model: cable\nplane: xy\nparameters: {r1: 0.1 m, r2: 0.2 m}\nrepeat: {i: 1..2, k: 1..2}\n"
        "bodies:\n  b{i}: {mass: 1 kg}\njoints:\n  j1: {type: revolute, parent: ground, child: b1}\n"
        "  j2: {type: revolute, parent: b1, child: b2, at: [1, 0]}\npaths:\n"
    )
    short = load_text(
        f"{head}  rope{{k}}:\n    - {{body: ground, at: [-1, 0.1*k]}}\n"
        '    - {body: "b{i}", at: [0.5, 0.1*i], pulley: {radius: "r{i}", side: left}}\n'
        "    - {body: b2, at: [9, 0]}\n"
    )
    ropes = "".join(
        f"  rope{k}:\n    - {{body: ground, at: [-1, 0.1*{k}]}}\n"
        + "".join(
            f"    - {{body: b{i}, at: [0.5, 0.1*{i}], pulley: {{radius: r{i}, side: left}}}}\n"
            for i in (1, 2)
        )
        + "    - {body: b2, at: [9, 0]}\n"
        for k in (1, 2)
    )
    assert said(short) == said(load_text(head + ropes))


REPEAT = (
    "model: a\nplane: xy\nparameters: {l: 1 m}\nrepeat: {i: 1..3}\nbodies:\n  b{i}: {mass: 1}\n"
)
CHAIN = f"{REPEAT}joints:\n"
WRONG = [
    ("repeat: {i: 1..}", "1:13: error: the range '1..' has no end", "such as 1..40"),
    ("repeat: {i: 1..99999999}", "99999999 repetitions", "at most 10000"),
    ("repeat: {i: 5..1}", "holds nothing", "1..5"),
    ("repeat: {i: 1..x}", "no range of whole numbers", "1..40"),
    ("repeat: {m: 1..4}", "1:10: error: the index 'm' is a unit", "another name"),
    ("repeat: {x: 1..4}", "1:10: error: the index 'x' is an axis", "another name"),
    ("repeat: {i: []}", "a list of nothing", "numbers or words"),
    ("repeat: {i: [1, 1]}", "stands twice", "each once"),
    ("repeat: {i: 1..10000, j: 1..10000}\nbodies: {'b{i}{j}': {mass: 1}}", "100000000", "10000"),
    (f"{REPEAT}  c{{j}}: {{mass: 1}}", "7:3: error: unknown index 'j'", "repeat: {j: 1..3}"),
    (f"{REPEAT}  c: {{mass: '{{i}}'}}", "7:14: error: the index 'i' is not fixed here", "{i} in"),
    (f"{REPEAT}paths: {{p: [{{body: 'b{{j}}'}}]}}", "7:21: error: unknown index 'j'", "repeat: {j"),
    (f"{REPEAT}  c{{i/2}}: {{mass: 1}}", "{i/2} is 0.5", "a whole number"),
    (f"{REPEAT}  c{{1/(i-1)}}: {{mass: 1}}", "has no value", "a whole number"),
    (f"{REPEAT}  c{{i^i^i^i}}: {{mass: 1}}", "a whole number", ""),
    (f"{REPEAT}  b2: {{mass: 1}}", "'b2' is given twice; first on line 6", "one of the two"),
    (
        f'{CHAIN}  c{{i}}: {{type: revolute, parent: ground, child: "b{{i}}", at: [l*l*i, 0]}}',
        "8:62: error: a point in m^2",
        "where i = 1",
    ),
    (
        f'{CHAIN}  c{{i}}: {{type: revolute, parent: ground, child: "b{{i}}", at: ["mod(i, 2)", 0]}}',
        "8:63: error: unknown function 'mod'",
        "mod() stands in braces, of indices of `repeat:`, as in {mod(i, 2) + 1}",
    ),
    (f"{REPEAT}  c{{i}}: {{mas: 1}}", "7:10: error: unknown key 'mas'", "where i = 1"),
    (f"{REPEAT}  c: {{mass: c{{i}}}}", "not valid YAML", 'quotes around a name such as "link{i}"'),
]


@pytest.mark.parametrize("text, message, expected", WRONG)
def test_wrong_repetitions_are_told_where_they_stand(
    text: str, message: str, expected: str
) -> None:
    shown = refusal(text if text.startswith("model") else f"{text}\nmodel: a\n")
    assert message in shown, shown
    assert expected in shown, shown


TAKEN = [
    ("l", "parameters", ""),
    ("e", "where", "where: {e: 2*l}\n"),
    ("curve", "tables", "tables: {curve: {points: [[0, 0], [1, 1]]}}\n"),
    ("u", "inputs", "inputs: {u: {unit: N}}\n"),
    ("u_late", "inputs", "inputs: {u: {unit: N, delay: 1 s}}\n"),
    ("c", "states", "states: {c: {rate: 1/(1 s)}}\n"),
    ("p", "joints", "joints: {j: {type: revolute, parent: ground, child: b1, coordinate: p}}\n"),
    ("j", "joints", "joints: {j: {type: revolute, parent: ground, child: b1}}\n"),
    ("p", "coordinates", "coordinates: {p: m}\nkinetic: (1 kg)*der(p)^2\n"),
    ("b", "bodies", "joints: {j: {type: revolute, parent: ground, child: b}}\n"),
]


@pytest.mark.parametrize("name, section, rest", TAKEN)
def test_an_index_hides_no_name_of_the_file(name: str, section: str, rest: str) -> None:
    text = REPEAT.replace("b{i}", "b").replace("{i: 1..3}", f"{{{name}: 2..3}}") + rest
    shown = refusal(text.replace("  b: {mass: 1}", "  b: {mass: 1}\n  b1: {mass: 1}"))
    assert f"4:10: error: the index '{name}' is a name under '{section}:', too" in shown, shown
    assert "another name for one of the two" in shown


def test_an_index_hides_no_name_of_a_part_or_in_a_part(tmp_path: Path) -> None:
    index = "repeat: {near_bend: 2..3}\n"
    use = "submodels: {near: {use: leg.yaml, ground: trunk}}\n"
    own = refusal(TRUNK + index + use, folder_with(tmp_path, leg=LEG))
    assert "the index 'near_bend' is a name under 'joints:', too" in own
    part = refusal(TRUNK + use, folder_with(tmp_path, leg=LEG + "repeat: {k: 2..3}\n"))
    assert "leg.yaml:17:10: error: the index 'k' is a name under 'parameters:', too" in part
    assert "near is used at" in part
    twice = TRUNK + "repeat: {k: 2..3}\n" + use.replace("near", "'near{k}'")
    load_text(twice, str(tmp_path / "whole.yaml"), folder_with(tmp_path, leg=LEG))


def test_a_mistake_in_a_repetition_is_told_once() -> None:
    assert (
        refusal(f'{CHAIN}  c{{i}}: {{type: fix, parent: ground, child: "b{{i}}"}}').count("error:")
        == 1
    )


def test_a_chain_of_ten_thousand_links_is_read() -> None:
    text = (
        "model: chain\nplane: xy\nparameters: {l: 1 m, m: 1 kg}\nrepeat: {i: 1..1999}\n"
        "bodies:\n  b0: {mass: m}\n  b{i}: {mass: m, com: [l/2, 0], inertia: m*l^2/12}\n"
        "joints:\n  j0: {type: revolute, parent: ground, child: b0}\n"
        '  j{i}: {type: revolute, parent: "b{i-1}", child: "b{i}", at: [l, 0]}\n'
    )
    assert len(load_text(text.replace("1999", "9999")).bodies) == 10000


def test_a_submodel_is_its_file_under_other_names(tmp_path: Path) -> None:
    whole = TRUNK + (
        "submodels:\n  near: {use: leg.yaml, parameters: {l: 0.9*L, m: 3 kg, k: 4 N*m/rad}, ground: trunk}\n"
        "initial: {near_hip: 5 deg}\n"
    )
    model = load_text(whole, str(tmp_path / "whole.yaml"), folder_with(tmp_path, leg=LEG))
    long = load_text(
        TRUNK.replace("{L: 0.5 m}", "{L: 0.5 m, near_m: 3 kg, near_k: 4 N*m/rad}")
        .replace("bodies: {", "where: {near_l: 0.9*L, near_J: near_m*near_l^2/12}\nbodies: {")
        .replace(
            "1 kg*m^2}}",
            "1 kg*m^2}, near_thigh: {mass: near_m, com: [0, -near_l/2], inertia: near_J}, "
            "near_shank: {mass: near_m/2, com: [0, -near_l/2], inertia: near_J/2, "
            "about: m and l are its own}}",
        )
        .replace(
            "tilt]}}",
            "tilt]}, near_hip: {type: revolute, parent: trunk, child: near_thigh}, near_knee: "
            "{type: revolute, parent: near_thigh, child: near_shank, at: [0, -near_l], "
            "coordinate: near_bend}}",
        )
        + "loads: {near_tendon: {type: spring, joint: near_knee, stiffness: near_k, rest: 10 deg}, "
        'near_push: {type: expression, joint: near_hip, expression: "(2 N*m)*sin(near_bend)"}}\n'
        "inputs: {near_tau: {joint: near_hip}}\n"
        'outputs: {near_foot: "position(near_shank, [0, -near_l], trunk)"}\n'
        "initial: {near_hip: 5 deg, near_bend: -10 deg, near_knee.w: 1 rad/s}\n"
    )
    assert said(model) == said(long)


def test_submodels_inside_submodels_and_repeated(tmp_path: Path) -> None:
    foot = "model: foot\nplane: xy\nbodies: {toe: {mass: 1 kg, inertia: 0.1}}\njoints: {ankle: {type: revolute, parent: ground, child: toe}}\n"
    leg = (
        LEG + "submodels: {sole: {use: feet/foot.yaml, ground: {body: shank, position: [0, -l]}}}\n"
    )
    (tmp_path / "feet").mkdir()
    (tmp_path / "feet" / "foot.yaml").write_text(foot)
    whole = (
        TRUNK
        + "repeat: {i: 1..2}\nsubmodels:\n  leg{i}: {use: leg.yaml, ground: trunk, parameters: {l: 0.1 m*i}}\n"
    )
    model = load_text(whole, str(tmp_path / "whole.yaml"), folder_with(tmp_path, leg=leg))
    names = {body.name for body in model.bodies}
    assert {"leg1_sole_toe", "leg2_sole_toe", "leg2_sole_ground"} <= names
    assert [Path(file).name for file, _ in model.sources] == ["leg.yaml", "foot.yaml"]


@pytest.mark.parametrize(
    "entry, places",
    [
        (
            "{use: leg.yaml, parameters: {l: 2 kg}}",
            ["whole.yaml:6:51: error", "in kg", "expected: m"],
        ),
        (
            "{use: leg.yaml, parameters: {ll: 2 m}}",
            ["whole.yaml:6:48", "no parameter of leg.yaml", "'l'"],
        ),
        (
            "{use: leg.yaml, parameters: {l: tilt}}",
            ["leg.yaml:6:29: error", "near is used at", ":6:13"],
        ),
        (
            "{use: leg.yaml, ground: trnk}",
            ["whole.yaml:6:43: error: unknown body 'trnk'", "did you mean 'trunk'?"],
        ),
        ("{use: none.yaml}", ["whole.yaml:6:25: error: 'none.yaml' cannot be read"]),
        ("{use: ../leg.yaml}", ["whole.yaml:6:25", "is not beside the model"]),
        ("{use: /etc/passwd}", ["whole.yaml:6:25", "is not beside the model"]),
        ("{use: whole.yaml}", ["'whole.yaml' uses itself: whole.yaml → whole.yaml"]),
        (
            "{use: round.yaml}",
            ["round.yaml:2:22: error: 'whole.yaml' uses itself", "round.yaml → whole.yaml"],
        ),
        (
            "{use: cut.yaml}",
            [
                "cut.yaml:5:56: error: '(1 N)*max(s' ends at a comma",
                "near is used at",
                "whole.yaml:6:13",
            ],
        ),
        (
            "{use: broken.yaml}",
            ["broken.yaml:2:1: error", "the file is used at", "whole.yaml:6:25"],
        ),
        ("{use: space.yaml}", ["a submodel in space of a model in the plane xy"]),
        ("{use: energies.yaml}", ["energies.yaml:3:1: error: 'kinetic' in a submodel"]),
        ("{usee: leg.yaml}", ["whole.yaml:6:20: error: unknown key 'usee'", "did you mean 'use'?"]),
    ],
)
def test_wrong_submodels_are_told_in_both_files(
    tmp_path: Path, entry: str, places: list[str]
) -> None:
    files = {
        "leg": LEG,
        "round": "plane: xy\nsubmodels: {a: {use: whole.yaml}}\nmodel: round\n",
        "broken": "model: {a\n",
        "cut": "model: cut\nplane: xy\nbodies: {b: {mass: 1 kg}}\n"
        "joints: {rail: {type: prismatic, parent: ground, child: b, axis: x, coordinate: s}}\n"
        "loads: {f: {type: expression, joint: rail, expression: (1 N)*max(s, 0)}}\n",
        "space": "model: space\n",
        "energies": "model: energies\nplane: xy\nkinetic: 1 J\n",
    }
    whole = TRUNK + f"submodels: {{near: {entry}}}\n"
    folder = folder_with(tmp_path, whole=whole, **files)
    shown = refusal(whole, folder)
    for place in places:
        assert place in shown, shown


def test_a_link_out_of_the_folder_is_no_way_out(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "leg.yaml").write_text(LEG)
    (inner / "leg.yaml").symlink_to(tmp_path / "leg.yaml")
    shown = refusal(TRUNK + "submodels: {near: {use: leg.yaml}}\n", inner)
    assert "is not beside the model" in shown


def test_a_text_in_memory_refers_to_no_files() -> None:
    assert "a model in memory" in refusal(TRUNK + "submodels: {near: {use: leg.yaml}}\n")


def arm() -> hamel.Model:
    made = hamel.Model("arm", plane="xy", gravity=[0, "-9.81 m/s^2"])
    made.parameter("l", "0.4 m")
    made.body("link", mass="2 kg", com=["l/2", 0], inertia="2 kg*l^2/12")
    made.joint("A", type="revolute", parent="ground", child="link", at=np.zeros(2), coordinate="q")
    made.load("rub", type="damper", joint="A", coefficient=np.float64(0.1))
    return made.input("tau", joint="A").initial("q", 0.3).output("height", "l*sin(q)")


def test_a_model_made_in_python_is_the_model_of_its_text(tmp_path: Path) -> None:
    made = arm()
    path = made.write(tmp_path / "arm.yaml")
    assert said(load(path)) == said(load_any(made))
    again = hamel.Model.from_dict(made.to_dict())
    assert again.yaml() == made.yaml()
    checked = hamel.check(made)
    assert (checked.degrees_of_freedom, checked.inputs) == (1, ("tau",))


def test_a_model_made_in_python_is_refused_with_the_line_of_its_text() -> None:
    made = arm().body("tip", mass="3 kgg").joint("B", type="revolute", parent="link", child="tip")
    with pytest.raises(ModelError) as caught:
        hamel.check(made)
    line = next(i for i, text in enumerate(made.yaml().splitlines(), 1) if "kgg" in text)
    assert f"<model arm>:{line}:" in str(caught.value)
    assert "unknown unit 'kgg'" in str(caught.value)
    with pytest.raises(ModelError, match="'tip' is given twice in 'bodies'"):
        made.body("tip", mass=1)


def test_dictionaries_without_end_and_strange_values_are_refused() -> None:
    endless: dict[str, object] = {}
    endless["bodies"] = endless
    with pytest.raises(ModelError, match="nested too deeply"):
        hamel.check(hamel.Model.from_dict({"model": "a", "bodies": endless}))
    with pytest.raises(ModelError, match="object as an entry"):
        hamel.check(hamel.Model.from_dict({"model": "a", "bodies": object()}))
    with pytest.raises(ModelError, match="nan"):
        hamel.check(arm().parameter("x", float("nan")))


def test_editors_know_the_keys_of_compositions() -> None:
    known = schema()
    assert {"repeat", "submodels"} <= set(known["properties"])
    assert "SubmodelEntry" in known["$defs"]


def test_what_a_module_is_stored_under_holds_the_files_it_refers_to(tmp_path: Path) -> None:
    from hamel.build.keys import file_key

    folder_with(tmp_path, leg=LEG, whole=TRUNK + "submodels: {near: {use: leg.yaml}}\n")
    assert file_key(tmp_path / "whole.yaml", {}) is None
    assert file_key(tmp_path / "leg.yaml", {}) is not None
    one = load(tmp_path / "whole.yaml")
    (tmp_path / "leg.yaml").write_text(LEG.replace("2 kg", "3 kg"))
    two = load(tmp_path / "whole.yaml")
    assert one.text == two.text
    assert one.content() != two.content()
    assert replace(one, sources=()).content() != one.content()


BRACED = """model: braced
description: "A chassis {1}, \\\\frac{1}{2} x, {i} and {3}"
plane: xy
REPEATbodies: {a: {mass: 1 kg, inertia: 0.1, about: "{1} of {k} or {max(1, 2)}"}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q1, symbol: SYMBOL}}
"""


@pytest.mark.parametrize("repeat", ["", "repeat: {i: 1..2}\n"])
def test_braces_without_an_index_are_those_of_the_text(repeat):
    """Numbers in braces are no repetition, and what the file repeats nothing for is no index."""
    for symbol in ("q_{12}", "m_{ab}", r"\theta_{12}"):
        model = load_text(BRACED.replace("REPEAT", repeat).replace("SYMBOL", f"'{symbol}'"))
        assert model.description == r"A chassis {1}, \frac{1}{2} x, {i} and {3}"
        assert model.bodies[-1].about == "{1} of {k} or {max(1, 2)}"
        assert model.symbols == (("q1", symbol),)


CHAINED = """model: chained
plane: xy
repeat: {i: 11..12}
bodies:
  a{i}: {mass: 1 kg, inertia: 0.1, about: "{1} of {i+1}"}
joints:
  A{i}: {type: revolute, parent: ground, child: "a{i}", coordinate: "q{i}", symbol: "q_{i}^{2}"}
"""


def test_indices_among_other_braces_are_put_in():
    """A text for readers and a symbol may hold both; those of LaTeX stay around the number."""
    model = load_text(CHAINED)
    assert [x.about for x in model.bodies[-2:]] == ["{1} of 12", "{1} of 13"]
    assert model.symbols == (("q11", "q_{11}^{2}"), ("q12", "q_{12}^{2}"))


def test_numbers_are_written_without_quotes():
    """As texts, too, for that is what they are read as; what only looks like one keeps its own."""
    entries = {"model": "m", "gravity": ["0", "-9.81 m/s^2"], "parameters": {"a": "1e-3", "b": 0.5}}
    text = hamel.Model.from_dict(entries).yaml()
    assert "gravity: [0, -9.81 m/s^2]" in text and "{a: 1e-3, b: 0.5}" in text
    assert "'1:30'" in hamel.Model.from_dict({"model": "m", "description": "1:30"}).yaml()
