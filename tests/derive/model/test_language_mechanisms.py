"""The language of mechanisms: placed frames, every joint and closure, constraints between bodies
and coordinates, loads.

Of derive.model.constraints: coupling, distance, holonomic, lengths, no_slip, nonholonomic,
nonideal, point_on_surface, prescribed, rolling.
Of derive.model.loads: armature, bushing, damper, expression, force, friction, in_joint, places,
spring, torque.
"""

import math

import casadi as ca
import numpy as np
import pytest

from derive.expressions import tree
from derive.expressions.evaluate import number
from derive.expressions.parser import expression
from derive.expressions.quantities import quantity
from derive.expressions.tree import ONE, ZERO, Name, Number
from derive.joints import CLOSURES, JOINTS
from derive.model import KINDS, load, load_text, schema
from derive.model.constraint_records import Distance, Holonomic, OnSurface, Rolling
from derive.model.load_records import Armature, Bushing, JointDamper, JointFriction, JointSpring
from derive.states import system
from derive.states.initial import initial_state
from tests.scenes import MODELS

HEAD = "model: m\nparameters: {m: 1 kg, l: 0.3 m, p: 5 mm, tilt: 20 deg}\n"
BODIES = (
    "bodies: {a: {mass: m, inertia: 0.1}, b: {mass: m, inertia: 0.1}, c: {mass: m, inertia: 0.1}}\n"
)
FREE = "B: {type: free, parent: ground, child: b}, C: {type: free, parent: ground, child: c}"
PLANAR = "model: m\nplane: xy\nparameters: {m: 1 kg, l: 0.3 m}\nbodies: {a: {mass: m, inertia: 0.1}, b: {mass: m, inertia: 0.1}}\n"
PLANAR_JOINTS = "joints: {A: {type: revolute, parent: ground, child: a, coordinate: q}, B: {type: planar, parent: ground, child: b}}\n"
HINGES = "joints: {A: {type: revolute, parent: ground, child: a}, B: {type: revolute, parent: a, child: b, at: [l, 0]}}\n"


def joint(text: str):
    """The first joint of three bodies, given what stands between its braces."""
    model = load_text(
        f"{HEAD}{BODIES}joints: {{A: {{parent: ground, child: a, {text}}}, {FREE}}}\n"
    )
    return next(found for found in model.joints if found.name == "A")


def with_tie(section: str, text: str):
    body = f"{HEAD}{BODIES}joints: {{A: {{type: revolute, parent: ground, child: a, axis: z, coordinate: q}}, {FREE}}}\n"
    model = load_text(f"{body}{section}: {{k: {{{text}}}}}\n")
    return getattr(model, section)[-1]


def entries(rotation) -> list[list[float]]:
    return [[number(entry, {"tilt": math.radians(20)}, "") for entry in row] for row in rotation]


@pytest.mark.parametrize(
    ("kind", "coordinates", "velocities"),
    [
        ("screw, axis: x, pitch: p", ("A",), ("der(A)",)),
        ("cylindrical, axis: z", ("A_angle", "A_slide"), ("der(A_angle)", "der(A_slide)")),
        ("universal, axis: z", ("A_angle1", "A_angle2"), ("der(A_angle1)", "der(A_angle2)")),
        ("ball", ("A_qw", "A_qx", "A_qy", "A_qz"), ("A.wx", "A.wy", "A.wz")),
    ],
)
def test_names_of_coordinates_and_velocities(
    kind: str, coordinates: tuple, velocities: tuple
) -> None:
    found = joint(f"type: {kind}")
    assert (found.coordinates, found.velocities) == (coordinates, velocities)


def test_free_joint_with_a_quaternion() -> None:
    plain = joint("type: free, orientation: quaternion")
    assert plain.orientation == "quaternion"
    assert plain.coordinates[3:] == ("A_qw", "A_qx", "A_qy", "A_qz") and len(plain.velocities) == 6
    named = joint("type: free, position: [x, y, z], orientation: {quaternion: [e0, e1, e2, e3]}")
    assert named.coordinates == ("x", "y", "z", "e0", "e1", "e2", "e3")
    assert joint("type: ball, coordinates: [e0, e1, e2, e3]").coordinates == (
        "e0",
        "e1",
        "e2",
        "e3",
    )


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("axis: z", (1, 0, 0)),
        ("axis: x", (0, 1, 0)),
        ("axis: -y", (0, 0, 1)),
        ("axis: z, axis2: [0, 2, 0]", (0, 1, 0)),
        ("axis: [1, 1, 0], axis2: [1, -1, 0]", (math.sqrt(0.5), -math.sqrt(0.5), 0)),
    ],
)
def test_second_axis(given: str, expected: tuple[float, ...]) -> None:
    found = joint(f"type: universal, {given}").axis2
    assert found is not None
    assert [component.value for component in found] == pytest.approx(expected, abs=1e-15)
    assert sum(
        x.value * y.value for x, y in zip(found, joint(f"type: universal, {given}").axis)
    ) == pytest.approx(0.0, abs=1e-15)


def test_pitch_is_per_turn() -> None:
    assert joint("type: screw, axis: x, pitch: p").pitch == Name("p")
    assert joint("type: screw, axis: x, pitch: 5 mm").pitch == Number(0.005, "m")
    per_turn = joint("type: screw, axis: x, pitch: 5 mm/rev").pitch
    assert isinstance(per_turn, Number) and per_turn.value == pytest.approx(0.005, rel=1e-15)


def test_limits() -> None:
    low, high = joint("type: revolute, axis: z, limits: [-90 deg, tilt]").limits
    assert low == Number(-math.pi / 2, "rad") and high == Name("tilt")
    assert joint("type: revolute, axis: z").limits is None


def test_both_sides_of_a_joint_can_be_placed() -> None:
    found = joint(
        "type: revolute, axis: z, at: {parent: {position: [l, 0, 0], rpy: [90 deg, 0, 0]}, child: {position: [0, l, 0]}}"
    )
    assert found.at_parent.position == (Name("l"), ZERO, ZERO)
    assert found.at_parent.rotation == (
        (ONE, ZERO, ZERO),
        (ZERO, ZERO, Number(-1.0)),
        (ZERO, ONE, ZERO),
    )
    assert found.at_child.position == (ZERO, Name("l"), ZERO) and found.at_child.rotation is None
    listed = joint("type: revolute, axis: z, at: [[l, 0, 0], {rpy: [0, 0, 90 deg]}]")
    assert listed.at_child.rotation == (
        (ZERO, Number(-1.0), ZERO),
        (ONE, ZERO, ZERO),
        (ZERO, ZERO, ONE),
    )
    assert joint("type: revolute, axis: z, at: {child: [l, 0, 0]}").at_child.position == (
        Name("l"),
        ZERO,
        ZERO,
    )


@pytest.mark.parametrize(
    "turn",
    [
        "axis_angle: [z, 90 deg]",
        "axis_angle: [[0, 0, 2], pi/2]",
        "matrix: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]",
        "matrix: [[1e-13, -1, 0], [1, 1e-14, 0], [0, 0, 1]]",
        "rpy: [0, 0, 90 deg]",
    ],
)
def test_turns_by_right_angles_are_exact(turn: str) -> None:
    found = joint(f"type: revolute, axis: z, {turn}").at_parent.rotation
    assert found == ((ZERO, Number(-1.0), ZERO), (ONE, ZERO, ZERO), (ZERO, ZERO, ONE))


def test_no_turn_is_none() -> None:
    for turn in (
        "matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        "axis_angle: [x, 0]",
        "rpy: [0, 0, 360 deg]",
    ):
        assert joint(f"type: revolute, axis: z, {turn}").at_parent.rotation is None


@pytest.mark.parametrize(
    "turn", ["rpy: [0.1, 0.2, {}]", "axis_angle: [[1, 2, 2], {}]", "axis_angle: [-y, {}]"]
)
def test_turns_by_parameters_are_the_turns_by_their_values(turn: str) -> None:
    by_name = joint(f"type: revolute, axis: z, {turn.format('tilt')}").at_parent.rotation
    by_value = joint(f"type: revolute, axis: z, {turn.format('20 deg')}").at_parent.rotation
    assert np.array(entries(by_name)) == pytest.approx(np.array(entries(by_value)), abs=1e-15)
    assert any(
        isinstance(entry, tree.Call | tree.Sum | tree.Product | tree.Negative)
        for row in by_name
        for entry in row
    )


def test_a_printed_matrix_is_made_orthogonal() -> None:
    rounded = "[[0.866025, -0.5, 0], [0.5, 0.866025, 0], [0, 0, 1]]"
    R = np.array(entries(joint(f"type: revolute, axis: z, matrix: {rounded}").at_parent.rotation))
    assert pytest.approx(np.eye(3), abs=1e-15) == R @ R.T
    assert (R[2] == [0, 0, 1]).all() and (R[:, 2] == [0, 0, 1]).all()


def test_angle_of_a_planar_joint_may_be_a_parameter() -> None:
    text = PLANAR.replace("l: 0.3 m", "l: 0.3 m, a0: 30 deg") + PLANAR_JOINTS.replace(
        "child: a", "child: a, angle: a0"
    )
    rotation = load_text(text).joints[0].at_parent.rotation
    assert (
        rotation is not None
        and rotation[0][0] == expression("cos(a0)")
        and rotation[2] == (ZERO, ZERO, ONE)
    )


@pytest.mark.parametrize("kind", CLOSURES)
def test_every_joint_closes_a_loop(kind: str) -> None:
    axis = "" if kind in ("ball", "fixed") else ", axis: x"
    pitch = ", pitch: p" if kind == "screw" else ""
    given = f"type: {kind}, between: [b, c], at: [[l, 0, 0], {{position: [0, l, 0], rpy: [0, 90 deg, 0]}}]{axis}{pitch}"
    found = with_tie("closures", given)
    assert found.type == kind and found.bodies == ("b", "c")
    assert found.placements[0].rotation is None and found.placements[1].rotation is not None
    assert found.axis2 == ((ZERO, ONE, ZERO) if kind == "universal" else None)
    assert found.pitch == (Name("p") if kind == "screw" else ZERO)


@pytest.mark.parametrize("kind", ["revolute", "prismatic, axis: x", "fixed"])
def test_closures_in_the_plane(kind: str) -> None:
    text = (
        PLANAR
        + PLANAR_JOINTS
        + f"closures: {{k: {{type: {kind}, between: [a, b], at: [[l, 0], {{angle: 30 deg}}]}}}}\n"
    )
    assert load_text(text).closures[0].type == kind.split(",")[0]


def test_rod_and_surface() -> None:
    rod = with_tie(
        "constraints",
        "type: distance, between: [b, ground], at: [[l, 0, 0], [0, 0, 1 m]], length: 2*l",
    )
    assert isinstance(rod, Distance)
    assert (rod.bodies, rod.length, rod.points[0]) == (
        ("b", "ground"),
        expression("2*l"),
        (Name("l"), ZERO, ZERO),
    )
    on = with_tie(
        "constraints", 'type: point_on_surface, body: b, at: [l, 0, 0], surface: "z - x^2/l", of: c'
    )
    assert isinstance(on, OnSurface)
    assert (on.body, on.frame_body, on.surface) == ("b", "c", expression("z - x^2/l"))
    assert (
        with_tie("constraints", "type: point_on_surface, body: b, surface: z").frame_body
        == "ground"
    )


def test_three_coordinates_of_a_free_joint_are_its_position() -> None:
    """As most people write it; the angles have their names beside their sequence."""
    short, long = (
        joint("type: free, coordinates: [x, y, z]"),
        joint("type: free, position: [x, y, z]"),
    )
    assert short.coordinates == long.coordinates
    turned = joint(
        "type: free, coordinates: [x, y, z], orientation: {euler: zyx, angles: [a, b, c]}"
    )
    assert turned.coordinates == ("x", "y", "z", "a", "b", "c")


def test_a_free_joint_turns_by_a_quaternion_unless_the_file_says_otherwise() -> None:
    silent, said = joint("type: free"), joint("type: free, orientation: quaternion")
    assert silent.orientation == "quaternion" and silent.coordinates == said.coordinates
    assert len(silent.coordinates) == 7
    euler = joint("type: free, orientation: {euler: zyx}")
    assert euler.orientation == "zyx" and len(euler.coordinates) == 6


def test_a_ball_joint_turns_by_a_quaternion_or_by_euler_angles() -> None:
    silent, said = joint("type: ball"), joint("type: ball, orientation: quaternion")
    assert silent.orientation == "quaternion" and silent.coordinates == said.coordinates
    assert len(silent.coordinates) == 4
    named = joint("type: ball, orientation: {euler: zxz, angles: [a, b, c]}")
    assert named.orientation == "zxz" and named.coordinates == ("a", "b", "c")
    short = joint("type: ball, orientation: {euler: zxz}, coordinates: [a, b, c]")
    assert short.coordinates == ("a", "b", "c")
    quaternion = joint("type: ball, orientation: {quaternion: [e0, e1, e2, e3]}")
    assert quaternion.coordinates == ("e0", "e1", "e2", "e3")


def test_a_coupling_knows_its_follower_and_a_gear_has_none() -> None:
    text = PLANAR + HINGES
    for kind, follower in (("coupling", "A"), ("gear", "")):
        tie = load_text(text + f"constraints: {{k: {{type: {kind}, joints: [A, B], ratio: 2}}}}\n")
        assert tie.constraints[0].follower == follower  # type: ignore[union-attr]


def test_a_surface_has_its_own_x_y_z() -> None:
    text = (
        HEAD
        + "bodies: {b: {mass: m}}\njoints: {B: {type: free, parent: ground, child: b, position: [z, y, x]}}\n"
    )
    on = load_text(
        text + "constraints: {k: {type: point_on_surface, body: b, surface: z - 0.1*x}}\n"
    ).constraints[0]
    assert isinstance(on, OnSurface) and on.surface == expression("z - 0.1*x")


PLANETARY = """
model: planetary
plane: xy
bodies: {sun: {mass: 1, inertia: 0.1}, carrier: {mass: 1, inertia: 0.4}, planet: {mass: 0.3, inertia: 0.01}}
joints:
  js: {type: revolute, parent: ground, child: sun, coordinate: qs}
  jc: {type: revolute, parent: ground, child: carrier, coordinate: qc}
  jp: {type: revolute, parent: carrier, child: planet, at: [0.08, 0], coordinate: qp}
"""


@pytest.mark.parametrize(
    "pair, notes", [("[js, jp]", 1), ("[jp, js]", 1), ("[js, jc]", 0), ("[jc, jp]", 0)]
)
def test_a_gear_between_wheels_on_different_bodies_is_noted(pair: str, notes: int) -> None:
    """A planet that rolls on a wheel which stands still is in gear with its carrier."""
    mesh = f"constraints: {{mesh: {{type: gear, joints: {pair}, ratio: -0.6}}}}\n"
    model = load_text(PLANETARY + mesh)
    assert len(model.notes) == notes
    assert all("'mesh'" in note and "jp against carrier" in note for note in model.notes)


def test_gears_couplings_and_prescribed_motion_are_holonomic() -> None:
    text = PLANAR + HINGES
    gear = load_text(
        text + "constraints: {k: {type: gear, joints: [A, B], ratio: -3, offset: 10 deg}}\n"
    ).constraints[0]
    assert isinstance(gear, Holonomic)
    assert number(
        gear.expression, {"A": -3 * 0.7 + math.radians(10), "B": 0.7}, ""
    ) == pytest.approx(0.0, abs=1e-15)
    slide = text.replace(
        "type: revolute, parent: ground", "type: prismatic, axis: x, parent: ground"
    )
    rack = load_text(
        slide + "constraints: {k: {type: coupling, coordinates: [A, B], ratio: l}}\n"
    ).constraints[0]
    assert isinstance(rack, Holonomic) and number(
        rack.expression, {"A": 0.6, "B": 2.0, "l": 0.3}, ""
    ) == pytest.approx(0.0)
    moved = load_text(
        text + 'constraints: {k: {type: prescribed, joint: A, motion: "0.2*sin(3 rad/s*t)"}}\n'
    ).constraints[0]
    assert isinstance(moved, Holonomic) and moved.expression == expression("A - 0.2*sin(3 rad/s*t)")


@pytest.mark.parametrize(
    ("shape", "kind", "tube"),
    [
        ("disk: {radius: l, axis: y}", "disk", ZERO),
        ("wheel: {radius: l, axis: y}", "disk", ZERO),
        ("knife_edge: {radius: l, axis: y}", "disk", ZERO),
        ("sphere: {radius: l}", "sphere", ZERO),
        ("torus: {radius: l, tube: p, axis: y}", "torus", Name("p")),
    ],
)
def test_shapes_that_roll(shape: str, kind: str, tube: object) -> None:
    found = with_tie(
        "constraints",
        f"type: rolling, body: b, shape: {{{shape}}}, plane: {{normal: [0, 3, 4], origin: [0, 0, l]}}",
    )
    assert isinstance(found, Rolling)
    assert (found.shape, found.radius, found.tube) == (kind, Name("l"), tube)
    assert found.normal == (ZERO, Number(0.6), Number(0.8)) and found.origin[2] == Name("l")


def test_a_wheel_rolls_on_a_line_in_the_plane() -> None:
    text = PLANAR + PLANAR_JOINTS
    roll = "constraints: {k: {type: rolling, body: b, shape: {wheel: {radius: l}}, plane: {normal: y}}}\n"
    found = load_text(text + roll).constraints[0]
    assert isinstance(found, Rolling) and (found.axis, found.normal) == (
        (ZERO, ZERO, ONE),
        (ZERO, ONE, ZERO),
    )


def test_loads_of_a_joint() -> None:
    model = load_text(
        HEAD
        + "bodies: {a: {mass: m}}\n"
        + "joints:\n  A: {type: prismatic, parent: ground, child: a, axis: x, spring: {stiffness: 3 N/m, rest: l},\n"
        + "      damper: 2 N*s/m, friction: {viscous: 0.1 N*s/m, coulomb: 2 N, smoothing: 1 mm/s}, armature: 0.4 kg}\n"
    )
    spring, damper, friction, armature = model.loads
    assert isinstance(spring, JointSpring) and (spring.name, spring.coordinate, spring.rest) == (
        "A_spring",
        "A",
        Name("l"),
    )
    assert isinstance(damper, JointDamper) and (damper.name, damper.velocity) == (
        "A_damper",
        "der(A)",
    )
    assert isinstance(friction, JointFriction) and friction.smoothing == Number(0.001, "m/s")
    assert isinstance(armature, Armature) and (armature.name, armature.inertia) == (
        "A_armature",
        Number(0.4, "kg"),
    )


def test_loads_of_their_own() -> None:
    friction = with_tie("loads", "type: friction, joint: A, viscous: 0.3 N*m*s/rad")
    assert friction == JointFriction(
        "k", "der(q)", Number(0.3, "N*m*s/rad"), ZERO, ONE, friction.span, dry=False
    )
    armature = with_tie("loads", "type: armature, velocity: B.wx, inertia: 0.1 kg*m^2")
    assert armature == Armature("k", "B.wx", Number(0.1, "kg*m^2"), armature.span)
    soft = with_tie(
        "loads",
        "type: bushing, between: [b, c], stiffness: 3 N/m, torsion: [1, 2, 3], damping: [1 N*s/m]",
    )
    assert isinstance(soft, Bushing)
    assert soft.stiffness == (Number(3.0, "N/m"),) * 3 and soft.torsion == (
        ONE,
        Number(2.0),
        Number(3.0),
    )
    assert soft.damping == (Number(1.0, "N*s/m"),) * 3 and soft.torsion_damping == (ZERO,) * 3


def test_a_bushing_in_the_plane() -> None:
    text = (
        PLANAR
        + PLANAR_JOINTS
        + "loads: {k: {type: bushing, between: [a, b], stiffness: [1, 2], torsion: 3}}\n"
    )
    soft = load_text(text).loads[0]
    assert isinstance(soft, Bushing)
    assert (soft.stiffness, soft.torsion) == ((ONE, Number(2.0), ZERO), (ZERO, ZERO, Number(3.0)))


def test_actuators_with_gears_and_rotors() -> None:
    model = load_text(
        PLANAR
        + HINGES
        + "inputs: {u: {joint: A, gear: 100, rotor_inertia: 1e-4 kg*m^2}, w: {joint: B}, free: {unit: N}}\n"
    )
    assert [(u.gear, u.unit) for u in model.inputs] == [
        (Number(100.0), "N*m"),
        (ONE, "N*m"),
        (ONE, "N"),
    ]
    (rotor,) = model.loads
    assert isinstance(rotor, Armature) and (rotor.name, rotor.velocity) == ("u_rotor", "der(A)")
    assert number(rotor.inertia, {}, "") == pytest.approx(1.0)


def test_a_gear_from_turning_to_sliding_has_its_own_unit() -> None:
    slide = (
        HEAD
        + "bodies: {a: {mass: m}}\njoints: {A: {type: prismatic, parent: ground, child: a, axis: x}}\n"
    )
    model = load_text(slide + "inputs: {u: {joint: A, gear: 2*pi/p, rotor_inertia: 1e-6 kg*m^2}}\n")
    assert model.inputs[0].unit == "N*m"
    rotor = model.loads[0]
    assert isinstance(rotor, Armature)
    assert number(rotor.inertia, {"p": 0.005}, "") == pytest.approx(
        1e-6 * (2 * math.pi / 0.005) ** 2
    )


INERTIA = (
    HEAD
    + "bodies: {a: {mass: m, com: [l, 0, 0], inertia: …}}\njoints: {A: {type: free, parent: ground, child: a}}\n"
)


def moments(inertia: str, **values: float) -> list[float]:
    body = load_text(INERTIA.replace("…", inertia)).bodies[0]
    return [
        number(entry, {"m": 1.0, "l": 0.3, "tilt": math.radians(20)} | values, "")
        for entry in body.inertia
    ]


def test_inertia_about_the_origin_is_moved() -> None:
    assert moments("{tensor: [0.1, 0.2, 0.2], about: origin}") == pytest.approx(
        [0.1, 0.11, 0.11, 0, 0, 0]
    )
    assert moments("{tensor: [0.1, 0.2, 0.2], about: com}") == pytest.approx(
        [0.1, 0.2, 0.2, 0, 0, 0]
    )
    follows = moments("{tensor: [0.1, m*l^2 + 0.1, m*l^2 + 0.1], about: origin}", l=0.7)
    assert follows == pytest.approx([0.1, 0.1, 0.1, 0, 0, 0])


def test_a_point_mass_about_the_origin_has_no_inertia_of_its_own() -> None:
    assert moments("{tensor: [0, m*l^2, m*l^2], about: origin}") == pytest.approx(
        [0.0] * 6, abs=1e-17
    )


def test_inertia_in_a_turned_frame() -> None:
    assert moments("{tensor: [1, 2, 3 - 0.5], frame: {rpy: [0, 0, 90 deg]}}") == pytest.approx(
        [2, 1, 2.5, 0, 0, 0]
    )
    s, c = math.sin(math.radians(20)), math.cos(math.radians(20))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    wanted = R @ np.array([[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2.5]]) @ R.T
    for angle in ("20 deg", "tilt"):
        found = moments(
            f"{{tensor: [1, 2, 2.5, 0.1, 0.2, 0.3], frame: {{axis_angle: [z, {angle}]}}}}"
        )
        assert found == pytest.approx(
            [*np.diag(wanted), wanted[0, 1], wanted[0, 2], wanted[1, 2]], rel=1e-13
        )


def test_inertia_in_the_plane_can_be_about_the_origin() -> None:
    text = "model: m\nplane: xy\nbodies: {a: {mass: 2 kg, com: [3 m, 4 m], inertia: {tensor: 60 kg*m^2, about: origin}}}\n"
    body = load_text(text + "joints: {A: {type: planar, parent: ground, child: a}}\n").bodies[0]
    assert body.inertia[:3] == (ZERO, ZERO, Number(10.0, "kg*m^2"))


def initial(text: str) -> dict[str, tuple[float, bool]]:
    ball = (
        HEAD
        + "bodies: {a: {mass: m, inertia: 0.1}}\njoints: {A: {type: ball, parent: ground, child: a}}\n"
    )
    found = load_text(f"{ball}initial: {{{text}}}\n").initial
    return {x.name: (number(x.value, {"tilt": math.radians(20)}, ""), x.held) for x in found}


def test_quaternions_start_with_length_one() -> None:
    assert initial("") == {}
    assert initial("A_qw: 3, A_qy: 4") == {
        "A_qw": (0.6, True),
        "A_qy": (0.8, True),
        "A_qx": (0.0, False),
        "A_qz": (0.0, False),
    }
    half = initial("A_qw: cos(tilt/2), guess: {A_qx: sin(tilt/2)}")
    assert half["A_qw"] == (math.cos(math.radians(10)), True) and half["A_qx"] == (
        math.sin(math.radians(10)),
        False,
    )
    scaled = initial("A_qw: 2, A_qx: tilt")
    assert sum(value**2 for value, _ in scaled.values()) == pytest.approx(1.0)


def test_numbers_per_unit() -> None:
    assert quantity("2 1/s") == Number(2.0, "1/s")
    assert quantity("-0.3 1/m") == Number(-0.3, "1/m")
    assert quantity("2 1/s^2") == Number(2.0, "1/s^2")
    assert expression("2 1/s*t + 1") == tree.Sum(
        (tree.Product((Number(2.0, "1/s"), Name("t"))), ONE)
    )
    assert (
        load_text(
            "model: a\nparameters: {f: 2 1/s}\ncoordinates: {x: m}\nkinetic: (1 kg)*der(x)^2\n"
        )
        .parameters[0]
        .unit
        == "1/s"
    )


def test_analytic_form_on_top_of_a_mechanism_computes() -> None:
    """A pendulum with a slide on it, once with the slide as a body and once with its energies and a
    constraint by formula."""
    head = "model: m\nplane: xy\ngravity: [0, -9.81 m/s^2]\nparameters: {m: 2 kg, g: 9.81 m/s^2, l: 0.3 m}\n"
    arm = "a: {mass: 1 kg, com: [l, 0], inertia: 0.1}"
    hinge = "A: {type: revolute, parent: ground, child: a, coordinate: q}"
    rest = "constraints: {c: {holonomic: s - l*(1 + q)}}\ninitial: {q: 0.3, der(q): 2, guess: {s: 0.4}}\n"
    slide = "S: {type: prismatic, parent: a, child: b, axis: x, coordinate: s}"
    bodies = f"{head}bodies: {{{arm}, b: {{mass: m}}}}\njoints: {{{hinge}, {slide}}}\n{rest}"
    energies = "kinetic: m/2*(der(s)^2 + (s*der(q))^2)\npotential: m*g*s*sin(q)\n"
    mixed = f"{head}bodies: {{{arm}}}\njoints: {{{hinge}}}\ncoordinates: {{s: m}}\n{energies}{rest}"
    assert accelerations(load_text(mixed))[0] == pytest.approx(
        accelerations(load_text(bodies))[0], rel=1e-12
    )


def accelerations(model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """v̇, λ and M at the consistent initial state, from the System alone."""
    s = system(model)
    start = initial_state(s)
    terms = ca.Function(
        "f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.h, s.Q, s.A, s.beta)]
    )
    M, h, Q, A, beta = (
        np.asarray(x) for x in terms(0, start.q, start.v, np.zeros(s.u.numel()), s.parameters)
    )
    saddle = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
    found = np.linalg.lstsq(saddle, np.vstack([Q - h, beta]), rcond=1e-12)[0].ravel()
    return found[: len(M)], found[len(M) :], M


def test_saha_s_planar_arm() -> None:
    acceleration, _, M = accelerations(load(MODELS / "planar_3r.yaml"))
    assert acceleration == pytest.approx([-42.47870813, 57.96818182, -21.89008264], rel=1e-9)
    assert M[np.triu_indices(3)] == pytest.approx(
        [0.22122333, 0.09582333, 0.02299, 0.04842333, 0.01309, 0.00484], abs=5e-9
    )


def test_stanford_arm_has_the_frames_of_its_table() -> None:
    """Standard Denavit-Hartenberg (theta, d, alpha), a = 0, against the recursion over placed
    frames."""
    q = [0.3, -0.7, 0.5, 1.1, 0.4, -0.2]
    table = [
        (q[0], 0.412, -90),
        (q[1], 0.154, 90),
        (math.radians(-90), q[2], 0),
        (q[3], 0, -90),
        (q[4], 0, 90),
        (q[5], 0, 0),
    ]
    T = np.eye(4)
    for theta, d, alpha in table:
        (s, c), (sa, ca_) = ((math.sin(x), math.cos(x)) for x in (theta, math.radians(alpha)))
        T = T @ [[c, -s * ca_, s * sa, 0], [s, c * ca_, -c * sa, 0], [0, sa, ca_, d], [0, 0, 0, 1]]
    arm = system(load(MODELS / "stanford_arm.yaml"), "all")
    outputs = {name: value for name, value, _ in arm.outputs}
    found = ca.Function("f", [arm.q], [outputs["wrist"], outputs["grip"]])(q)
    assert np.asarray(found[0]).ravel() == pytest.approx(T[:3, 3], abs=1e-15)
    assert np.asarray(found[1]).ravel() == pytest.approx(T[:3, 3] + 0.263 * T[:3, 2], abs=1e-15)


def test_andrews_squeezer_starts_as_published() -> None:
    acceleration, reactions, _ = accelerations(load(MODELS / "andrews.yaml"))
    assert acceleration == pytest.approx(
        [14222.4439199541, -10666.8329399655, 0, 0, 0, 0, 0], rel=1e-10, abs=1e-8
    )
    assert -reactions[:2] == pytest.approx([98.5668703962411, -6.12268834425566], rel=1e-12)


def test_four_bar_chain_is_the_pendulum_it_should_be() -> None:
    """[(N+1)/3 + N] th'' = -[(N+1)/2 + N] (g/l) cos th with N = 2, away from the vertical start."""
    text = (
        (MODELS / "extremes" / "four_bar_chain.yaml")
        .read_text()
        .replace("q0: 90 deg", "q0: 60 deg")
    )
    text = (
        text.replace("s1: -90", "s1: -60")
        .replace("q1: 90", "q1: 60")
        .replace("s2: -90", "s2: -60")
        .replace("q2: 90", "q2: 60")
    )
    acceleration = accelerations(load_text(text))[0]
    assert acceleration[0] == pytest.approx(-3.5 * 9.81 * 0.5 / 3.0, rel=1e-12)


def test_planetary_stage_has_the_ratio_of_its_teeth() -> None:
    start = initial_state(system(load(MODELS / "gear_train.yaml")))
    names = [c.name for c in load(MODELS / "gear_train.yaml").coordinates]
    rate = dict(zip(names, start.v))
    assert rate["qm"] == pytest.approx(30.0) and rate["qs"] == pytest.approx(-10.0)
    assert rate["qs"] / rate["qc"] == pytest.approx(1 + 0.08 / 0.02)


def test_aligned_forks_carry_the_speed_over_unchanged() -> None:
    s = system(load(MODELS / "universal_shaft.yaml"))
    start = initial_state(s, {"q": 0.7})
    assert start.v[0] == pytest.approx(10.0)
    a1, a2, b1, b2 = start.q[1:]
    assert (a2 + b1, a1 + b2) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


def test_bricard_keeps_its_mobility() -> None:
    s = system(load(MODELS / "extremes" / "bricard.yaml"))
    start = initial_state(s, {"q1": 0.4})
    rows = np.asarray(
        ca.Function("A", [s.t, s.q, s.p], [ca.densify(s.A)])(0, start.q, s.parameters)
    )
    size = np.linalg.svd(rows, compute_uv=False)
    assert rows.shape == (5, 5) and size[3] > 0.1 and size[4] < 1e-9


def test_kinds_name_everything_once() -> None:
    names = {
        category: [name for kind, name, _ in KINDS if kind == category]
        for category in ("joint", "closure", "constraint", "load")
    }
    assert names["joint"] == [joint.name for joint in JOINTS]
    assert names["closure"] == list(CLOSURES)
    assert set(names["joint"]) - set(names["closure"]) == {"free", "point"}
    assert names["constraint"][:4] == ["holonomic", "nonholonomic", "no_slip", "rolling"]
    assert set(names["load"]) >= {"spring", "bushing", "friction", "armature"}
    assert all(about and "\n" not in about for _, _, about in KINDS)
    assert all(len(set(found)) == len(found) for found in names.values())


def test_schema_knows_the_kinds() -> None:
    definitions = schema()["$defs"]
    consts = {
        entry["properties"]["type"].get("const")
        for entry in definitions.values()
        if "type" in entry.get("properties", {})
    }
    assert {name for kind, name, _ in KINDS if kind in ("constraint", "load")} - {
        "holonomic",
        "nonholonomic",
    } <= consts
    assert definitions["ClosureEntry"]["properties"]["type"]["enum"] == [
        name for kind, name, _ in KINDS if kind == "closure"
    ]
