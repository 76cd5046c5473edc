"""`frames:` and wrenches in model files: what is read, what is refused with which words.

Of derive.model.mechanism: named_frames. Of its loads: derive.model.loads.wrench, derive.mechanics.loads.wrench.
"""

import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.model import load_text
from derive.model.mechanism.named_frames import FAMILIES, TAKEN, frame_named, frames_of, readings
from derive.robots.reading import load
from tests.scenes import ROOT

ROD = """
model: rod
gravity: [0, 0, -9.81 m/s^2]
bodies: {rod: {mass: 1 kg, com: [0.5, 0, 0], inertia: 0.1}}
joints: {hinge: {type: revolute, parent: ground, child: rod, axis: y}}
"""


def refused(text: str) -> str:
    with pytest.raises(ModelError) as caught:
        load_text(ROD + text)
    return str(caught.value)


def test_bodies_joints_and_the_ground_are_frames_without_being_declared():
    model = load_text(ROD + "frames: {tip: {body: rod, position: [1, 0, 0], rpy: [0, 90 deg, 0]}}")
    assert list(frames_of(model)) == ["ground", "rod", "hinge", "tip"]
    assert frame_named(model, "hinge").body == "rod"
    assert frame_named(model, "tip").at.rotation is not None


def test_every_link_and_joint_of_a_robot_file_is_a_frame():
    model = load(ROOT / "tests/robots/arm.urdf")
    known = frames_of(model)
    assert {body.name for body in model.bodies} | {joint.name for joint in model.joints} <= {*known}


def test_a_frame_on_the_ground_and_one_in_a_plane():
    planar = """
model: planar
plane: xz
bodies: {a: {mass: 1 kg, inertia: 0.1}}
joints: {A: {type: revolute, parent: ground, child: a}}
frames: {wall: {body: ground, position: [1, 2]}, tool: {body: a, angle: 30 deg}}
"""
    assert frame_named(load_text(planar), "wall").body == "ground"


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ("{tip: {body: rodd}}", "unknown body 'rodd'"),
        ("{tip: {body: rodd}}", "did you mean 'rod'?"),
        ("{tip: {position: [1, 0, 0]}}", "body"),
        ("{tip: {body: rod, positon: [1, 0, 0]}}", "positon"),
        ("{tip: {body: rod, position: [1, 0]}}", "3"),
        ("{tip: {body: rod, position: [hinge, 0, 0]}}", "a coordinate"),
        ("{tip: {body: rod, angle: 30 deg}}", "'angle' in space"),
        ("{rod: {body: rod}}", "the frame 'rod' has the name of a body"),
        ("{hinge: {body: rod}}", "the frame 'hinge' has the name of a joint"),
        ("{u: {body: rod}}", "the frame 'u' would make jacobian_u ambiguous"),
        (
            "{hand: {body: rod}, local_hand: {body: rod}}",
            "would make jacobian_local_hand ambiguous",
        ),
        ("{for: {body: rod}}", "keyword"),
    ],
)
def test_what_is_wrong_with_a_frame_is_said_where_it_stands(frames, words):
    said = refused(f"frames: {frames}")
    assert words in said and "^" in said


def test_a_body_and_a_joint_of_one_name_are_one_frame_only_where_they_agree():
    same = ROD.replace("hinge:", "rod:")
    assert "rod" in frames_of(load_text(same))
    moved = same.replace("axis: y", "axis: y, at: {child: {position: [0.1, 0, 0]}}")
    model = load_text(moved)
    assert "rod" not in frames_of(model)
    with pytest.raises(AssumptionError, match="a body and a joint of rod, whose frames differ"):
        frame_named(model, "rod")


def test_names_of_functions_are_read_one_way():
    known = {"hand", "u", "world_hand"}
    assert readings("pose_hand", known) == [("pose", "hand")]
    assert readings("jacobian_w_local_hand", known) == [("jacobian_w_local", "hand")]
    assert len(readings("jacobian_world_hand", known)) == 2
    assert all(readings(name, known) == [] for name in TAKEN)
    assert readings("jacobian", known) == readings("pose_", known) == []
    assert all(
        readings(f"{family}_u", known) == [(family, "u")]
        for family in FAMILIES[2:]
        if f"{family}_u" not in TAKEN
    )


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ("{type: wrench, frame: tpi, force: [1 N, 0, 0]}", "did you mean 'tip'?"),
        ("{type: wrench, frame: ground, force: [1 N, 0, 0]}", "a wrench on the ground"),
        ("{type: wrench, frame: tip}", "the wrench 'push' has no components"),
        ("{type: wrench, frame: tip, force: [1 N, 0]}", "3"),
        ("{type: wrench, frame: tip, moment: 1 N*m}", "a torque with 1 component"),
        ("{type: wrench, frame: tip, force: [1 m, 0, 0]}", "N"),
        ("{type: wrench, frame: tip, force: [1 N, 0, 0], axes: body}", "ground"),
    ],
)
def test_what_is_wrong_with_a_wrench_is_said_where_it_stands(load, words):
    said = refused(f"frames: {{tip: {{body: rod}}}}\nloads: {{push: {load}}}")
    assert words in said and "^" in said
