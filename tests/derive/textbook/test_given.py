"""Given says all that makes the mechanism: what holds and drives it, where, and in whose axes.

Of derive.textbook.given: closures, constraints, events, frames, joints, loads, surfaces.
"""

import re

import pytest

from derive.formulations import equations
from derive.joints import JOINTS
from derive.mechanics.closures import CLOSINGS
from derive.mechanics.constraints import TIES
from derive.mechanics.loads import LAWS
from derive.model import load_text
from derive.states import system
from derive.textbook.given.closures import SENTENCES
from derive.textbook.given.constraints import CONSTRAINTS
from derive.textbook.given.joints import TYPES
from derive.textbook.given.loads import LOADS
from derive.textbook.given.model import given
from derive.textbook.manuscript import Manuscript
from derive.textbook.outputs import outputs
from derive.textbook.records import Math, Paragraph, Runs, Table
from derive.textbook.writing.html import page
from derive.textbook.writing.latex import article
from tests.derive.textbook.test_textbook import check_article, check_page
from tests.scenes import MODELS

TWO = """
model: two
parameters: {b: 0.1 m}
bodies: {one: {mass: 1 kg, inertia: 0.01}, two: {mass: 1 kg, inertia: 0.01}}
joints:
  first: {type: free, parent: ground, child: one, position: [x1, y1, z1]}
  second: {type: free, parent: ground, child: two, position: [x2, y2, z2]}
"""
FLAT = """
model: flat
plane: xz
parameters: {b: 0.1 m, al: 0.3}
bodies: {one: {mass: 1 kg, inertia: 0.01}, two: {mass: 1 kg, inertia: 0.01}}
joints:
  rail: {type: prismatic, parent: ground, child: one, axis: x, coordinate: s}
  free: {type: planar, parent: ground, child: two, coordinates: [x, z, th]}
"""


def manuscript(text: str) -> Manuscript:
    return Manuscript(equations(system(load_text(text))))


def told(text: str) -> str:
    """The section as text: a line for each paragraph and row of a table. Both writers take it."""
    doc = manuscript(text)
    given(doc)
    document = doc.document("m", "", "0")
    check_page(page(document))
    check_article(article(document))
    lines: list[str] = []
    for block in document.sections[0].blocks:
        if isinstance(block, Paragraph):
            lines.append(plain(block.runs))
        if isinstance(block, Table):
            lines += [" | ".join(map(plain, row)) for row in block.rows]
    return "\n".join(lines)


def plain(runs: Runs) -> str:
    """Formulas nearly as they are typed."""
    text = "".join(x.latex if isinstance(x, Math) else getattr(x, "text", "") for x in runs)
    text = re.sub(r"\\mathrm\{([^{}]*)\}", r"\1", text.replace(r"\;", " ").replace(r"\,", " "))
    return re.sub(" +", " ", text)


def closed(kind: str, more: str = "axis: z") -> str:
    """The row of a closure between two bodies."""
    closure = f"{{type: {kind}, between: [one, two], at: [[b, 0, 0], [0, 0, 0]], {more}}}"
    return told(f"{TWO}closures: {{C: {closure}}}\n")


def test_each_kind_has_a_sentence() -> None:
    assert {closing.name for closing in CLOSINGS} <= set(SENTENCES)
    assert {law.record for law in LAWS} <= set(LOADS)
    assert {tie.record for tie in TIES} <= set(CONSTRAINTS)
    assert {x.name for x in JOINTS if x.needs_axis} <= set(TYPES)


@pytest.mark.parametrize(
    "kind, more, sentence",
    [
        ("prismatic", "axis: z", "slide along one line: through {a} along {z} in one, through"),
        ("prismatic", "axis: z", "in two; their axes stay parallel"),
        ("cylindrical", "axis: z", "slide along one axis and turn about it: through {a} along {z}"),
        ("screw", "axis: z, pitch: 5 mm", "advance along it by 0.005 m a turn, as a right-hand"),
        ("screw", "axis: z, pitch: b", "advance along it by b a turn"),
        ("planar", "axis: z", "slide and turn in one plane: through {a} normal to {z} in one"),
        ("revolute", "axis: z", "meet, and the bodies turn about one axis: along {z} in one"),
        ("universal", "axis: z, axis2: x", "meet, and the axis {z} of one stays at right angles"),
        ("universal", "axis: z, axis2: x", "at right angles to the axis (1, 0, 0) of two"),
        ("ball", "about: it", "points of one at {a} and of two at (0, 0, 0) meet, and the bodies"),
        ("fixed", "about: it", "weld: the points of one at {a} and of two at (0, 0, 0) meet, and"),
        ("fixed", "about: it", "meet, and their axes stay parallel"),
    ],
)
def test_what_a_closure_does_is_said_by_its_kind(kind: str, more: str, sentence: str) -> None:
    text = closed(kind, more)
    assert sentence.format(a="(b, 0, 0)", z="(0, 0, 1)") in text
    meets = kind in ("fixed", "revolute", "ball", "universal")
    assert ("meet" in text) == meets and "stays on a point" not in text


def test_frames_of_closures_that_are_turned_are_told_and_axes_are_those_of_the_bodies() -> None:
    text = closed("revolute", "axis: z, axis_angle: [y, 90 deg]")
    assert "along (1, 0, 0) in one, along (0, 0, 1) in two" in text
    assert "C | one | by 90° about y" in text
    text = closed("fixed", "rpy: [10 deg, 20 deg, 30 deg]")
    assert "C | one | x along (0.813798, 0.469846, -0.34202), y along (-0.44097, " in text


def test_a_slide_that_closes_a_loop_in_a_plane() -> None:
    closure = "{type: prismatic, between: [ground, two], at: [[0, b], [0, 0]], axis: x}"
    text = told(f"{FLAT}closures: {{C: {closure}}}\n")
    assert "slide along one line: through (0, b) along (1, 0) in the ground" in text


JOINTS_IN_SPACE = """
model: m
parameters: {a: 0.3, p: 5 mm}
bodies: {one: BODY, two: BODY, three: BODY, four: BODY, five: BODY}
joints:
  A: {type: screw, parent: ground, child: one, axis: z, pitch: p}
  B: {type: universal, parent: one, child: two, axis: x, axis2: y}
  C: {type: cylindrical, parent: two, child: three, axis: y}
  D: {type: planar, parent: ground, child: four, axis: -y}
  E: {type: prismatic, parent: ground, child: five, axis: x, axis_angle: [z, -a]}
"""


@pytest.mark.parametrize(
    "row",
    [
        "A | screw about (0, 0, 1), right-handed, advancing by p a turn",
        "B | universal, about (1, 0, 0) of one and (0, 1, 0) of two",
        "C | cylindrical, along and about (0, 1, 0)",
        "D | planar, normal to (0, -1, 0)",
        "E | prismatic along (1, 0, 0)",
        "E | the ground | by -a about z",
        "axes are given in those of the body that a joint leads to",
        "where its coordinates are zero the two agree. These frames are turned in their body:",
    ],
)
def test_joints_in_space_tell_all_of_their_axes(row: str) -> None:
    assert row in told(JOINTS_IN_SPACE.replace("BODY", "{mass: 1 kg, inertia: 0.01}"))


def test_slides_and_turned_frames_of_planar_models_are_told() -> None:
    text = told(FLAT.replace("axis: x,", "axis: x, angle: 30 deg,"))
    assert "rail | prismatic along (1, 0)" in text and "rail | the ground | by 30°" in text
    assert "axes of all are parallel" not in text
    text = told(FLAT.replace("axis: x,", "axis: x, angle: al,"))
    assert r"rail | the ground | by \alpha" in text
    text = told(FLAT.replace("axis: x,", "axis: x, angle: be,") + "where: {be: 60 deg}\n")
    assert "rail | the ground | by 60°" in text
    text = told(FLAT)
    assert "axes of all are parallel" in text and "turned" not in text


ROLLS = """
constraints:
  R: {type: rolling, body: one, at: [0, b, 0], shape: %s, %s}
initial: {guess: {z1: 0.2 m}}
"""


@pytest.mark.parametrize(
    "shape, ground, sentence",
    [
        (
            "{knife_edge: {radius: b, axis: y}}",
            "plane: {normal: z, origin: [0, 0, -1 m]}",
            "a thin disk of one about (0, b, 0), of radius b and with the axis (0, 1, 0), rolls "
            "without slip on the plane of the ground through (0, 0, -1), normal to (0, 0, 1)",
        ),
        (
            "{torus: {radius: b, tube: 4 cm, axis: y}}",
            "plane: {normal: z}",
            "a tube of radius 0.04 m round a circle of radius b with the axis (0, 1, 0)",
        ),
        (
            "{sphere: {radius: b}}",
            "surface: z - b*(x/(1 m))^2, of: two",
            "on the surface z - b x^{2} = 0 of two, with x, y, z along its axes",
        ),
    ],
)
def test_what_rolls_and_on_what(shape: str, ground: str, sentence: str) -> None:
    assert sentence in told(TWO + ROLLS % (shape, ground))


def test_a_planar_model_rolls_on_lines_and_its_points_have_two_components() -> None:
    text = told(
        f"{FLAT}constraints:\n"
        "  R: {type: rolling, body: two, shape: {wheel: {radius: b}}, plane: {normal: z}}\n"
        "  S: {type: point_on_surface, body: one, at: [b, 0], surface: z + 1 cm - 0.123456789*x^2/(1 m)}\n"
        "initial: {guess: {z: 0.1 m}}\n"
    )
    wheel = (
        "a circle of two about (0, 0), of radius b, rolls without slip on the line of the ground"
    )
    assert f"{wheel} through (0, 0), normal to (0, 1)" in text
    curve = (
        r"the point of one at (b, 0) stays on the curve z + 0.01 - 0.123457 x^{2} = 0 of the ground"
    )
    assert f"{curve}, with x, z along its axes" in text


def test_forces_of_constraints_that_are_not_ideal_are_told() -> None:
    law = "{holonomic: s - x, nonideal: {s: (-0.1)*reaction.law, x: 2 N}}"
    text = told(f"{FLAT}constraints: {{law: {law}}}\n")
    assert r"-0.1 \lambda_{law} along s, the generalised force 2 along x" in text
    text = told((MODELS / "bead_on_wire.yaml").read_text("utf-8"))
    assert "work of its own: its forces are too long to be read here" in text


def loaded(load: str, base: str = TWO) -> str:
    """The row of a load."""
    return told(f"{base}loads: {{F: {{{load}}}}}\n")


@pytest.mark.parametrize(
    "load, sentence",
    [
        (
            "type: friction, joint: rail, viscous: 1 N*s/m, coulomb: 2 N, smoothing: 1 cm/s",
            r"friction against \dot{s}: viscous coefficient 1 N s/m; dry friction 2 N, times the "
            r"hyperbolic tangent of \dot{s} over 0.01 m/s",
        ),
        (
            "type: friction, velocity: free.w, viscous: b*(1 N*s/rad)",
            r"friction against \omega^{free}: viscous coefficient b",
        ),
        (
            "type: damper, coordinate: z, coefficient: 3 N*s/m",
            r"damper on \dot{z}: coefficient 3 N s/m",
        ),
        ("type: armature, joint: rail, inertia: 0.2 kg", r"0.2 kg is added to what is felt along"),
        (
            "type: armature, velocity: free.w, inertia: 0.2 kg*m^2",
            r"the inertia 0.2 kg m^2 is added to what is felt along \omega^{free}",
        ),
        (
            "type: damper, between: [ground, two], at: [[0, 1 m], [b, 0]], coefficient: 3 N*s/m",
            "damper between the ground at (0, 1) and two at (b, 0): coefficient 3 N s/m",
        ),
        (
            "type: spring, between: [one, two], at: [[0, 1 m], [b, 0]], stiffness: 5 N/m",
            "spring between one at (0, 1) and two at (b, 0): stiffness 5 N/m, length 0 m",
        ),
        (
            "type: bushing, between: [one, two], at: [{position: [0, b], angle: al}, [0, 0]],"
            " stiffness: [1, 2], torsion: 3, torsion_damping: 4",
            "springs and dampers between frames of one at (0, b) and of two at (0, 0): stiffness "
            "(1, 2) N/m, torsional stiffness 3 N m/rad, torsional damping 4 N m s/rad, along the "
            "axes of the frame of one",
        ),
        (
            "type: bushing, between: [one, two], at: [{position: [0, b], angle: al}, [0, 0]],"
            " stiffness: [1, 2]",
            r"F | one | by \alpha",
        ),
        ("type: torque, body: two, components: 2 N*m", "torque on two: 2 N m"),
        (
            "type: wrench, frame: two, force: [1 N, b*(1 N/m)], moment: 3 N*m, axes: frame",
            "wrench on two at (0, 0): force (1, b), moment 3 N m, in its own axes",
        ),
        ("type: wrench, frame: rail, force: [1 N, 2 N]", "force (1, 2) N, in ground axes"),
    ],
)
def test_loads_have_places_and_units(load: str, sentence: str) -> None:
    text = loaded(load, FLAT)
    assert sentence in text and "der(" not in text and "stiffness 0" not in text


def test_whose_axes_points_are_given_in_is_told_where_there_are_points() -> None:
    near = "the following; points (in m) are given in the axes of their body:"
    assert near not in loaded("type: torque, body: two, components: 2 N*m", FLAT)
    assert near in loaded("type: force, body: two, at: [b, 0], components: [1 N, 0]", FLAT)
    assert near in loaded("type: wrench, frame: two, force: [1 N, 0]", FLAT)
    assert "points (in m), axes and normals are given in the axes of their body" in closed("planar")


def test_the_turned_frame_of_a_wrench_is_told() -> None:
    frames = "frames: {tool: {body: one, position: [b, 0, 0], rpy: [0, 30 deg, 0]}}\n"
    text = loaded("type: wrench, frame: tool, force: [1 N, 0, 0], axes: frame", TWO + frames)
    assert "wrench on one at (b, 0, 0): force (1, 0, 0) N, in the axes of its frame" in text
    assert "F | one | by 30° about y" in text


def test_contacts_tell_what_touches_what_and_by_which_law() -> None:
    road = (
        "type: contact, body: one, shape: {wheel: {radius: 0.3 m, axis: y}}, plane: {normal: z},"
        " stiffness: 2e4 N/m, smoothing: 0.1 m/s,"
        " tyre: {longitudinal: {linear: 10}, lateral: {pacejka: [10, 1.9, 2, 0.97]}}"
    )
    text = loaded(road)
    assert "thin disk of one about (0, 0, 0), of radius 0.3 m and with the axis (0, 1, 0)" in text
    assert r"force per pressure 10 s along the wheel, 2 \sin\left(1.9 \arctan" in text
    assert "Of a tyre" in text and "The slip angle" in text and "Friction" not in text
    flat = road.replace(", axis: y", "").replace("body: one", "body: two")
    assert "Of a tyre" in (text := loaded(flat, FLAT)) and "The slip angle" not in text
    bowl = (
        "type: contact, body: one, at: [0, b, 0], surface: z - (0.1 1/m)*(x^2 + y^2), of: two,"
        " stiffness: 1e4 N/m, damping: 0.2 s/m, friction: 0.5, smoothing: 1 cm/s"
    )
    text = loaded(bowl.replace("0.1 1/m", "0.1/(1 m)"))
    assert "the point of one at (0, b, 0) presses on the surface z - 0.1 x^{2}" in text
    assert "stiffness 10000 N/m, damping 0.2 s/m, friction coefficient 0.5" in text
    assert "Where a contact is" in text and "Above a surface" in text and "tyre" not in text


ROPE = """
paths:
  rope:
    - {body: ground, at: [-2 m, 0, 0]}
    - {body: ground, at: [0, 0, 1 m], pulley: {radius: 0.2 m, side: right, axis: y}}
    - {body: two, at: [0, 0, b]}
"""


def test_a_pull_tells_its_path() -> None:
    text = loaded("type: tension, path: rope, tension: 5 N", TWO + ROPE)
    pulley = (
        "over a pulley about (0, 0, 1) of the ground, of radius 0.2 m, clockwise about (0, 1, 0)"
    )
    assert f"pull of 5 N along the shortest path from (-2, 0, 0) of the ground, {pulley}" in text
    assert "to (0, 0, b) of two" in text


EVENTS = """
outputs: {tip: "position(two, [b, 0])", R: reaction(law)}
events:
  hit: {formula: s - b, direction: rising, stop: true}
  fall_back: {formula: der(s), direction: falling}
  near: tip.z
constraints: {law: {holonomic: s - x}}
"""


def test_events_are_told_with_formula_direction_and_stop() -> None:
    text = told(FLAT + EVENTS)
    assert "hit | s - b | rises through zero | the motion ends" in text
    assert r"fall back | \dot{s} | falls through zero | the motion goes on" in text
    assert r"near | b \sin \theta + z | changes its sign | the motion goes on" in text


def test_an_output_that_is_a_reaction_ends_in_a_stop() -> None:
    doc = manuscript(FLAT + EVENTS)
    outputs(doc)
    (section,) = doc.document("m", "", "0").sections
    said = [plain(x.runs) for x in section.blocks if isinstance(x, Paragraph)]
    assert r"R: the multipliers \boldsymbol{\lambda} of law." in said


@pytest.mark.parametrize(
    "value, shown, rounded",
    [("0.1", "0.1", False), ("2.194e-6", r"2.194 \cdot 10^{-6}", False),
     ("-0.123456789012", "−0.123456789012", False), ("1/3", "0.333333333333333", False)],
)  # fmt: skip
def test_values_of_parameters_have_all_digits(value: str, shown: str, rounded: bool) -> None:
    text = told(FLAT.replace("b: 0.1 m", f"b: {value}"))
    assert f"b | {shown} | " in text and ("rounded to six digits" in text) == rounded


def test_what_is_rounded_is_said() -> None:
    text = told(FLAT.replace("mass: 1 kg", "mass: 0.123456789"))
    assert "one | 0.123457 |" in text
    assert "Numbers of these tables, but for the values of parameters, are rounded to six" in text
