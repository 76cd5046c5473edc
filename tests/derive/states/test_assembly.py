"""Loops are closed where the joints of the file are, not where their rows vanish as well.

Of derive.states: initial, closing.
"""

from __future__ import annotations

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.model import load
from derive.states import system
from derive.states.initial import initial_state
from derive.states.many import starter

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
    with pytest.raises(ModelError, match=r"no configuration near .* \(c\.x is off by -1\)"):
        initial_state(found)
