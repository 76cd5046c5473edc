"""Loops are closed where the joints of the file are, not where their rows vanish as well.

Of derive.states: initial, closing.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.many import starter
from derive.states.sampling import states
from hamel.verify.checks.identities import newton_step
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence

PLANE = """
model: slab
plane: xy
bodies: {{b: {{mass: 1 kg, inertia: 0.1}}}}
joints: {{loose: {{type: planar, parent: ground, child: b, coordinates: [x, y, a]}}}}
closures: {{c: {{type: {kind}, between: [ground, b], at: [[0, 0], [0, 0]], angle: {angle} deg{axis}}}}}
"""
SPACE = """
model: slab
bodies: {{b: {{mass: 1 kg, inertia: 0.1}}}}
joints: {{loose: {{type: free, parent: ground, child: b, position: [x, y, z]}}}}
closures: {{c: {{type: {kind}, between: [ground, b], at: [[0, 0, 0], [0, 0, 0]], axis_angle: [[{e}], {angle} deg]{axis}}}}}
"""
STILL = {
    "universal": """
model: still
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: free, parent: ground, child: A, position: [x, y, z]}}
closures:
  u: {type: universal, between: [ground, A], at: [[0, 0, 0], [0, 0, 0]], axis: x, axis2: y, rpy: [0, 0, -90 deg]}
""",
    "distance": """
model: still
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: planar, parent: ground, child: A, coordinates: [x, y, a]}}
constraints: {d: {type: distance, between: [ground, A], at: [[0, 0], [0, 0]], length: 1 m}}
""",
}
FLAT = """
model: flat
gravity: [0, 0, -9.81]
bodies: {A: {mass: 1 kg, inertia: [0.1, 0.2, 0.1]}}
joints: {ja: {type: free, parent: ground, child: A, position: [x, y, z]}}
constraints: {d: {type: rolling, body: A, shape: {disk: {radius: 0.1 m, axis: z}}, plane: {normal: z}}}
"""


def _read(tmp_path, text):
    path = tmp_path / "m.yaml"
    path.write_text(text)
    return system(load(path), "all")


def _turn(axis, angle):
    """Rodrigues, written out anew."""
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def _turn_of(quaternion):
    w, *e = quaternion
    return _turn(np.array(e), 2 * np.arctan2(np.linalg.norm(e), w)) if any(e) else np.eye(3)


@pytest.mark.parametrize("angle", [0, 40, 90, 100, 179, 180, 200, 270, -150])
@pytest.mark.parametrize("kind, axis", [("fixed", ""), ("prismatic", ", axis: x")])
def test_in_a_plane_a_weld_and_a_slide_are_turned_as_the_file_says(tmp_path, kind, axis, angle):
    found = _read(tmp_path, PLANE.format(kind=kind, axis=axis, angle=angle))
    turned = initial_state(found).q[2] - np.radians(angle)
    assert abs(np.angle(np.exp(1j * turned))) < 1e-9


@pytest.mark.parametrize("angle", [0, 60, 90, 100, 120, 170, 180, 225])
@pytest.mark.parametrize("e", ["1, 0, 0", "0, 0, 1", "1, 2, -0.5"])
@pytest.mark.parametrize("kind, axis", [("fixed", ""), ("prismatic", ", axis: z")])
def test_in_space_a_weld_and_a_slide_are_turned_as_the_file_says(tmp_path, kind, axis, e, angle):
    found = _read(tmp_path, SPACE.format(kind=kind, axis=axis, angle=angle, e=e))
    q = initial_state(found).q
    wanted = _turn(np.array([float(x) for x in e.split(",")]), np.radians(angle))
    assert np.abs(_turn_of(q[3:7]) - wanted).max() < 1e-9


@pytest.mark.parametrize("kind", STILL)
def test_a_start_without_a_slope_is_left(tmp_path, kind):
    found = _read(tmp_path, STILL[kind])
    one = initial_state(found)
    many = starter(found, ())({}, np.array([found.parameters]))
    assert many.closed[0] and np.abs(many.q[0] - one.q).max() < 1e-9


def test_a_disk_that_lies_flat_touches_nowhere(tmp_path):
    found = _read(tmp_path, FLAT)
    with pytest.raises(
        ModelError, match=r"no configuration near .* \(d\.normal has no value there\)"
    ):
        initial_state(found)
    assert not starter(found, ())({}, np.array([found.parameters])).closed[0]


def test_what_cannot_be_welded_is_refused_by_name(tmp_path):
    text = PLANE.format(kind="fixed", axis="", angle=100).replace("type: planar", "type: revolute")
    text = text.replace("coordinates: [x, y, a]", "coordinate: a")
    text = text.replace("at: [[0, 0], [0, 0]]", "at: [[1, 0], [0, 0]]")
    found = _read(tmp_path, text)
    with pytest.raises(ModelError, match=r"no configuration near .* \(c\.x is off by -1\)") as told:
        initial_state(found)
    with pytest.raises(ModelError) as also:  # deriving needs states too, and has no more to say
        equations(found)
    assert str(also.value) == str(told.value) and also.value.diagnostics[0].line > 0


STEEP = """
model: steep
plane: xy
parameters: {l: 1 m}
bodies: {a: {mass: 1 kg, inertia: 0.1}, b: {mass: 2 kg, inertia: 0.1}}
joints:
  P: {type: prismatic, parent: ground, child: a, axis: x, coordinate: x}
  R: {type: revolute, parent: ground, child: b, coordinate: q}
constraints: {c: {holonomic: "acos(x/l) - q"}}
initial: {x: 1 m, guess: {q: 0}}
"""


def test_a_start_that_holds_but_has_no_finite_slope_is_told(tmp_path):
    found = _read(tmp_path, STEEP)
    with pytest.raises(ModelError, match="constraint row c has no finite slope at the initial"):
        initial_state(found)


LEANING = """
model: leaning
bodies: {b: {mass: 1 kg, inertia: 0.1}}
parameters: {al: ANGLE deg}
joints: {loose: {type: free, parent: ground, child: b}}
closures: {c: {type: KIND, between: [ground, b], at: [[0, 0, 0], [0, 0, 0]], axis: z, rpy: [al, 0, 0]MORE}}
"""


@pytest.mark.parametrize("angle", [90, -90, 180])
@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("revolute", ""),
        ("cylindrical", ""),
        ("planar", ""),
        ("screw", ", pitch: 0.1"),
        ("prismatic", ""),
    ],
)
def test_rows_without_slope_at_the_start_are_closed_as_well_as_others(kind, more, angle):
    text = LEANING.replace("ANGLE", str(angle)).replace("KIND", kind).replace("MORE", more)
    found = equations(system(load_text(text)))
    s, project = found.system, evaluator(found)
    start = initial_state(s)
    x = project("state", 0.0, start.whole, np.zeros(0), np.array(s.parameters))
    value = project("project", 0.0, x, np.zeros(0), np.array(s.parameters))
    assert np.isfinite(value).all() and np.abs(value - x).max() < 1e-9


def test_states_drawn_around_a_slide_that_starts_far_off_are_closed(tmp_path):
    found = _read(tmp_path, PLANE.format(kind="prismatic", axis=", axis: x", angle=-135))
    drawn = states(found, 50, seed=0)
    phi = ca.Function("phi", [found.t, found.q, found.p], [found.phi])
    off = [np.abs(phi(t, q, p).full()).max() for t, q, p in zip(drawn.t, drawn.q, drawn.p)]
    assert len(off) == 50 and max(off) < 1e-11


TWICE = """
model: twice
plane: xy
bodies: {{a: {{mass: 1 kg, inertia: 1}}}}
joints: {{A: {{type: revolute, parent: ground, child: a, coordinate: q}}}}
initial: {{q: 0}}
constraints:
  p: {{type: prescribed, coordinate: q, motion: {first}}}
  p2: {{type: prescribed, coordinate: q, motion: {second}}}
"""


@pytest.mark.parametrize(
    ("first", "second", "when"),
    [("sin((2 rad/s)*t)", "(2 rad/s)*t", " at t = 0.1 s"), ("1", "2", "")],
)
def test_constraints_that_contradict_each_other_are_named(first, second, when, tmp_path):
    twice = _read(tmp_path, TWICE.format(first=first, second=second))
    with pytest.raises(ModelError) as told:
        equations(twice, "auto")
    wanted = f"satisfies the constraints{when}: p and p2 contradict each other"
    assert wanted in (found := told.value.diagnostics[0]).message
    assert (found.line, found.column) == (9, 3)


def test_a_coordinate_may_be_prescribed_twice_alike(tmp_path):
    twice = _read(tmp_path, TWICE.format(first="(2 rad/s)*t", second="(2 rad/s)*t"))
    assert equations(twice, "auto").w == ()


WELDED = """
model: welded
bodies: {{A: {{mass: 1 kg, inertia: [0.1, 0.2, 0.25]}}, B: {{mass: 2 kg, inertia: 0.1}}}}
joints:
  ja: {{type: free, parent: ground, child: A}}
  jb: {{type: free, parent: ground, child: B}}
closures: {{c: {{type: {kind}, between: [A, B], at: [[0.5, 0.1, 0], [0, 0, 0.2]]{axis}}}}}
initial: {{guess: {{jb_x: 0.5 m}}}}
"""


@pytest.mark.parametrize("kind, axis", [("fixed", ""), ("prismatic", ", axis: [1, 2, 2]")])
def test_projection_undoes_any_turn_up_to_half_a_turn(kind, axis):
    """The sines of the turn vanish half a turn away, too: from 90° on it was there that `project`
    went, and from less about some axes."""
    of = evaluator(equations(system(load_text(WELDED.format(kind=kind, axis=axis)))))
    rng, x = np.random.default_rng(0), np.zeros(of.equations.arguments[1].symbols.numel())
    u = p = np.zeros(0)
    for angle in (30, 60, 85, 90, 95, 120, 150, 170, 179):
        for _ in range(5):
            e, a, x[:14] = rng.normal(size=3), rng.normal(size=4), rng.normal(size=14)
            x[3:7] = a / np.linalg.norm(a)
            x[10:14] = _product(x[3:7], [np.cos(np.radians(angle) / 2), *_sines(e, angle)])
            x[7:10] = x[:3] + 0.1 * x[7:10] + _turn_of(x[3:7]) @ [0.5, 0.1, 0]
            q = of.iterated("project", 0.0, x, u, p)
            assert np.abs(_turn_of(q[3:7]) - _turn_of(q[10:14])).max() < 1e-9
    x[:14] = [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0]
    assert np.isnan(of.iterated("project", 0.0, x, u, p)).any()


def _sines(e, angle):
    return np.sin(np.radians(angle) / 2) * e / np.linalg.norm(e)


def _product(a, b):
    (w, *e), (W, *E) = a, b
    return [w * W - np.dot(e, E), *(w * np.array(E) + W * np.array(e) + np.cross(e, E))]


@pytest.mark.parametrize("kind, axis", [("fixed", ""), ("prismatic", ", axis: [1, 2, 2]")])
def test_a_step_of_projection_is_the_reference_s(kind, axis):
    """Which has the turn from the quaternion of the relative attitude; by φ it is another step."""
    mechanics = system(load_text(WELDED.format(kind=kind, axis=axis)))
    seen = evidence(reference(mechanics.model), equations(mechanics), None, 3)
    assert newton_step(seen) < 1e-10
    whole = replace(mechanics, excess=mechanics.phi)
    assert newton_step(evidence(reference(mechanics.model), equations(whole), None, 3)) > 1e-4
