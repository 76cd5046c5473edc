"""The figure of a mechanism: of every model it is whole, finite and the same every time, no label
covers another and nothing is cut off.

Of hamel.draw.mechanism: anchors, bodies, figure, forces, joints, marks, notes, placing, points, poses,
records, scene, shifts, solids, state, svg, ties, tikz, typeset, vectors, view, words.
"""

import importlib
import json
import math
import re
import xml.etree.ElementTree as ET
from itertools import combinations, pairwise

import casadi as ca
import numpy as np
import pytest

from derive.mechanics.records import System
from derive.model import load, load_text
from derive.robots import reading
from derive.states import system
from hamel.cli import main
from hamel.draw.mechanism import Figure, figure, picture, placing, svg, tikz
from hamel.draw.mechanism.figure import WIDTH, bounds, framed
from hamel.draw.mechanism.poses import Bodies
from hamel.draw.mechanism.records import Box, Label
from hamel.draw.mechanism.state import configuration
from hamel.draw.mechanism.svg import DARK, LIGHT, TEXT_COLOURS
from hamel.draw.mechanism.typeset import Run, extent, runs
from tests.loops import four_bars
from tests.scenes import MODELS

FILES = sorted(MODELS.glob("*.yaml"))
EXTREMES = sorted((MODELS / "extremes").glob("*.yaml"))
ROBOTS = MODELS.parent / "tests" / "robots"
HUMANOID = """<mujoco model="walker"><worldbody>
<body name="torso" pos="0 0 1.1"><freejoint name="root"/>
  <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.08"/>
  {limbs}
</body></worldbody></mujoco>"""
LIMB = """<body name="{side}_{upper}" pos="0 {y} {z}">
  <joint name="{side}_{first}" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/>
  <body name="{side}_{lower}" pos="0 0 -0.4">
    <joint name="{side}_{second}" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.04"/>
  </body></body>"""


def humanoid() -> str:
    limbs = [
        ("thigh", "shin", "hip", "knee", 0.1, 0.0),
        ("arm", "hand", "shoulder", "elbow", 0.2, 0.4),
    ]
    return HUMANOID.format(
        limbs="\n".join(
            LIMB.format(side=side, upper=u, lower=w, first=a, second=b, y=sign * y, z=z)
            for side, sign in (("left", 1), ("right", -1))
            for u, w, a, b, y, z in limbs
        )
    )


def chain(count: int) -> str:
    bodies = "\n".join(
        f"  b{k}: {{mass: 1 kg, com: [l/2, 0], inertia: 0.01 kg*m^2}}" for k in range(count)
    )
    joints = "\n".join(
        f"  j{k}: {{type: revolute, parent: {'ground' if k == 0 else f'b{k - 1}'}, child: b{k}, "
        f"at: [{'0' if k == 0 else 'l'}, 0], coordinate: q{k}}}"
        for k in range(count)
    )
    return f"model: chain\nplane: xy\ngravity: [0, -9.81 m/s^2]\nparameters: {{l: 0.1 m}}\nbodies:\n{bodies}\njoints:\n{joints}\n"


def overlapping(drawing: Figure) -> list[tuple[str, str]]:
    pairs = combinations(drawing.letterings, 2)
    return [(a.label.latex, b.label.latex) for a, b in pairs if a.box.overlaps(b.box)]


def clipped(drawing: Figure) -> list[str]:
    boxes = [(x.label.latex, x.box) for x in drawing.letterings]
    boxes.append(("marks", bounds(drawing.marks)))
    return [
        name
        for name, box in boxes
        if box.left < 0 or box.top < 0 or box.right > drawing.width or box.bottom > drawing.height
    ]


def check(mechanics: System) -> Figure:
    drawing = figure(mechanics)
    assert not overlapping(drawing) and not clipped(drawing) and not drawing.unplaced
    assert 30 < drawing.width < WIDTH + 30 and 30 < drawing.height < WIDTH
    numbers = [x for mark in drawing.marks for point in mark.points for x in (*point, mark.radius)]
    assert np.isfinite(numbers).all()
    root = ET.fromstring(svg(drawing))
    title, about, *_ = root
    assert title.text and about.text and root.attrib["role"] == "img"
    assert "nan" not in tikz(drawing)
    return drawing


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_label_has_its_place_and_nothing_is_cut_off(path):
    check(system(load(path)))


@pytest.mark.slow
@pytest.mark.parametrize("path", EXTREMES, ids=lambda path: path.stem)
def test_the_same_of_extreme_models(path):
    check(system(load(path)))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*.*")), ids=lambda path: path.name)
def test_the_same_of_robots(path):
    check(system(reading.load(path)))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_small_humanoid(tmp_path):
    (tmp_path / "walker.xml").write_text(humanoid())
    drawing = check(system(reading.load(tmp_path / "walker.xml")))
    assert len(drawing.letterings) >= 8


def test_overlaps_and_cuts_are_seen(monkeypatch):
    """With labels where they are wished for, taken or not, the check above fails."""
    mechanics = system(load(MODELS / "gear_train.yaml"))
    monkeypatch.setattr(placing, "RINGS", (0.0,))
    monkeypatch.setattr(placing, "_directions", lambda label: [45.0])
    monkeypatch.setattr(Box, "overlaps", lambda self, other: False)
    drawing = figure(mechanics)
    monkeypatch.undo()
    assert overlapping(drawing)
    small = Figure(**{**vars(drawing), "width": drawing.width / 2})
    assert clipped(small)


def test_bytes_are_the_same_every_time():
    mechanics = system(load(MODELS / "slider_crank.yaml"))
    assert svg(figure(mechanics)) == svg(figure(mechanics))
    assert tikz(figure(mechanics)) == tikz(figure(mechanics))


def test_poses_are_those_of_the_system():
    """The traced point of the coupler, by the poses and by the System's own output."""
    mechanics = system(load(MODELS / "four_bar.yaml"))
    state = configuration(mechanics)
    name, value, _ = mechanics.outputs[0]
    tip = ca.Function("tip", [mechanics.q, mechanics.p], [value])
    space = framed(mechanics, state)
    traced = dict(space.traced)[name]
    expected = np.asarray(tip(state.q, state.p)).ravel()
    assert space.place(traced)[:2] == pytest.approx(expected, abs=1e-14)
    ends = [space.place(x.spot(0)) - space.place(x.spot(1)) for x in space.anchors]
    assert np.abs(ends).max() < 1e-12


def test_poses_of_many_states_are_those_of_each():
    mechanics = system(load(MODELS / "spatial_four_bar.yaml"))
    bodies, p = Bodies(mechanics), np.array(mechanics.parameters)
    q = configuration(mechanics).q
    many = bodies.many(np.zeros(2), np.array([q, q]), p)
    for row, one in zip(many[1], bodies.at(0.0, q, p)):
        assert row[:9].reshape(3, 3) == pytest.approx(one.rotation)
        assert one.rotation @ one.rotation.T == pytest.approx(np.eye(3))


def test_what_the_initial_state_hides_is_moved_and_told():
    state = configuration(system(load(MODELS / "snake3.yaml")))
    assert set(state.moved) == {"th", "phi1", "phi2"} and "near the initial state" in state.about
    assert configuration(system(load(MODELS / "four_bar.yaml"))).moved == ()


@pytest.mark.parametrize("count", [40, pytest.param(300, marks=pytest.mark.slow)])
def test_long_chains_are_drawn_with_some_of_their_names(count):
    drawing = check(system(load_text(chain(count))))
    names = [x.label.latex for x in drawing.letterings]
    assert {"q_{0}", "q_{1}", f"q_{{{count - 1}}}"} <= set(names) and len(names) < 12
    assert drawing.unnamed == count - 3


SMALL = {
    "one pendulum": "model: m\nplane: xy\nbodies: {a: {mass: 1 kg, com: [1 m, 0]}}\n"
    "joints: {p: {type: revolute, parent: ground, child: a, coordinate: q}}\n",
    "a free body": "model: m\nbodies: {a: {mass: 1 kg, inertia: [1, 2, 2.5]}}\n"
    "joints: {p: {type: free, parent: ground, child: a}}\n",
    "no freedom": "model: m\nplane: xy\nbodies: {a: {mass: 1 kg, com: [1 m, 0]}}\n"
    "joints: {p: {type: revolute, parent: ground, child: a, coordinate: q}}\n"
    "constraints: {c: {holonomic: q - 1}}\n",
    "a wheel on a slope": "model: m\nplane: xy\nbodies: {a: {mass: 1 kg, inertia: 0.01}}\n"
    "joints: {p: {type: planar, parent: ground, child: a, coordinates: [x, y, th]}}\n"
    "constraints: {c: {type: rolling, body: a, shape: {disk: {radius: 0.2 m}}, "
    "plane: {normal: [0.3, 1]}}}\ninitial: {guess: {y: 0.2 m}}\n",
    "two points": "model: m\nplane: xy\nbodies: {a: {mass: 1 kg}, b: {mass: 2 kg}}\n"
    "joints: {p: {type: prismatic, axis: x, parent: ground, child: a, coordinate: s}, "
    "r: {type: prismatic, axis: y, parent: a, child: b, coordinate: h}}\n"
    "loads: {k: {type: spring, between: [ground, b], at: [[0, 1 m], [0, 0]], stiffness: 3 N/m, length: 1 m}}\n",
    "coordinates alone": "model: m\ncoordinates: {a: rad, s: m}\nkinetic: der(a)^2*1 kg*m^2 + der(s)^2*1 kg\n",
}


@pytest.mark.parametrize("text", SMALL.values(), ids=SMALL.keys())
def test_small_models(text):
    check(system(load_text(text)))


@pytest.mark.parametrize("unit", ["um", "km"])
def test_size_does_not_matter(unit):
    """The same mechanism a billion times as large is the same drawing."""
    text = (MODELS / "four_bar.yaml").read_text().replace("0.1 m]", f"0.1 {unit}]")
    text = re.sub(r"(l\d: \{value: [\d.]+) m", rf"\1 {unit}", text)
    scaled, usual = (
        check(system(load_text(x))) for x in (text, (MODELS / "four_bar.yaml").read_text())
    )
    assert scaled.width == pytest.approx(usual.width, abs=0.5)
    assert len(scaled.marks) == len(usual.marks)


@pytest.mark.parametrize("colours", [LIGHT, DARK], ids=["light", "dark"])
def test_letters_can_be_read_by_day_and_by_night(colours):
    def luminance(colour: str) -> float:
        parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    for ground in ("paper", "plate", "fill", "floor"):
        for ink in TEXT_COLOURS:
            high, low = sorted((luminance(colours[ground]), luminance(colours[ink])), reverse=True)
            assert (high + 0.05) / (low + 0.05) >= 4.5, (ground, ink)


def test_names_are_typeset():
    assert runs(r"\theta_{1}") == (Run("θ", "italic"), Run("1", "upright", -1))
    assert runs(r"\mathrm{rear\_spin}") == (
        Run("rear", "upright"),
        Run(" ", "upright"),
        Run("spin", "upright"),
    ) or runs(r"\mathrm{rear\_spin}") == (Run("rear spin", "upright"),)
    assert [x.level for x in runs(r"v_{x}^{\mathrm{base}}")] == [0, -1, 1]
    widths = [extent(text)[0] for text in ("q", "q_{1}", r"q_{12}", r"\mathrm{rocker}")]
    assert all(a < b for a, b in pairwise(widths))


def test_a_label_without_room_goes_further_and_is_led_to():
    labels = [Label(r"\mathrm{wide}", "joint", (0.0, 0.0)) for _ in range(40)]
    letterings, left = placing.placed(labels, [])
    boxes = [x.box for x in letterings]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert len(letterings) + len(left) == 40 and len(letterings) > 20
    assert any(x.leader for x in letterings) and math.isfinite(boxes[-1].left)


def test_the_verb_writes_svg_and_tikz(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = str(MODELS / "pendulum.yaml")
    for arguments, place in (
        (["draw", path], "pendulum.svg"),
        (["draw", path, "-o", "a/b.tex"], "a/b.tex"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([*arguments, "--json"])
        assert ended.value.code == 0
        assert json.loads(capsys.readouterr().out)["file"] == place
    assert ET.parse("pendulum.svg").getroot().tag.endswith("svg")
    assert (tmp_path / "a" / "b.tex").read_text().startswith(r"\definecolor")
    with pytest.raises(SystemExit) as ended:
        main(["draw", path, "-o", "figure.png"])
    assert ended.value.code == 1 and ".svg or .tex" in capsys.readouterr().err


def test_named_frames_are_drawn_with_their_names():
    text = SMALL["one pendulum"] + "frames: {tool: {body: a, position: [1 m, 0]}}\n"
    with_frame, without = (check(system(load_text(x))) for x in (text, SMALL["one pendulum"]))
    names = [x.label.latex for x in with_frame.letterings]
    assert r"\mathrm{tool}" in names and len(with_frame.marks) > len(without.marks)


def test_a_wrench_is_a_force_and_a_moment_at_its_frame():
    text = SMALL["one pendulum"] + "frames: {tool: {body: a, position: [1 m, 0]}}\n"
    text += "loads: {W: {type: wrench, frame: tool, force: [1 N, 0], moment: 2 N*m}}\n"
    drawing = check(system(load_text(text)))
    assert [x.label.style for x in drawing.letterings if x.label.latex == "W"] == ["input"] * 2


def test_a_page_stands_without_a_figure_that_cannot_be_drawn():
    text = "model: m\ncoordinates: {x: m}\nkinetic: der(x)^2*1 kg\nconstraints: {c: {holonomic: x^2 + 1 m^2}}\n"
    assert picture(system(load_text(text))) is None


@pytest.mark.parametrize(("loops", "drawn"), [(24, True), (25, False)])
def test_of_very_many_links_nothing_could_be_told_apart(
    loops: int, drawn: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From 250; of fifty, too, where that is the limit."""
    monkeypatch.setattr(importlib.import_module("hamel.draw.mechanism.figure"), "LONG", 50)
    of = system(load_text(four_bars(loops)))
    assert (len(of.links) >= 50) != drawn
    assert (picture(of) is not None) == drawn


def test_coordinates_are_called_as_the_file_says_and_as_the_derivation_does() -> None:
    """`symbol:` of a joint reaches its figure, accents and all."""
    text = (MODELS / "rolling_disk.yaml").read_text("utf-8")
    drawn = svg(figure(system(load_text(text))))
    assert ">ψ<" in drawn and ">θ<" in drawn and "yaw" not in re.sub(r"<desc.*?</desc>", "", drawn)
    hat = load_text(text.replace(r"\psi", r"'\hat{x}'"))
    assert "x\u0302" in svg(figure(system(hat)))


TWINS = """
model: twins
plane: xy
bodies: {a: {mass: 1}, b: {mass: 1}}
joints:
  j1: {type: prismatic, parent: ground, child: a, axis: x, coordinate: q1}
  j_1: {type: prismatic, parent: ground, child: b, axis: y, coordinate: q_1}
inputs: {u1: {joint: j1}, u_1: {joint: j_1}}
"""


def test_names_are_those_of_the_derivation() -> None:
    labels = [x.label.latex for x in figure(system(load_text(TWINS))).letterings]
    assert {"q_{1}", r"\mathrm{q\,1}", "u_{1}", r"\mathrm{u\,1}"} <= set(labels)


BALL = """
model: ball
plane: xz
gravity: [0, -9.81 m/s^2]
bodies: {plank: {mass: 1 kg, com: [0.3 m, 0], inertia: 0.03}, ball: {mass: 1 kg, inertia: 0.004}}
joints:
  hinge: {type: revolute, parent: ground, child: plank, coordinate: tilt}
  fall: {type: planar, parent: ground, child: ball, coordinates: [x, z, turn]}
loads:
  touch:
    type: contact
    body: ball
    shape: {sphere: {radius: 0.1 m}}
    plane: {normal: z, of: CARRIER}
    stiffness: 1e4 N/m
initial: {x: 0.3 m, z: 0.5 m, tilt: 20 deg}
"""


@pytest.mark.parametrize(("carrier", "slope"), [("ground", 0.0), ("plank", math.tan(math.pi / 9))])
def test_what_is_touched_is_a_hatched_line(carrier: str, slope: float) -> None:
    """It is the plane of the contact, of the ground or of a body."""
    mechanics = system(load_text(BALL.replace("CARRIER", carrier)))
    lines = [x for x in figure(mechanics).marks if x.style == "ground" and len(x.points) == 2]
    (x0, y0), (x1, y1) = max(lines, key=lambda x: math.dist(*x.points)).points
    assert -(y1 - y0) / (x1 - x0) == pytest.approx(slope, abs=1e-6)


def test_steered_wheels_are_no_gears() -> None:
    text = """
model: board
plane: xy
bodies: {board: {mass: 6 kg, inertia: 0.8}, front: {inertia: 0.03, mass: 0}, back: {inertia: 0.03, mass: 0}}
joints:
  base: {type: planar, parent: ground, child: board, coordinates: [x, y, theta]}
  f: {type: revolute, parent: board, child: front, at: [0.4 m, 0], coordinate: a}
  b: {type: revolute, parent: board, child: back, at: [-0.4 m, 0], coordinate: c}
constraints:
  opposite: {holonomic: a + c}
  fw: {type: no_slip, body: front, at: [0, 0], direction: y}
  bw: {type: no_slip, body: back, at: [0, 0], direction: y}
"""
    skates = "  fw: {type: no_slip, body: front, at: [0, 0], direction: y}\n"
    skates += "  bw: {type: no_slip, body: back, at: [0, 0], direction: y}\n"
    circles = [
        sum(mark.style == "pitch" for mark in figure(system(load_text(given))).marks)
        for given in (text, text.replace(skates, ""))
    ]
    assert circles == [0, 2]
