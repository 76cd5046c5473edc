"""Point joints and inertia without mass: the same as written by hand, and as the reference has them.

Of derive.joints: point.
"""

import numpy as np
import pytest

from derive import joints
from derive.model import load_text
from derive.states import system
from hamel.verify.reference import joints as reference_joints
from tests.agreement import difference, disagreement, places, terms

POINT = """
model: point
plane: {plane}
gravity: [0, -9.81 m/s^2]
bodies:
  base: {{mass: 3 kg, inertia: 0.2, com: [0.1, 0.05]}}
  bob: {{mass: 2 kg, com: [0.2, -0.1], inertia: 0.05}}
  rotor: {{mass: 0, inertia: 0.3}}
joints:
  turn: {{type: revolute, parent: ground, child: base, coordinate: a}}
  slide: {{type: point, parent: base, child: bob, at: [[0.3, 0], [0, 0.1]], angle: 20 deg, coordinates: [p1, p2]}}
  spin: {{type: revolute, parent: bob, child: rotor, at: [0.1, 0.2], coordinate: s}}
loads:
  k: {{type: spring, between: [base, bob], at: [[0, 0], [0, 0]], stiffness: 30 N/m}}
  d: {{type: damper, coordinate: p1, coefficient: 3 N*s/m}}
"""
BY_HAND = """  first: {{type: prismatic, parent: base, child: between, at: [0.3, 0], angle: 20 deg, axis: {0}, coordinate: p1}}
  slide: {{type: prismatic, parent: between, child: bob, at: [[0, 0], [0, 0.1]], axis: {1}, coordinate: p2}}
"""
SPACE = """
model: in_space
gravity: [0, 0, -9.81 m/s^2]
bodies: {plate: {mass: 3 kg, inertia: [0.2, 0.3, 0.4]}, puck: {mass: 1 kg, com: [0.1, 0, 0.2], inertia: 0.01}}
joints:
  base: {type: ball, parent: ground, child: plate}
  slide: {type: point, parent: plate, child: puck, at: [0.1, 0.2, 0.3], rpy: [0.1, 0.2, 0.3], axis: AXIS}
"""


def by_hand(plane: str) -> str:
    text = POINT.format(plane=plane)
    lines = text.splitlines(keepends=True)
    slides = BY_HAND.format(*plane)
    text = "".join(slides if line.startswith("  slide:") else line for line in lines)
    return text.replace("  rotor:", "  between: {mass: 0}\n  rotor:")


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_a_point_joint_is_two_slides(plane: str) -> None:
    one, two = system(load_text(POINT.format(plane=plane))), system(load_text(by_hand(plane)))
    for place in places(one):
        got, wanted = terms(one, place), terms(two, place)
        assert difference(got["vdot"], wanted["vdot"]) < 1e-12


@pytest.mark.parametrize(
    "text", [POINT.format(plane="xz"), *(SPACE.replace("AXIS", x) for x in ("x", "-y", "z"))]
)
def test_agrees_with_the_reference(text: str) -> None:
    worst = disagreement(text)
    assert max(worst.values()) < 1e-12, worst


def test_a_wrong_point_joint_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that goes along its second axis a thousandth too far."""
    right = reference_joints.point

    def wrong(q, v, axis):
        return right(q * [1.0, 1.001], v, axis)

    monkeypatch.setitem(reference_joints._TABLE, "point", wrong)
    assert disagreement(POINT.format(plane="xz"))["vdot"] > 1e-7


def test_inertia_without_mass_is_an_armature_where_only_it_turns() -> None:
    rotor = POINT.format(plane="xz").replace("a}", "a, armature: 0}")
    model = load_text(rotor)
    assert any("'rotor' has inertia but no mass" in note for note in model.notes)
    found = system(model)
    M = terms(found, places(found, 1)[0])["M"]
    assert M[3, 3] == pytest.approx(0.3, rel=1e-15)
    assert np.allclose(M[3, 1:3], 0.0, atol=1e-15)  # no mass: pushing its axle does not feel it


def test_the_table_of_joints_has_it_in_both_derivations() -> None:
    assert "point" in {joint.name for joint in joints.JOINTS}
    assert "point" in joints.PLANAR_JOINTS and "point" not in joints.CLOSURES
