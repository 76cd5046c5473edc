"""Robots from URDF and MJCF: what they become, against kinematics written anew here; and one
message for each bad file.

Of derive.robots: limits.
Of derive.robots: couplings, inertias, robot, urdf, writing.
Of derive.robots.mjcf: actuators, bodies, settings, sites, ties.
"""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hamel
from derive.diagnostics import ModelError
from derive.expressions.evaluate import number
from derive.formulations import equations
from derive.model import load_text
from derive.robots import markup, mjcf, rotations
from derive.robots.mjcf import inertia
from derive.robots.naming import Names, legal
from derive.robots.numbers import written
from derive.robots.reading import imported, load
from derive.states import system
from derive.states.closing import Kinematics
from hamel.cli import main
from tests.scenes import MODELS

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
URDF = {"arm": False, "gripper": False, "quadruped": True, "carriage": False}
LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>\n'


def vector(element, attribute, otherwise="0 0 0"):
    text = element.get(attribute) if element is not None else None
    return np.array((text or otherwise).split(), dtype=float)


def turn(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def placed(element):
    """Position and rotation of an <origin>."""
    origin = element.find("origin") if element is not None else None
    roll, pitch, yaw = vector(origin, "rpy")
    return vector(origin, "xyz"), turn(np.array([0, 0, 1.0]), yaw) @ turn(
        np.array([0, 1.0, 0]), pitch
    ) @ turn(np.array([1.0, 0, 0]), roll)


def from_quaternion(q):
    w, *e = q / np.linalg.norm(q)
    x, y, z = e
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def moved(kind, axis, q):
    """Position and rotation of a joint with the coordinates q."""
    if kind == "prismatic":
        return q[0] * axis / np.linalg.norm(axis), np.eye(3)
    if kind in ("revolute", "continuous"):
        return np.zeros(3), turn(axis, q[0])
    if kind == "floating":
        return q[:3], from_quaternion(q[3:])
    if kind == "planar":
        across = np.cross([0, 0, 1.0], axis)
        frame = turn(across, math.acos(axis[2])) if across.any() else np.eye(3)
        return frame @ [q[0], q[1], 0.0], turn(axis, q[2])
    return np.zeros(3), np.eye(3)


class Tree:
    """A URDF read anew: centres of mass, orientations and energies at coordinates given by joint
    name."""

    def __init__(self, file, floating):
        self.root = ElementTree.parse(file).getroot()
        self.joints = {
            joint.find("child").get("link"): joint for joint in self.root.findall("joint")
        }
        self.floating = floating

    def pose(self, name, q):
        joint = self.joints.get(name)
        if joint is None:
            return moved("floating", None, q[""]) if self.floating else (np.zeros(3), np.eye(3))
        place, rotation = self.pose(joint.find("parent").get("link"), q)
        at, turned = placed(joint)
        shift, spin = moved(
            joint.get("type"), vector(joint.find("axis"), "xyz", "1 0 0"), q[joint.get("name")]
        )
        return place + rotation @ (at + turned @ shift), rotation @ turned @ spin

    def bodies(self, q):
        """(mass, centre of mass, orientation of the inertia's axes, tensor) of every link that has
        one."""
        for link in self.root.findall("link"):
            inertial = link.find("inertial")
            if inertial is not None:
                (place, rotation), (com, axes) = self.pose(link.get("name"), q), placed(inertial)
                i = inertial.find("inertia").attrib
                tensor = np.array(
                    [[i[f"i{min(a, b)}{max(a, b)}"] for b in "xyz"] for a in "xyz"], dtype=float
                )
                yield (
                    float(inertial.find("mass").get("value")),
                    place + rotation @ com,
                    rotation @ axes,
                    tensor,
                )

    def potential(self, q):
        return sum(mass * 9.81 * place[2] for mass, place, _, _ in self.bodies(q))

    def kinetic(self, before, after, step):
        """From two poses a small time apart, about the middle."""
        total = 0.0
        for (mass, r0, R0, tensor), (_, r1, R1, _) in zip(self.bodies(before), self.bodies(after)):
            spin = (R0.T @ R1 - R1.T @ R0) / (2 * step)
            omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            velocity = (r1 - r0) / step
            total += 0.5 * mass * velocity @ velocity + 0.5 * omega @ tensor @ omega
        return total


def by_joint(found, q):
    """Our coordinates by the names of the file's joints; those of a free base under ""."""
    values = {name: [] for name in found.joints} | {"": []}
    ours = {own: name for name, own in found.joints.items()}
    for coordinate, value in zip(found.model.coordinates, q):
        values[ours.get(coordinate.owner, "")].append(value)
    return {name: np.array(value) for name, value in values.items()}


@pytest.mark.parametrize(("name", "floating"), URDF.items())
def test_energies_are_those_of_the_file(name, floating):
    """T = ½ vᵀ M v and V against poses computed from the XML, at random states."""
    file = ROBOTS / f"{name}.urdf"
    found, tree = imported(file, floating), Tree(file, floating)
    s = system(found.model)
    f = ca.Function("f", [s.q, s.v], [s.T, s.V, ca.densify(s.M), s.qdot])
    rng, step = np.random.default_rng(3), 1e-5
    heights = []  # V and its reference differ by what lies on the ground
    for _ in range(5):
        q, v = rng.normal(size=s.q.numel()), rng.normal(size=s.v.numel())
        T, V, M, qdot = (np.asarray(x) for x in f(q, v))
        heights.append(V.item() - tree.potential(by_joint(found, q)))
        assert T.item() == pytest.approx(0.5 * v @ M @ v, rel=1e-12)
        qdot = qdot.ravel()
        before, after = (by_joint(found, q + sign * step / 2 * qdot) for sign in (-1, 1))
        assert T.item() == pytest.approx(tree.kinetic(before, after, step), rel=1e-7)
    assert np.ptp(heights) < 1e-9


@pytest.mark.parametrize("name", URDF)
def test_every_link_and_joint_becomes_a_body_and_a_joint(name):
    file = ROBOTS / f"{name}.urdf"
    found, root = imported(file), ElementTree.parse(file).getroot()
    assert len(found.model.bodies) == len(root.findall("link"))
    assert len(found.model.joints) == len(root.findall("joint")) + 1  # and one at the root
    assert set(found.joints) == {joint.get("name") for joint in root.findall("joint")}


def test_the_written_model_reads_back_and_goes_on_being_edited(tmp_path):
    record = hamel.import_(ROBOTS / "arm.urdf", out=tmp_path / "arm.yaml")
    again = load_text((tmp_path / "arm.yaml").read_text())
    assert [body.name for body in again.bodies] == [
        "base_link",
        "upper_arm",
        "fore_arm",
        "wrist",
        "tool",
        "tip",
    ]
    assert record.joints["elbow"] == "elbow" and record.velocities == 3


def test_limits_damping_and_friction_are_kept():
    text = imported(ROBOTS / "arm.urdf").text
    assert (
        "limits: [-2.9, 2.9]" in text
        and "damper: 0.5" in text
        and "friction: {coulomb: 0.3, smoothing: 0.01}" in text  # on 0.3 kg m²: less than 1 mrad/s
    )
    assert (
        "# was 'base-link'" in text
        and "1 mesh file" in text
        and "Coulomb friction of 1 joint" in text
    )


def test_right_angles_are_exact():
    text = imported(ROBOTS / "arm.urdf").text
    assert (
        "rpy: [-90 deg, 0, 0.2]" in text
        and "rpy: [0, 45 deg, 0]" in text
        and "rpy: [0.4, 0, 180 deg]" in text
    )
    assert "inertia: [0.002, 0.011, 0.012]" in text  # turned by a right angle


def test_mimics_follow_and_are_not_driven():
    """A chain of two: q₃ = −20 q₂, q₂ = 1.5 q₁ + 0.01."""
    model = imported(ROBOTS / "gripper.urdf").model
    s = system(model)
    assert [i.name for i in model.inputs] == ["tau_slide", "tau_finger"]
    phi = ca.Function("phi", [s.q], [s.phi])
    finger = 0.02
    assert np.allclose(np.asarray(phi([0.3, finger, 0.04, -0.8])), 0.0, atol=1e-15)


def test_quaternions_of_origins_from_version_1_1_on(tmp_path):
    """The same robot by roll, pitch and yaw; older files cannot say it so, and urdfdom passes over
    it, too."""
    file = tmp_path / "r.urdf"
    arm = robot(joint("a", "l0", "l1", more='<origin xyz="0.1 0.2 0.3" {}/>'))
    quaternion = arm.format('quat_xyzw="0.5 0.5 0.5 0.5"')
    file.write_text(quaternion.replace('name="r"', 'name="r" version="1.1"'))
    given = imported(file).model.joints[-1].at_parent
    file.write_text(arm.format(f'rpy="{math.pi / 2} 0 {math.pi / 2}"'))
    assert imported(file).model.joints[-1].at_parent == given
    file.write_text(quaternion)
    text = imported(file).text
    assert 'it takes <robot version="1.1">' in text and "matrix" not in text and "rpy" not in text


def test_a_mimic_of_a_fixed_joint_stays_at_its_offset(tmp_path):
    file = tmp_path / "r.urdf"
    mimic = '<mimic joint="a" multiplier="3" offset="0.25"/>'
    file.write_text(
        robot(
            joint("a", "l0", "l1", "fixed"),
            joint("b", "l1", "l2"),
            joint("c", "l2", "l3", more=mimic),
        )
    )
    assert "mimic_c: {holonomic: c - (0.25)}" in imported(file).text


def test_names_that_no_model_may_have_are_changed_and_noted():
    text = imported(ROBOTS / "carriage.urdf").text
    for was in ("'1st-link'", "'lambda'", "'for'", "'der'", "'ground'"):
        assert f"# was {was}" in text
    assert text.splitlines()[-4:] and "model: class_robot" in text


@pytest.mark.parametrize(
    ("name", "model"),
    [("math", "math_robot"), ("numpy", "numpy_robot"), ("w", "w_robot"), ("R", "R_robot")],
)
def test_a_robot_named_like_a_module_or_a_macro_is_a_model_of_another_name(tmp_path, name, model):
    """The generated module would hide `math`, and its W_OK is one of C's headers."""
    file = tmp_path / "robot.urdf"
    file.write_text(robot(joint("a", "base", "l0")).replace('name="r"', f'name="{name}"', 1))
    assert imported(file).model.name == model


BESIDE = """<mujoco><worldbody>
<body name="a"><freejoint name="base"/><geom size=".1"/></body>
<body name="b"><joint name="{0}" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("name", ["base_x", "base_qw", "base_wz"])
def test_a_joint_named_like_a_coordinate_of_another_gets_a_number(tmp_path, name):
    """Whichever of the two comes first in the file."""
    text = BESIDE.format(name)
    head, free, hinge, tail = text.splitlines()
    for k, lines in enumerate(((head, free, hinge, tail), (head, hinge, free, tail))):
        file = tmp_path / f"beside{k}.xml"
        file.write_text("\n".join(lines))
        found = imported(file)
        made = {joint.name for joint in found.model.joints}
        assert made == ({"base", f"{name}_2"} if k == 0 else {name, "base_2"})
        assert f"was '{name if k == 0 else 'base'}'" in found.text


def test_an_impossible_inertia_counts_with_the_body_it_is_fixed_to():
    found = imported(ROBOTS / "carriage.urdf")
    assert any("an inertia that no body can have" in note for note in found.changed)
    assert found.model.bodies[2].name == "lambda_body"
    assert "impossible and counted with body_1st_link" in found.text


def test_a_free_base_is_asked_for():
    assert "free" not in {joint.type for joint in imported(ROBOTS / "quadruped.urdf").model.joints}
    free = imported(ROBOTS / "quadruped.urdf", floating=True).model
    assert [v.name for v in free.velocities[:6]] == [
        "base.vx",
        "base.vy",
        "base.vz",
        "base.wx",
        "base.wy",
        "base.wz",
    ]


def test_a_robot_file_stands_for_a_model_with_a_free_base_too(monkeypatch) -> None:
    """One word for every verb that takes a model: --floating, or Floating(path)."""
    robot = hamel.Floating(ROBOTS / "arm.urdf")
    bound, free = hamel.check(ROBOTS / "arm.urdf"), hamel.check(robot)
    assert len(free.velocities) == len(bound.velocities) + 6 and free.file == str(robot)
    assert load(robot).joints[0].type == "free"
    for verb in (
        "build",
        "check",
        "choices",
        "derive",
        "explain",
        "linearize",
        "list",
        "simulate",
        "verify",
    ):
        seen: list[object] = []
        monkeypatch.setattr(hamel, verb, lambda path, **options: seen.append(path) or {})  # noqa: B023
        main_code(verb, str(ROBOTS / "arm.urdf"), "--floating", "--json")
        assert seen == [hamel.Floating(str(ROBOTS / "arm.urdf"))], verb


def main_code(*arguments: str) -> object:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return end.value.code


def test_a_model_file_has_its_base_in_it() -> None:
    with pytest.raises(ModelError, match="--floating is for URDF and MJCF files"):
        hamel.check(hamel.Floating(MODELS / "four_bar.yaml"))


def test_a_loop_of_mjcf_closes_at_the_reference_configuration():
    model = load_quietly(ROBOTS / "four_bar.xml")
    s = system(model)
    phi, A = Kinematics(s).positions(0.0, np.zeros(3), np.array([]))
    assert np.allclose(phi, 0.0, atol=1e-15)
    assert np.linalg.matrix_rank(A) == 2  # a planar loop, closed by three rows
    assert [c.type for c in model.closures] == ["ball"]
    assert model.inputs[0].name == "tau_drive"


def test_mjcf_defaults_frames_and_servos():
    found = imported(ROBOTS / "hand.xml")
    model = found.model
    assert [j.type for j in model.joints] == [
        "revolute",
        "prismatic",
        "revolute",
        "revolute",
        "revolute",
        "ball",
    ]
    assert (
        found.text.count("armature") == 5 + 2 * 3
    )  # of five joints, and of three rates of the ball joint
    assert "spring: {stiffness: 0.3, rest: 0.17453292519943295}" in found.text
    assert "tau_lift:    {joint: lift, gear: 30}  # was 'lift'" in found.text
    assert "5*tau_yaw + (-5 N*m/rad)*yaw + (-0.2 N*m*s/rad)*der(yaw)" in found.text
    assert any("contacts" in sentence for sentence in found.left_out)


@pytest.mark.parametrize(
    ("option", "said"),
    [("density='0' viscosity='0' wind='1 0 0'", ""), ("density='1.2' viscosity='0'", "density")],
)
def test_a_medium_is_left_out_where_there_is_one(option, said, tmp_path):
    file = tmp_path / "m.xml"
    body = "<body><joint type='hinge'/><geom size='0.1'/></body>"
    file.write_text(f"<mujoco><option {option}/><worldbody>{body}</worldbody></mujoco>")
    sentences = [x for x in imported(file).left_out if "medium" in x]
    assert sentences == ([f"forces of the medium around the bodies ({said})"] if said else [])


def test_mjcf_coordinates_are_zero_where_qpos_is():
    """The pose of the file is at `ref`: there the palm stands where <body pos euler> puts it."""
    from derive.mechanics.recursions.tree import ground_point, ground_positions, ground_rotations

    s = system(imported(ROBOTS / "hand.xml").model)
    rotations_, places = ground_rotations(s.links), dict(s.places)
    palm = places["palm"]
    origin = ground_point(palm, [0.0, 0.0, 0.0], ground_positions(s.links, rotations_), rotations_)
    f = ca.Function("f", [s.q], [ca.vertcat(*origin)])
    q = [0.0, 0.1, math.radians(15), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert np.allclose(np.asarray(f(q)).ravel(), [0, 0, 0.5], atol=1e-12)


def test_motors_at_sites_push_and_turn_a_free_body():
    s = system(load_quietly(ROBOTS / "drone.xml"))
    q, v = np.array([0, 0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0]), np.zeros(9)
    Q = ca.Function("Q", [s.t, s.q, s.v, s.u, s.p], [s.Q])
    force = np.asarray(Q(0.0, q, v, [2.0, 0.0], [])).ravel()
    assert np.allclose(force[:6], [0, 0, 2, 0, -0.28, 0.04], atol=1e-12)


def test_mjcf_says_where_a_free_body_starts():
    text = imported(ROBOTS / "drone.xml").text
    assert "base_z:  1" in text and "base_qz: 0.25881904510252074" in text


def test_equalities_of_mjcf(tmp_path):
    file = tmp_path / "m.xml"
    file.write_text(
        """<mujoco><compiler angle="radian"/><worldbody>
        <body name="a"><joint name="a"/><geom size="0.1"/></body>
        <body name="b" pos="1 0 0"><joint name="b" ref="0.5"/><geom size="0.1"/></body>
        <body name="c" pos="2 0 0"><freejoint/><geom size="0.1"/></body></worldbody>
        <equality>
          <joint joint1="a" joint2="b" polycoef="0.1 2"/><weld name="hold" body1="a" body2="c"/>
          <joint name="curve" joint1="a" joint2="b" polycoef="0 1 0.5" active="false"/>
        </equality></mujoco>"""
    )
    text = imported(file).text
    assert "{type: coupling, joints: [a, b], ratio: 2, offset: -0.9}" in text
    assert "hold: {type: fixed, between: [a, c], at: [[2, 0, 0], [0, 0, 0]]}" in text
    assert "the <joint> 'curve' is not active" in text


def test_equalities_of_fixed_tendons_tie_their_joints(tmp_path):
    """From the lengths at the reference configuration; hinges and slides in one length are plain
    numbers."""
    file = tmp_path / "m.xml"
    file.write_text(
        """<mujoco><compiler angle="radian"/><worldbody>
        <body name="a"><joint name="a"/><geom size="0.1"/></body>
        <body name="b" pos="1 0 0"><joint name="b" ref="0.5"/><geom size="0.1"/></body>
        <body name="c" pos="2 0 0"><joint name="c" type="slide" ref="0.2"/><geom size="0.1"/></body></worldbody>
        <tendon><fixed name="s"><joint joint="a" coef="1"/><joint joint="c" coef="-3"/></fixed>
          <fixed name="r"><joint joint="b" coef="2"/></fixed></tendon>
        <equality><tendon name="one" tendon1="s" polycoef="0.1"/>
          <tendon name="two" tendon1="r" tendon2="s" polycoef="0 0.5 0.25"/></equality></mujoco>"""
    )
    s = system(load_text(imported(file).text))
    a, b, c = q = (0.3, 0.9, -0.1)
    length, other = a - 3 * (c - 0.2), 2 * (b - 0.5)
    wanted = [length - 0.1, other - (0.5 * length + 0.25 * length**2)]
    assert np.array(ca.Function("phi", [s.q], [s.phi])(q)).ravel() == pytest.approx(
        wanted, abs=1e-12
    )


def test_masses_and_weights_are_scaled_to_the_total_that_is_asked_for(tmp_path):
    file = tmp_path / "m.xml"
    one = '<body name="{}" gravcomp="0.5"><joint/><inertial pos="0 0 0" mass="{}" diaginertia="1 1 1"/></body>'
    bodies = one.format("a", 1) + one.format("b", 3)
    file.write_text(
        f'<mujoco><compiler settotalmass="12"/><worldbody>{bodies}</worldbody></mujoco>'
    )
    text = imported(file).text
    first, second = load_text(text).bodies
    assert [number(x, {}) for body in (first, second) for x in (body.mass, body.inertia[0])] == [
        3.0,
        3.0,
        9.0,
        3.0,
    ]
    assert "components: [0, 0, 14.715]" in text and "scaled by 3, to 12 kg" in text


def test_flags_switch_springs_dampers_and_friction_off(tmp_path):
    file = tmp_path / "m.xml"
    body = '<body><joint stiffness="1" damping="2" frictionloss="3"/><geom size="1"/></body>'
    for flag, gone in (
        ("spring", "spring"),
        ("damper", "damper"),
        ("frictionloss", "friction"),
        ("passive", "spring"),
    ):
        option = f'<option><flag {flag}="disable"/></option>'
        file.write_text(f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>")
        assert {"spring:", "damper:", "friction:"} - set(imported(file).text.split()) >= {
            f"{gone}:"
        }


DRIVEN = """<mujoco>{option}<worldbody><body><joint name="h" axis="0 1 0" frictionloss="3"/>
<geom size=".1" mass="1" pos=".1 0 .2"/><body><joint name="s" type="slide"/><geom size="1"/></body>
</body></worldbody><equality><joint joint1="h" joint2="s"/></equality><actuator>
<general name="f" joint="h" dyntype="filter" dynprm=".05" gainprm="3" biastype="affine"
 biasprm="0 -2 -.1"/><intvelocity name="i" joint="s" kp="4"/><position name="p" joint="h" kp="2"
 timeconst=".1"/><cylinder name="c" joint="s" diameter="2" timeconst=".2" bias="1 0 -2"/>
</actuator></mujoco>"""


def test_activations_are_first_order_states(tmp_path):
    """MuJoCo's formulas: a' = u or (u − a)/τ, force = gain a + bias."""
    file = tmp_path / "m.xml"
    file.write_text(DRIVEN.format(option='<option><flag constraint="disable"/></option>'))
    s = system(load(file))
    at = ca.Function("at", [s.q, s.v, s.z, s.u], [s.Q, s.zdot])
    q, v, a, u = [0.3, 0.2], [0.5, -0.4], [0.7, -0.2, 0.9, 0.1], [1.0, 2.0, 3.0, 4.0]
    forces, rates = (np.array(x).ravel() for x in at(q, v, a, u))
    assert rates == pytest.approx(
        [(u[0] - a[0]) / 0.05, u[1], (u[2] - a[2]) / 0.1, (u[3] - a[3]) / 0.2], rel=1e-13
    )
    turning = 3 * a[0] - 2 * q[0] - 0.1 * v[0] + 2 * a[2] - 2 * q[0]
    sliding = 4 * a[1] - 4 * q[1] + np.pi * a[3] + 1 - 2 * v[1]
    assert forces == pytest.approx([turning, sliding], rel=1e-12)


@pytest.mark.parametrize(
    "flag, gone",
    [
        ("constraint", {"constraints:", "friction:"}),
        ("equality", {"constraints:"}),
        ("actuation", {"inputs:", "states:", "loads:"}),
    ],
)
def test_what_a_flag_switches_off_is_left_out(flag, gone, tmp_path):
    file = tmp_path / "m.xml"
    file.write_text(DRIVEN.format(option=""))
    before = set(imported(file).text.split())
    file.write_text(DRIVEN.format(option=f'<option><flag {flag}="disable"/></option>'))
    text = imported(file).text
    assert gone <= before and not gone & set(text.split())
    assert (
        f"switched off by a <flag>: <{'actuator' if flag == 'actuation' else 'equality'}>" in text
    )


def test_included_files_and_frames_are_read_in_place(tmp_path):
    (tmp_path / "part.xml").write_text(
        '<mujoco><body name="b"><joint/><geom size="0.1" pos="0.1 0 0"/></body></mujoco>'
    )
    file = tmp_path / "m.xml"
    file.write_text(
        '<mujoco><worldbody><frame pos="0 0 2"><include file="part.xml"/></frame></worldbody></mujoco>'
    )
    assert "at: [0, 0, 2]" in imported(file).text


def test_included_files_stay_in_the_models_folder_unless_another_is_allowed(tmp_path, capsys):
    home, other = tmp_path / "home", tmp_path / "other"
    (home / "parts").mkdir(parents=True)
    other.mkdir()
    part = '<mujoco><body name="b"><joint/><geom size="0.1" pos="0.1 0 0"/></body></mujoco>'
    (home / "parts/part.xml").write_text(part)
    (other / "part.xml").write_text(part)
    (home / "link.xml").symlink_to(other / "part.xml")
    file = home / "m.xml"
    wanted = "<mujoco><worldbody><include file='{}'/></worldbody></mujoco>"
    file.write_text(wanted.format("parts/part.xml"))
    assert imported(file).model.bodies
    for outside in ("../other/part.xml", str(other / "part.xml"), "link.xml"):
        file.write_text(wanted.format(outside))
        with pytest.raises(ModelError, match="is outside the model's folder") as raised:
            imported(file)
        assert "--include DIR" in str(raised.value)
        assert imported(hamel.RobotFile(file, include=(str(other),))).model.bodies
        assert command("check", file, "--include", other) == 0
        capsys.readouterr()
    file.write_text(wanted.format("part.xml"))  # by the folder that is allowed
    assert imported(hamel.RobotFile(file, include=(str(other),))).model.bodies


SECRET = "password: opensesame"


@pytest.mark.parametrize(
    "content",
    [
        SECRET,
        f"<config><{SECRET.replace(': ', '>')}</password></config>",
        f"<config><{SECRET.replace(': ', '>')}</config>",
        f"{SECRET} \udcff".encode("utf-8", "surrogateescape").decode("latin-1"),
    ],
)
def test_nothing_of_a_file_that_is_no_model_is_shown(content, tmp_path):
    """Neither of one that is included nor of one that is asked for."""
    (tmp_path / "part.xml").write_bytes(content.encode("latin-1"))
    file = tmp_path / "m.xml"
    file.write_text('<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>')
    for asked in (file, tmp_path / "part.xml"):
        with pytest.raises(ModelError) as raised:
            imported(asked)
        assert "opensesame" not in str(raised.value)


@pytest.mark.slow
def test_included_files_are_counted_before_anything_is_built(tmp_path, monkeypatch):
    """99 times one file: bytes, elements and bodies of all together are bounded."""
    body = '<body><joint/><geom size="0.1"/></body>'
    (tmp_path / "part.xml").write_text(f"<mujoco>{body * 250}</mujoco>")
    file = tmp_path / "m.xml"
    many = "<include file='part.xml'/>" * 99
    file.write_text(f"<mujoco><worldbody>{many}</worldbody></mujoco>")
    with pytest.raises(ModelError, match="more than 20000 bodies"):
        imported(file)
    (tmp_path / "part.xml").write_text(f"<mujoco>{'<site/>' * 10_000}</mujoco>")
    with pytest.raises(ModelError, match="too many elements"):
        imported(file)
    (tmp_path / "part.xml").write_text(f"<mujoco><!--{'x' * (1 << 20)}--></mujoco>")
    with pytest.raises(ModelError, match="included files are too large"):
        imported(file)


def long_urdf(n: int) -> str:
    """A chain on one line, whose numbers have all their digits."""
    links = ['<robot name="long"><link name="l0"/>']
    for i in range(n):
        links.append(
            f'<link name="l{i + 1}"><inertial><origin xyz="0.1 {i / 7e3!r} 0"/><mass value="1"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{i / 3e4!r} 0 0.1" rpy="{0.3 + i / 3e4!r} 0 0"/></joint>'
        )
    return "".join([*links, "</robot>"])


def long_mjcf(n: int) -> str:
    """The same as bodies one inside the other."""
    body = (
        '<body pos="0 0 0.1" euler="0 30 0"><joint axis="0 0 1"/><inertial pos="0 0 0.05" mass="1" '
        'diaginertia="0.01 0.01 0.01"/>'
    )
    return f"<mujoco><worldbody>{body * n}{'</body>' * n}</worldbody></mujoco>"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["long.urdf", "long.xml"])
def test_robots_of_ten_thousand_links_are_read(tmp_path, name):
    """With all their digits, and however deep their bodies are nested."""
    file = tmp_path / name
    file.write_text(long_urdf(10_000) if name.endswith("urdf") else long_mjcf(10_000))
    model = imported(file).model
    assert len(model.coordinates) == 10_000 and len(model.joints) >= 10_000


def test_links_are_counted_while_a_file_is_read() -> None:
    """Nothing is made of the first before there are too many."""
    file = markup.as_file(long_urdf(9).encode(), "long.urdf", Path())
    assert len(markup.parsed(file, markup.Budget(bodies=10)).all("link")) == 10
    with pytest.raises(ModelError, match="more than 20000 bodies"):
        markup.parsed(file, markup.Budget(bodies=9))


def test_all_problems_of_a_line_share_its_text() -> None:
    """A robot of megabytes may stand on one line, with something wrong at every link."""
    file = markup.as_file("<robot>\r\n<a ä='1'/><b/>\n\n</robot>".encode(), "r.urdf", Path())
    for at in range(len(file.content)):
        before = file.content[:at]
        problem = file.diagnostic(at, 1, "wrong")
        line = before.count(b"\n") + 1
        column = len(before.rpartition(b"\n")[2].decode("utf-8", "replace")) + 1
        assert (problem.line, problem.column) == (line, column)
        assert problem.source_line == file.line(line)
        assert problem.source_line is file.diagnostic(at, 1, "again").source_line


RIGHT_ANGLES = {
    "1.5708": "90 deg",
    "1.5707": "90 deg",
    "-1.571": "-90 deg",
    "1.57": "90 deg",
    "3.14": "180 deg",
    "3.1416": "180 deg",
    "0.7854": "45 deg",
    "-2.0944": "-120 deg",
    "0.262": "15 deg",
    "1.5707963259": "90 deg",  # with a wrong digit
    "1.570796327": "90 deg",
}


@pytest.mark.parametrize("word", RIGHT_ANGLES)
def test_rounded_angles_are_read_as_what_they_round(word, tmp_path):
    file = tmp_path / "r.urdf"
    file.write_text(ARM.replace("<axis", f'<origin rpy="{word} 0 0"/><axis', 1))
    made = imported(file)
    assert f"rpy: [{RIGHT_ANGLES[word]}, 0, 0]" in made.text
    notes = [note for note in made.assumed if "rounded angles" in note]
    assert len(notes) == 1 and word in notes[0] and "--exact" in notes[0]
    kept = imported(hamel.RobotFile(file, exact=True))
    assert f"rpy: [{word}, 0, 0]" in kept.text and not kept.assumed


@pytest.mark.parametrize(
    "word", ["0.26", "0.52", "1.5", "1.58", "1.5718", "0.3", "1.6e0", "2", "0.001"]
)
def test_other_angles_are_taken_as_they_are(word, tmp_path):
    file = tmp_path / "r.urdf"
    file.write_text(ARM.replace("<axis", f'<origin rpy="{word} 0 0"/><axis', 1))
    made = imported(file)
    assert not made.assumed and f"rpy: [{written(float(word))}, 0, 0]" in made.text


GRIPPER = """<robot name="g">
<link name="hand"/>
<link name="left"><inertial><mass value="0.1"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="right"><inertial><mass value="0.1"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{0}" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>{2}</joint>
<joint name="{1}" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>{3}</joint>
<transmission name="t"/>
</robot>"""
MIMIC = '<mimic joint="driver" multiplier="{}"/>'


@pytest.mark.parametrize("ratio", ["1", "20", "0.05", "-1"])
@pytest.mark.parametrize("first", [True, False])
def test_a_mimic_joint_is_no_choice_where_its_master_is(ratio, first, tmp_path):
    """In either order of the file and for any ratio the speed that the input drives is chosen."""
    names, ends = ("driver", "slave"), ("", MIMIC.format(ratio))
    order = (0, 1) if first else (1, 0)
    file = tmp_path / "g.urdf"
    file.write_text(GRIPPER.format(*(names[k] for k in order), *(ends[k] for k in order)))
    assert equations(system(load_quietly(file))).arguments[1].labels[-1] == "driver_dot"


def test_what_a_robot_loses_is_said_by_every_verb(tmp_path, capsys):
    file = tmp_path / "g.urdf"
    friction = '<limit lower="0" upper="1"/><dynamics friction="1"/>'
    file.write_text(GRIPPER.format("driver", "slave", friction, MIMIC.format(1)))
    with pytest.warns(RuntimeWarning) as warned:
        built = hamel.build(file, out=tmp_path / "out", numpy=True)
    said = " ".join(str(warning.message) for warning in warned)
    manifest = json.loads((built.folder / "manifest.json").read_text())["assumptions"]
    for part in ("the transmission 't'", "nothing in the equations stops", "coulomb*tanh"):
        assert part in said and part in " ".join(manifest)


@pytest.mark.parametrize("kind", inertia.SIZES)
def test_inertia_of_solids_by_summing_small_cubes(kind):
    size = (0.3, 0.5, 0.4)[: inertia.SIZES[kind]]
    inside = {
        "sphere": lambda x, y, z: x * x + y * y + z * z < 0.09,
        "capsule": lambda x, y, z: x * x + y * y + np.maximum(abs(z) - 0.5, 0) ** 2 < 0.09,
        "cylinder": lambda x, y, z: (x * x + y * y < 0.09) & (abs(z) < 0.5),
        "ellipsoid": lambda x, y, z: (x / 0.3) ** 2 + (y / 0.5) ** 2 + (z / 0.4) ** 2 < 1,
        "box": lambda x, y, z: (abs(x) < 0.3) & (abs(y) < 0.5) & (abs(z) < 0.4),
    }[kind]
    line = (np.arange(160) + 0.5) / 160 * 1.6 - 0.8
    x, y, z = np.meshgrid(line, line, line, indexing="ij")
    filled = inside(x, y, z)
    volume, moments = inertia._SOLIDS[kind](size)
    assert filled.sum() * 1e-6 == pytest.approx(volume, rel=0.01)
    summed = [((a * a + b * b) * filled).sum() / filled.sum() for a, b in ((y, z), (x, z), (x, y))]
    assert moments == pytest.approx(summed, rel=0.01)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_read_back(number):
    assert float(written(number)) == number


@given(
    st.lists(st.floats(-7, 7), min_size=3, max_size=3),
    st.sampled_from([0.0, math.pi / 2, -math.pi / 2, 1e-10]),
)
def test_rotations_go_through_angles_and_quaternions(angles, pitch):
    for rpy in (angles, [angles[0], pitch, angles[2]]):
        R = rotations.from_rpy(rpy)
        assert np.allclose(rotations.from_rpy(rotations.to_rpy(R)), R, atol=1e-8)
        assert np.allclose(rotations.from_quaternion(rotations.to_quaternion(R)), R, atol=1e-8)


@given(st.text(), st.sampled_from(["body", "joint"]))
def test_every_name_becomes_a_legal_one(name, kind):
    from derive.model.names import objection

    assert objection(legal(name, kind)) is None
    names = Names()
    made = [names(name, kind) for _ in range(3)]
    assert len(set(made)) == 3 and not any(objection(n) for n in made)


def test_nested_bodies_need_no_recursion():
    count = 2500
    text = (
        "".join(f'<body name="b{i}"><joint/><geom size="0.1"/>' for i in range(count))
        + "</body>" * count
    )
    file = markup.as_file(
        f"<mujoco><worldbody>{text}</worldbody></mujoco>".encode(), "deep.xml", Path(".")
    )
    assert len(mjcf.robot(markup.parsed(file), "deep", False, markup.Budget()).bodies) == count


# ---- the command


def load_quietly(file):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return load(file)


def command(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    return stop.value.code


def test_the_command_prints_writes_and_counts(tmp_path, capsys):
    assert command("import", ROBOTS / "gripper.urdf") == 0
    assert load_text(capsys.readouterr().out).name == "gripper"
    assert command("import", ROBOTS / "gripper.urdf", "-o", tmp_path / "g.yaml", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["kind"] == "URDF" and record["bodies"] == 5 and record["velocities"] == 4
    assert command("check", tmp_path / "g.yaml") == 0


def test_all_verbs_take_the_robot_itself(capsys):
    assert command("check", ROBOTS / "quadruped.urdf") == 0
    with pytest.warns(RuntimeWarning, match="contacts between 3 geoms"):
        assert command("list", ROBOTS / "four_bar.xml") == 0
    assert "loop" in capsys.readouterr().out


def test_a_build_from_urdf_is_verified(tmp_path):
    built = hamel.build(ROBOTS / "gripper.urdf", out=tmp_path / "gripper", numpy=True)
    assert built.verified and set(built.operations) >= {"dynamics", "mass", "bias"}


def test_a_model_does_not_overwrite_its_robot(tmp_path, capsys):
    file = tmp_path / "arm.urdf"
    file.write_text((ROBOTS / "arm.urdf").read_text())
    assert command("import", file, "-o", file) == 1
    assert "would be overwritten" in capsys.readouterr().err


# ---- bad files


def joint(name, parent, child, kind="revolute", more=""):
    axis = '<axis xyz="0 0 1"/>' if kind not in ("fixed", "floating") else ""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{axis}{more}</joint>\n'


def robot(*joints, links=None):
    """A robot with a link for every name its joints use."""
    names = links or dict.fromkeys(
        word for j in joints for word in j.split('link="')[1:] for word in [word.split('"')[0]]
    )
    return (
        '<robot name="r">\n'
        + "".join(LINK.format(name) for name in names)
        + "".join(joints)
        + "</robot>\n"
    )


ARM = robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"))
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n<robot name="&b;"/>'
ONE_BODY = '<mujoco><worldbody><body name="a"><joint name="j"/>{}</body></worldbody>{}</mujoco>'

BAD = {
    "a loop": (
        robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"), joint("c", "l0", "l2")),
        [":7:65:", "a kinematic loop", "'l2' is already the child of the joint 'b'", "closures:"],
    ),
    "a ring": (
        robot(joint("a", "l0", "l1"), joint("b", "l2", "l3"), joint("c", "l3", "l2")),
        ["a kinematic loop without a beginning", "'l3' → 'l2' → 'l3'"],
    ),
    "too many links": (
        robot(*(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(20_000))),
        ["the robot has more than 20000 bodies", "at most 20000"],
    ),
    "no root": (
        robot(joint("a", "l0", "l1"), joint("b", "l1", "l0")),
        ["a kinematic loop without a beginning"],
    ),
    "two roots": (
        robot(joint("a", "l0", "l1"), joint("b", "l2", "l3")),
        [":4:13:", "the link 'l2' is not connected to 'l0'"],
    ),
    "an unknown link": (
        robot(joint("a", "base", "l1"), links=["base_", "l1"]),
        ["unknown link 'base'", "did you mean 'base_'?"],
    ),
    "no child": (ARM.replace('<child link="l2"/>', ""), ["the joint 'b' has no child"]),
    "no mass": (
        ARM.replace('<mass value="1"/>', "", 1),
        [":2:17:", "the inertial of 'l0' has no mass"],
    ),
    "negative mass": (
        ARM.replace('<mass value="1"/>', '<mass value="-3"/>', 1),
        [":2:40:", "the mass of 'l0' is -3 kg"],
    ),
    "a bad number": (
        ARM.replace('value="1"', 'value="1_0"', 1),
        ["'1_0' in 'value' of <mass>", "finite numbers"],
    ),
    "infinite": (ARM.replace('value="1"', 'value="1e999"', 1), ["'1e999'", "finite numbers"]),
    "two numbers": (
        ARM.replace('xyz="0 0 1"', 'xyz="0 1"', 1),
        ["2 numbers in 'xyz' of <axis>", "3"],
    ),
    "a zero axis": (
        ARM.replace('xyz="0 0 1"', 'xyz="0 0 0"', 1),
        ["the axis of the joint 'a' has length zero"],
    ),
    "an impossible inertia": (
        ARM.replace('izz="1"', 'izz="5"', 2).replace('izz="5"', 'izz="1"', 1),
        [":3:44:", "no body has the inertia of 'l1'"],
    ),
    "a strange type": (
        ARM.replace('"revolute"', '"ball"', 1),
        ["has the type 'ball'", "revolute, continuous, prismatic"],
    ),
    "a mimic of itself": (
        robot(joint("a", "l0", "l1", more='<mimic joint="a"/>')),
        ["joints that mimic each other in a circle: 'a' → 'a'"],
    ),
    "mimics in a circle": (
        robot(
            joint("a", "l0", "l1", more='<mimic joint="b"/>'),
            joint("b", "l1", "l2", more='<mimic joint="a"/>'),
        ),
        ["joints that mimic each other in a circle: 'a' → 'b' → 'a'"],
    ),
    "a mimic of nothing": (
        robot(joint("finger", "l0", "l1"), joint("b", "l1", "l2", more='<mimic joint="fingr"/>')),
        ["unknown joint 'fingr'", "did you mean 'finger'?"],
    ),
    "fingers without mass": (
        '<robot name="r">'
        + LINK.format("l0")
        + '<link name="l1"/><link name="l2"/>'
        + joint("a", "l0", "l1")
        + joint("b", "l0", "l2", more='<mimic joint="a"/>')
        + "</robot>",
        ["the joints 'a', 'b' move together and carry nothing that has mass"],
    ),
    "a massless tip": (
        '<robot name="r">'
        + LINK.format("l0")
        + '<link name="l1"/>'
        + joint("a", "l0", "l1")
        + "</robot>",
        ["nothing gives 'l1' inertia: the joint 'a' has nothing to accelerate"],
    ),
    "nothing moves": (robot(joint("a", "l0", "l1", "fixed")), ["nothing moves", "--floating"]),
    "no links": ('<robot name="r"/>', ["the robot has no links"]),
    "two links of one name": (
        robot(joint("a", "l0", "l1"), links=["l0", "l1", "l1"]),
        ["a second link 'l1'"],
    ),
    "macros": (
        '<robot name="r" xmlns:xacro="x"><xacro:include filename="a"/></robot>',
        ["a xacro macro", "xacro FILE.xacro"],
    ),
    "an open element": (
        "<robot>\n<link>\n</robot>",
        [
            ":3:3:",
            "not valid XML: mismatched tag",
            "expected: </link>, the end of the <link> of line 2",
        ],
    ),
    "a file that is cut off": (
        '<robot name="r">\n<link name="a"/>\n<joint\n name="j">\n<parent link="a"/>\n',
        [
            ":6:1:",
            "the file ends inside <joint>",
            "expected: </joint>, the end of the <joint> of line 3",
        ],
    ),
    "a file that is cut off in a tag": (
        '<robot name="r">\n<link name="a"/>\n<joint name="j" ty',
        [":3:1:", "not valid XML: the file ends in what starts here"],
    ),
    "an impossible inertia in MJCF": (
        ONE_BODY.format('<inertial pos="0 0 0" mass="1" diaginertia="1 1 5"/>', ""),
        [":1:52:", "no body has the inertia of 'a'"],
    ),
    "a capsule without a size": (
        ONE_BODY.format('<geom type="capsule"/>', ""),
        ["a capsule without a size", "expected: a size of 2 numbers, more than zero"],
    ),
    "a capsule of one number": (
        ONE_BODY.format('<geom type="capsule" size="1"/>', ""),
        ["the size of a capsule has 1 number\n", "expected: a size of 2 numbers, more than zero"],
    ),
    "a capsule from end to end without a size": (
        ONE_BODY.format('<geom type="capsule" fromto="0 0 0 0 0 1"/>', ""),
        ["a capsule without a size", "expected: a size of 1 number, more than zero"],
    ),
    "an entity bomb": (BOMB, [":1:", "a document type, which can declare entities"]),
    "not XML": ("model: arm\n", ["the file is not XML"]),
    "nothing": ("", ["the file is empty"]),
    "something else": ("<html/>", ["the file is no robot", "<robot> (URDF) or <mujoco> (MJCF)"]),
    "too deep": (
        "<robot>" + "<a>" * 30_000 + "</a>" * 30_000 + "</robot>",
        ["the file is nested too deeply"],
    ),
    "a zero quaternion": (
        '<mujoco><worldbody><body quat="0 0 0 0"><joint/><geom size="1"/></body></worldbody></mujoco>',
        [":1:32:", "a quaternion of length zero"],
    ),
    "a zero axis in MJCF": (
        '<mujoco><worldbody><body><joint axis="0 0 0"/><geom size="1"/></body></worldbody></mujoco>',
        ["the axis of a joint has length zero"],
    ),
    "a mesh": (
        ONE_BODY.format('<geom type="mesh" mesh="m"/>', ""),
        ["unknown mesh 'm'", "give the body an <inertial>"],
    ),
    "a tendon that pulls": (
        ONE_BODY.format('<geom size="1"/>', '<tendon><spatial name="t" stiffness="3"/></tendon>'),
        ["the tendon 't' has no two sites"],
    ),
    "a muscle": (
        ONE_BODY.format('<geom size="1"/>', '<actuator><muscle joint="j"/></actuator>'),
        ["a <muscle> actuator", "which has a law of its own"],
    ),
    "a filter without a time": (
        ONE_BODY.format(
            '<geom size="1"/>',
            '<actuator><general joint="j" dyntype="filter" dynprm="0"/></actuator>',
        ),
        ["an activation with the time constant 0", "a positive one"],
    ),
    "an unknown joint": (
        ONE_BODY.format('<geom size="1"/>', '<actuator><motor joint="jj"/></actuator>'),
        ["unknown joint 'jj'", "did you mean 'j'?"],
    ),
    "an unknown body": (
        ONE_BODY.format(
            '<geom size="1"/>', '<equality><connect body1="a" body2="b" anchor="0 0 0"/></equality>'
        ),
        ["unknown body 'b'"],
    ),
    "an unknown class": (ONE_BODY.format('<geom size="1" class="c"/>', ""), ["unknown class 'c'"]),
    "no bodies": ("<mujoco><worldbody/></mujoco>", ["the file has no bodies"]),
    "flexible bodies": (ONE_BODY.format('<flexcomp name="f"/>', ""), ["<flexcomp> in a body"]),
    "attached models": (ONE_BODY.format('<attach model="c"/>', ""), ["mj_saveLastXML"]),
    "a slider-crank": (
        ONE_BODY.format("", '<actuator><motor cranksite="c" slidersite="s"/></actuator>'),
        ["a <motor> that drives a slider-crank"],
    ),
    "global coordinates": (
        '<mujoco><compiler coordinate="global"/></mujoco>',
        ["global coordinates"],
    ),
    "an unknown section": (
        "<mujoco><wordbody/></mujoco>",
        ["unknown section <wordbody>", "did you mean 'worldbody'?"],
    ),
    "a file of another kind": (
        '<mujoco><include file="/etc/hostname"/></mujoco>',
        ["is no MJCF file by its name"],
    ),
    "a file that is not there": (
        '<mujoco><include file="parts.xml"/></mujoco>',
        ["the file 'parts.xml' is not there"],
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_files_get_one_clear_message(what, tmp_path, capsys):
    """Place, what is wrong and what would be right; exit code 1, no traceback, nothing written."""
    text, expected = BAD[what]
    file, out = tmp_path / ("r.xml" if "<mujoco" in text else "r.urdf"), tmp_path / "out.yaml"
    file.write_text(text)
    assert command("import", file, "-o", out) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"{file}:") and "Traceback" not in said and "internal error" not in said
    for part in expected:
        assert part in said
    assert not out.exists() and [entry.name for entry in tmp_path.iterdir()] == [file.name]


def test_a_folder_and_a_missing_file(tmp_path, capsys):
    assert command("import", tmp_path) == 1
    assert "cannot be read: Is a directory" in capsys.readouterr().err
    assert command("import", tmp_path / "no.urdf") == 1
    assert "cannot be read: No such file" in capsys.readouterr().err


def test_text_that_is_not_utf8(tmp_path):
    file = tmp_path / "r.urdf"
    file.write_bytes(b'<robot name="r">\n<link name="\xff"/></robot>')
    with pytest.raises(ModelError, match=r":2:13: error: the file is not UTF-8 text"):
        imported(file)


def test_a_file_that_includes_itself(tmp_path):
    file = tmp_path / "m.xml"
    file.write_text('<mujoco><include file="m.xml"/></mujoco>')
    with pytest.raises(ModelError, match="more than 100 files are included"):
        imported(file)


@given(st.text(alphabet='<>/="r obtlinkjm&;![]?x ', max_size=80))
def test_no_text_is_too_strange_to_be_refused(text):
    """A ModelError or a robot, never another exception."""
    file = markup.as_file(text.encode("utf-8"), "r.urdf", Path("."))
    try:
        markup.parsed(file)
    except ModelError as error:
        assert error.diagnostics


def test_sites_with_a_name_are_frames(tmp_path):
    """Of bodies, of the world, and beside a body of the same name; sites without one are not."""
    file = tmp_path / "sites.xml"
    file.write_text(
        """<mujoco><worldbody><site name="table" pos="1 0 0"/>
        <body name="arm"><joint name="hinge"/><geom size="0.1" mass="1"/>
        <site name="tool" pos="0 0 0.2" euler="90 0 0"/><site name="arm" pos="0.1 0 0"/>
        <site name="u" pos="0.1 0 0"/><site pos="1 1 1"/></body></worldbody></mujoco>"""
    )
    frames = {frame.name: frame.body for frame in imported(file).model.frames}
    assert frames == {"table": "ground", "tool": "arm", "site_arm": "arm", "site_u": "arm"}


@pytest.mark.parametrize(
    "actuator",
    ["<position joint='j' inheritrange='1' kp='5'/>", "<motor joint='j' ctrlrange='-1 1'/>"],
)
def test_ranges_of_actuators_are_left_out_with_a_word(actuator, tmp_path):
    """Those that come from a joint were left out without."""
    file = tmp_path / "m.xml"
    body = "<body><joint name='j' type='hinge' range='-50 50'/><geom size='0.1'/></body>"
    file.write_text(
        f"<mujoco><worldbody>{body}</worldbody><actuator>{actuator}</actuator></mujoco>"
    )
    assert any("the ranges of 1 actuator" in x for x in imported(file).left_out)
