"""One file per error in a mechanism: where it points, what it says and what it expected. The mark «
stands before the place."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from derive.diagnostics import ModelError
from derive.model import Model, load_text

HEAD = "model: m\nparameters: {m: 1 kg, l: 0.3 m, zero: 0}\n"
BODIES = "bodies: {a: {mass: m, inertia: 0.1}, b: {mass: m, inertia: 0.1}}\n"
FREE_B = "B: {type: free, parent: ground, child: b, orientation: quaternion}"
SCENE = (
    HEAD
    + BODIES
    + f"joints: {{A: {{type: revolute, parent: ground, child: a, axis: z, coordinate: q}}, {FREE_B}}}\n"
)
FLAT = HEAD.replace("model: m", "model: m\nplane: xy") + BODIES
HINGES = "joints: {A: {type: revolute, parent: ground, child: a}, B: {type: revolute, parent: a, child: b}}\n"
CHAIN = "model: m\nplane: xy\nparameters: {m: 1 kg, l: 0.3 m, zero: 0}\nbodies: {a: {mass: m, inertia: 0.1}, «tip: {mass: 0}}\n"
TIP = "joints: {A: {type: revolute, parent: ground, child: a}, T: {type: revolute, parent: a, child: tip, at: [l, 0]}}\n"


def joint(text: str, name: str = "A") -> str:
    return HEAD + BODIES + f"joints: {{{name}: {{parent: ground, child: a, {text}}}, {FREE_B}}}\n"


def closure(text: str, name: str = "C") -> str:
    return (
        SCENE + f"closures: {{{name}: {{between: [a, b], at: [[0, 0, 0], [0, 0, 0]], {text}}}}}\n"
    )


def tie(text: str, name: str = "c") -> str:
    return SCENE + f"constraints: {{{name}: {{{text}}}}}\n"


def load(text: str, name: str = "f") -> str:
    return SCENE + f"loads: {{{name}: {{{text}}}}}\n"


def body(text: str) -> str:
    return (
        HEAD
        + f"bodies: {{a: {{{text}}}}}\njoints: {{A: {{type: free, parent: ground, child: a}}}}\n"
    )


def initial(text: str) -> str:
    return SCENE + f"initial: {{{text}}}\n"


# id, text, message, expected, hint
ERRORS = [
    # joints
    (
        "joint_type",
        joint("type: «hinge, axis: z"),
        "unknown type of joint 'hinge'",
        "revolute, prismatic, screw, cylindrical",
        "",
    ),
    ("joint_near", joint("type: «sphere"), "unknown type of joint 'sphere'", "ball", ""),
    (
        "screw_near",
        joint("type: «scrwe, axis: z"),
        "unknown type of joint 'scrwe'",
        "screw",
        "did you mean 'screw'?",
    ),
    (
        "zero_axis",
        joint("type: revolute, axis: «[0, 0, 0]"),
        "an axis of length zero",
        "a direction",
        "",
    ),
    (
        "no_axis",
        joint("type: cylindrical", "«A"),
        "the cylindrical joint 'A' has no axis",
        "axis: x, y, z",
        "",
    ),
    ("axis_of_ball", joint("type: ball, axis: «z"), "an axis of a ball joint", "no axis", ""),
    (
        "parallel",
        joint("type: universal, axis: z, axis2: «[0, 0, -2]"),
        "the second axis of 'A' is parallel",
        "right angles",
        "",
    ),
    (
        "oblique",
        joint("type: universal, axis: z, axis2: «[0, 1, 1]"),
        "'A' is not at right angles to the first",
        "right",
        "",
    ),
    (
        "zero_axis2",
        joint("type: universal, axis: z, axis2: «[0, 0, 0]"),
        "a second axis of length zero",
        "a direction",
        "",
    ),
    (
        "axis2_of_hinge",
        joint("type: revolute, axis: z, axis2: «x"),
        "a second axis of a revolute joint",
        "no axis2",
        "",
    ),
    (
        "no_pitch",
        joint("type: screw, axis: z", "«A"),
        "the screw 'A' has no pitch",
        "such as 5 mm",
        "",
    ),
    (
        "zero_pitch",
        joint("type: screw, axis: z, pitch: «0 m"),
        "the pitch of 'A' is zero",
        "metres per turn",
        "a revolute joint",
    ),
    (
        "zero_pitch_by_name",
        joint("type: screw, axis: z, pitch: «zero*l"),
        "the pitch of 'A' is zero",
        "metres per turn",
        "",
    ),
    (
        "pitch_of_hinge",
        joint("type: revolute, axis: z, pitch: «5 mm"),
        "the pitch of a revolute joint",
        "a screw",
        "",
    ),
    ("pitch_unit", joint("type: screw, axis: z, pitch: «5 kg"), "a pitch in kg", "m", ""),
    (
        "pitch_per_angle",
        joint("type: screw, axis: z, pitch: «p").replace("l: 0.3 m", "l: 0.3 m, p: 5 mm/rev"),
        "a pitch in m/rad",
        "metres per turn",
        "",
    ),
    (
        "limits_count",
        joint("type: revolute, axis: z, limits: «[0]"),
        "1 limits",
        "[lowest, highest]",
        "",
    ),
    (
        "limits_order",
        joint("type: revolute, axis: z, limits: «[1, -1]"),
        "the lowest limit 1 is above the highest -1",
        "",
        "",
    ),
    (
        "limits_of_ball",
        joint("type: ball, limits: «[0, 1]"),
        "limits of a joint with 4 coordinates",
        "one coordinate",
        "",
    ),
    ("limits_unit", joint("type: revolute, axis: z, limits: [«1 m, 2]"), "a limit in m", "rad", ""),
    (
        "quaternion_word",
        joint("type: free, orientation: «quaternoin"),
        "unknown orientation",
        "",
        "did you mean 'quaternion'?",
    ),
    (
        "euler_beside",
        joint("type: free, orientation: {quaternion: [a0, a1, a2, a3], euler: «zyx}"),
        "beside a quaternion",
        "",
        "",
    ),
    (
        "no_sequence",
        joint("type: free, orientation: {angles: «[e, f, g]}"),
        "without a sequence",
        "such as zxy",
        "",
    ),
    (
        "empty_orientation",
        joint("type: «free, orientation: {}"),
        "an orientation without a sequence",
        "quaternion",
        "",
    ),
    (
        "orientation_kind",
        joint("type: free, orientation: «[a, b]"),
        "a list under 'orientation'",
        "quaternion, or a mapping",
        "",
    ),
    (
        "quaternion_names",
        joint("type: free, orientation: {quaternion: «[e0, e1]}"),
        "2 names for the orientation",
        "four names",
        "",
    ),
    (
        "ball_names",
        joint("type: ball, coordinates: «[e0, e1]"),
        "2 coordinates of the ball joint 'A'",
        "4: [qw, qx, qy, qz]",
        "",
    ),
    (
        "ball_in_the_plane",
        FLAT
        + "joints: {A: {type: «ball, parent: ground, child: a}, B: {type: planar, parent: ground, child: b}}\n",
        "a ball joint in a planar model",
        "revolute, prismatic, planar, point, fixed",
        "",
    ),
    # placed frames
    (
        "turned_twice",
        joint("type: revolute, axis: z, rpy: [0, 0, 1], at: {parent: {rpy: [0, 1, 0]}}", "«A"),
        "turned twice",
        "",
        "",
    ),
    (
        "two_turns",
        joint("type: revolute, axis: z, rpy: [0, 0, 1], matrix: «[]"),
        "'matrix' beside 'rpy'",
        "one of the two",
        "",
    ),
    (
        "angle_in_space",
        joint("type: revolute, axis: z, angle: «1"),
        "'angle' in space",
        "rpy, axis_angle, matrix",
        "",
    ),
    (
        "two_angles",
        joint("type: revolute, axis: z, rpy: «[0, 1]"),
        "2 angles",
        "three: [roll, pitch, yaw]",
        "",
    ),
    (
        "angle_unit",
        joint("type: revolute, axis: z, axis_angle: [z, «1 m]"),
        "an angle in m",
        "rad",
        "",
    ),
    (
        "axis_angle_count",
        joint("type: revolute, axis: z, axis_angle: «[z]"),
        "not an axis and an angle",
        "[z, 30 deg]",
        "",
    ),
    (
        "axis_angle_zero",
        joint("type: revolute, axis: z, axis_angle: [«[0, 0, 0], 1]"),
        "an axis of length zero",
        "",
        "",
    ),
    (
        "axis_angle_nested",
        joint("type: revolute, axis: z, axis_angle: [[«[1], 0, 0], 1]"),
        "a list or a mapping here",
        "",
        "",
    ),
    (
        "matrix_shape",
        joint("type: revolute, axis: z, matrix: «[[1, 0], [0, 1]]"),
        "not a rotation matrix",
        "three rows",
        "",
    ),
    (
        "matrix_sheared",
        joint("type: revolute, axis: z, matrix: «[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]"),
        "not a rotation",
        "determinant 1",
        "",
    ),
    (
        "matrix_mirrored",
        joint("type: revolute, axis: z, matrix: «[[1, 0, 0], [0, 1, 0], [0, 0, -1]]"),
        "not a rotation",
        "determinant 1",
        "",
    ),
    (
        "matrix_name",
        joint("type: revolute, axis: z, matrix: [[«l, 0, 0], [0, 1, 0], [0, 0, 1]]"),
        "cannot stand in an entry of a matrix",
        "",
        "",
    ),
    (
        "side_key",
        joint("type: revolute, axis: z, at: {«body: [0, 0, 0]}"),
        "unknown key 'body'",
        "parent, child",
        "",
    ),
    (
        "side_kind",
        joint("type: revolute, axis: z, at: {parent: «5}"),
        "a number under 'parent'",
        "a point [ ]",
        "",
    ),
    (
        "place_kind",
        joint("type: revolute, axis: z, at: «5"),
        "a number under 'at'",
        "a point [ ], two of them, or a mapping",
        "",
    ),
    (
        "rpy_in_the_plane",
        FLAT + HINGES.replace("child: b", "child: b, axis_angle: «[z, 1]"),
        "'axis_angle' in a planar",
        "angle",
        "",
    ),
    # the tree
    (
        "ring",
        FLAT.replace("bodies: {a", "bodies: {«a") + HINGES.replace("parent: ground", "parent: b"),
        "the body 'a' is not connected to the ground: the joints 'A', 'B' go in a ring",
        "a chain of joints",
        "`closures:`",
    ),
    (
        "loop_in_the_tree",
        FLAT
        + HINGES.replace("at: ", "").replace(
            "}\n", ", C: {type: revolute, parent: ground, child: «b}}\n"
        ),
        "'b' is already the child of the joint 'B'",
        "one joint per child",
        "`closures:`",
    ),
    (
        "disconnected",
        FLAT.replace("b: {", "«b: {") + HINGES[: HINGES.index(", B")] + "}\n",
        "no joint carries the body 'b'",
        "",
        "planar",
    ),
    # massless tips
    (
        "massless_tip",
        CHAIN + TIP,
        "nothing gives 'tip' inertia: the joint 'T' has nothing",
        "an armature",
        "a fixed joint",
    ),
    (
        "massless_by_name",
        CHAIN.replace("mass: 0", "mass: zero*m") + TIP,
        "nothing gives 'tip' inertia",
        "",
        "",
    ),
    (
        "massless_chain",
        CHAIN.replace("a: {mass: m, inertia: 0.1}", "a: {mass: 0}") + TIP,
        "nothing gives 'tip' inertia",
        "",
        "",
    ),
    # closures
    (
        "closure_itself",
        SCENE + "closures: {C: {type: ball, between: «[a, a], at: [[0, 0, 0], [0, 0, 0]]}}\n",
        "'a' and itself",
        "",
        "",
    ),
    (
        "closure_free",
        closure("type: «free"),
        "unknown type of closure 'free'",
        "revolute, prismatic, screw",
        "",
    ),
    (
        "closure_near",
        closure("type: «cylindric, axis: z"),
        "unknown type of closure 'cylindric'",
        "",
        "'cylindrical'",
    ),
    ("closure_pitch", closure("type: screw, axis: z", "«C"), "the screw 'C' has no pitch", "", ""),
    (
        "closure_axis2",
        closure("type: universal, axis: z, axis2: «z"),
        "the second axis of 'C' is parallel to the first",
        "",
        "",
    ),
    ("closure_axis", closure("type: planar, axis: «[0, 0, 0]"), "an axis of length zero", "", ""),
    (
        "planar_closure",
        FLAT
        + HINGES
        + "closures: {C: {type: «ball, between: [b, ground], at: [[0, 0], [0, 0]]}}\n",
        "unknown type of closure 'ball'",
        "revolute, prismatic, fixed",
        "",
    ),
    # constraints
    (
        "unknown_tie",
        tie("type: «geer, joints: [A, B], ratio: 2"),
        "unknown type 'geer'",
        "rolling, distance",
        "'gear'",
    ),
    (
        "distance_zero",
        tie("type: distance, between: [a, b], at: [[0, 0, 0], [0, 0, 0]], length: «0 m"),
        "'c' is 0 m",
        "more",
        "",
    ),
    (
        "distance_itself",
        tie("type: distance, between: «[a, a], at: [[0, 0, 0], [0, 0, 0]], length: l"),
        "'a' and itself",
        "",
        "",
    ),
    (
        "surface_names",
        tie("type: point_on_surface, body: b, surface: «l"),
        "a surface without x, y, z",
        "zero on the surface",
        "",
    ),
    (
        "surface_coordinate",
        tie("type: point_on_surface, body: b, surface: z - «q"),
        "unknown name 'q'",
        "l, zero",
        "",
    ),
    (
        "surface_unit",
        tie("type: point_on_surface, body: b, surface: z «- x^2"),
        "cannot add m^2 to m",
        "m",
        "",
    ),
    (
        "surface_itself",
        tie("type: point_on_surface, body: b, surface: z, of: «b"),
        "between 'b' and itself",
        "two bodies",
        "",
    ),
    (
        "surface_body",
        tie("type: point_on_surface, body: b, surface: z, of: «d"),
        "unknown body 'd'",
        "a, b, ground",
        "",
    ),
    (
        "surface_in_plane",
        FLAT + HINGES + "constraints: {c: {type: point_on_surface, body: b, surface: «z}}\n",
        "unknown name 'z'",
        "",
        "",
    ),
    (
        "gear_ratio",
        tie("type: gear, coordinates: [q, B_x], ratio: 0", "«c"),
        "the gear 'c' at 'B_x', which is in m",
        "turning",
        "coupling",
    ),
    (
        "ratio_zero",
        FLAT + HINGES + "constraints: {c: {type: gear, joints: [A, B], ratio: «0}}\n",
        "the ratio of 'c' is zero",
        "",
        "",
    ),
    (
        "ratio_missing",
        tie("type: coupling, coordinates: [q, B_x]", "«c"),
        "'c' has no 'ratio'",
        "",
        "",
    ),
    (
        "ratio_unit",
        tie("type: coupling, coordinates: [q, B_x], ratio: «3 m"),
        "a ratio in m",
        "1/m",
        "",
    ),
    (
        "couples_nothing",
        tie("type: coupling, ratio: 2", "«c"),
        "'c' does not say what it couples",
        "joints: [A, B]",
        "",
    ),
    (
        "couples_three",
        tie("type: coupling, coordinates: «[q, B_x, B_y], ratio: 1"),
        "'c' couples 3",
        "two",
        "",
    ),
    (
        "couples_itself",
        tie("type: coupling, coordinates: «[q, q], ratio: 1"),
        "couples 'q' with itself",
        "two",
        "",
    ),
    (
        "couples_free",
        tie("type: coupling, joints: [A, «B], ratio: 1"),
        "the joint 'B' has 7 coordinates",
        "coordinates: with one",
        "",
    ),
    (
        "couples_unknown",
        tie("type: coupling, joints: [A, «D], ratio: 1"),
        "unknown moving joint 'D'",
        "A, B",
        "",
    ),
    (
        "prescribed_nothing",
        tie("type: prescribed, motion: t", "«c"),
        "'c' does not say what it moves",
        "joint, coordinate",
        "",
    ),
    (
        "prescribed_state",
        tie("type: prescribed, joint: A, motion: «q"),
        "'q' is a coordinate and cannot stand in",
        "parameters and t",
        "",
    ),
    (
        "prescribed_unit",
        tie('type: prescribed, joint: A, motion: "«0.2 m"'),
        "a prescribed motion in m",
        "rad",
        "",
    ),
    # rolling
    (
        "no_radius",
        tie("type: rolling, body: b, «shape: {sphere: {}}, plane: {normal: z}").replace(
            "«shape: {", "shape: {«"
        ),
        "'sphere' has no 'radius'",
        "",
        "",
    ),
    (
        "no_tube",
        tie("type: rolling, body: b, shape: {«torus: {radius: l, axis: y}}, plane: {normal: z}"),
        "'torus' has no 'tube'",
        "",
        "",
    ),
    (
        "unknown_shape",
        tie("type: rolling, body: b, shape: {«cone: {radius: l}}, plane: {normal: z}"),
        "unknown key 'cone'",
        "disk, wheel",
        "",
    ),
    (
        "no_shape",
        tie("type: rolling, body: b, shape: {}, plane: {normal: z}", "«c"),
        "the shape of 'c' is 0 shapes",
        "one of disk",
        "",
    ),
    (
        "two_shapes",
        tie(
            "type: rolling, body: b, shape: {sphere: {radius: l}, disk: {radius: l, axis: y}}, plane: {normal: z}",
            "«c",
        ),
        "the shape of 'c' is 2 shapes",
        "one of",
        "",
    ),
    (
        "tube_zero",
        tie(
            "type: rolling, body: b, shape: {torus: {radius: l, tube: «0 m, axis: y}}, plane: {normal: z}"
        ),
        "the tube of 'c' is 0 m",
        "more than zero",
        "",
    ),
    (
        "axis_of_sphere",
        tie("type: rolling, body: b, shape: {sphere: {radius: l, «axis: y}}, plane: {normal: z}"),
        "unknown key 'axis'",
        "",
        "",
    ),
    (
        "zero_normal",
        tie("type: rolling, body: b, shape: {sphere: {radius: l}}, plane: {normal: «[0, 0, 0]}"),
        "a normal of length",
        "",
        "",
    ),
    (
        "torus_in_plane",
        FLAT
        + HINGES
        + "constraints: {«c: {type: rolling, body: b, shape: {torus: {radius: l, tube: l}}, plane: {normal: y}}}\n",
        "a torus in a planar model",
        "wheel",
        "",
    ),
    (
        "axis_in_plane",
        FLAT
        + HINGES
        + "constraints: {c: {type: rolling, body: b, shape: {wheel: {radius: l, axis: «y}}, plane: {normal: y}}}\n",
        "an axis of the wheel 'c' in a planar model",
        "no axis",
        "",
    ),
    # loads and inputs
    (
        "empty_bushing",
        load("type: bushing, between: [a, b]", "«f"),
        "the bushing 'f' is empty",
        "stiffness",
        "",
    ),
    (
        "bushing_itself",
        load("type: bushing, between: «[a, a], stiffness: 1"),
        "'a' and itself",
        "",
        "",
    ),
    (
        "bushing_count",
        load("type: bushing, between: [a, b], torsion: «[1, 2]"),
        "a stiffness with 2 components",
        "or 3 in a list",
        "",
    ),
    (
        "bushing_unit",
        load("type: bushing, between: [a, b], torsion: «1 N/m"),
        "a stiffness in N/m",
        "N*m/rad",
        "",
    ),
    (
        "empty_friction",
        load("type: friction, joint: A", "«f"),
        "the friction of 'f' is empty",
        "coulomb with smoothing",
        "",
    ),
    (
        "no_smoothing",
        load("type: friction, joint: A, coulomb: «2 N*m"),
        "Coulomb friction of 'f' without smoothing",
        "rad/s",
        "",
    ),
    (
        "zero_smoothing",
        load("type: friction, joint: A, coulomb: 2, smoothing: «0 rad/s"),
        "the smoothing of 'f' is 0",
        "more",
        "",
    ),
    (
        "negative_friction",
        load("type: friction, joint: A, viscous: «-1"),
        "the viscous friction of 'f' is -1",
        "zero or more",
        "",
    ),
    (
        "friction_of_free",
        load("type: friction, joint: «B, viscous: 1"),
        "the joint 'B' has 6 velocities",
        "B.vx",
        "",
    ),
    (
        "armature_unit",
        load("type: armature, joint: A, inertia: «1 kg"),
        "an inertia in kg",
        "kg*m^2",
        "",
    ),
    (
        "spring_of_ball",
        joint("type: ball, spring: {stiffness: 1, rest: «1}"),
        "'rest' of the spring 'A_spring' in a ball joint, which is slack where it has not turned",
        "rpy: [roll, pitch, yaw]",
        "",
    ),
    (
        "spring_of_ball_in_loads",
        joint("type: ball") + "loads: {x: {type: spring, joint: A, stiffness: «1 N/m}}\n",
        "a stiffness in N/m",
        "N*m/rad",
        "",
    ),
    (
        "spring_of_ball_about_two_axes",
        joint("type: ball, spring: {stiffness: «[1, 2]}"),
        "a stiffness with 2 components",
        "one number, or 3 in a list",
        "",
    ),
    (
        "spring_of_hinge_with_a_list",
        joint("type: revolute, axis: x, spring: {stiffness: «[1, 2, 3]}"),
        "a stiffness with 3 components",
        "one number",
        "",
    ),
    (
        "spring_of_euler_angles",
        joint("type: ball, orientation: {euler: zyx}, spring: {stiffness: 1}", "«A"),
        "spring in the joint 'A', which has 3 velocities",
        "no `orientation`, for a spring against all turns, or an entry under loads",
        "",
    ),
    (
        "spring_of_free",
        joint("type: free, spring: {stiffness: 1}", "«A"),
        "spring in the joint 'A', which has 6 velocities",
        "a joint with one velocity, or an entry under loads: {type: bushing, …}",
        "",
    ),
    (
        "friction_of_ball",
        joint("type: ball, friction: {viscous: 1}", "«A"),
        "friction in the joint 'A', which has 3 velocities",
        "an entry under loads: {type: friction, velocity: one of A.wx, A.wy, A.wz}",
        "",
    ),
    (
        "spring_in_universal",
        joint(
            "type: universal, axis: x, axis2: y, coordinates: [a, b], spring: {stiffness: 1}", "«A"
        ),
        "spring in the joint 'A', which has 2 velocities",
        "an entry under loads: {type: spring, coordinate: one of a, b}",
        "",
    ),
    (  # its keys are joint and coordinate: no velocity is offered
        "spring_of_universal",
        joint("type: universal, axis: x, axis2: y, coordinates: [roll, nod]")
        + "loads: {s: {type: spring, joint: «A, stiffness: 1}}\n",
        "the joint 'A' has 2 velocities",
        "coordinate: one of roll, nod",
        "",
    ),
    (
        "damper_of_universal",
        joint("type: universal, axis: x, axis2: y, coordinates: [roll, nod]")
        + "loads: {s: {type: damper, joint: «A, coefficient: 1}}\n",
        "the joint 'A' has 2 velocities",
        "velocity: one of der(roll), der(nod)",
        "",
    ),
    (
        "armature_negative",
        joint("type: revolute, axis: z, armature: «-1"),
        "the armature of 'A' is -1",
        "zero or more",
        "",
    ),
    (
        "gear_of_nothing",
        SCENE + "inputs: {u: {gear: «100}}\n",
        "'gear' of the input 'u', which drives no joint",
        "a joint",
        "",
    ),
    ("gear_zero", SCENE + "inputs: {u: {joint: A, gear: «0}}\n", "the gear of 'u' is zero", "", ""),
    (
        "rotor_unit",
        SCENE + "inputs: {u: {joint: A, rotor_inertia: «1 kg}}\n",
        "a rotor's inertia in kg",
        "kg*m^2",
        "",
    ),
    (
        "rotor_negative",
        SCENE + "inputs: {u: {joint: A, rotor_inertia: «-1}}\n",
        "the rotor of 'u' has the inertia -1",
        "zero",
        "",
    ),
    # bodies
    (
        "about",
        body("mass: m, inertia: {tensor: 1, about: «centre}"),
        "unknown point 'centre'",
        "com, origin",
        "",
    ),
    ("no_tensor", body("mass: m, «inertia: {about: com}"), "'inertia' has no 'tensor'", "", ""),
    ("inertia_kind", body("mass: m, inertia: {tensor: «{}}"), "a mapping under 'tensor'", "", ""),
    (
        "frame_angle",
        body("mass: m, inertia: {tensor: 1, frame: {angle: «1}}"),
        "'angle' in space",
        "rpy",
        "",
    ),
    (
        "triangle",
        body("mass: m, inertia: {tensor: «[1, 1, 3], frame: {rpy: [1, 2, 3]}}"),
        "no body has the inertia of 'a'",
        "",
        "",
    ),
    (
        "products",
        body("mass: m, inertia: «[1, 1, 1, 0.9, 0, 0]"),
        "no body has the inertia of 'a': 0.1 + 1 < 1.9",
        "largest",
        "",
    ),
    (
        "indefinite",
        body("mass: m, inertia: {tensor: «[1, 1, 1, 0, 2, 0]}"),
        "a principal moment of inertia of 'a' is -1",
        "",
        "",
    ),
    (
        "origin_too_small",
        body("mass: m, com: [1 m, 0, 0], inertia: {tensor: «[0.1, 0.5, 0.5], about: origin}"),
        "a moment of inertia of 'a' is -0.5",
        "zero or more",
        "",
    ),
    # initial quaternions
    (
        "zero_quaternion",
        initial("«B_qw: 0, B_qx: 0"),
        "the initial quaternion of 'B' is zero",
        "1, 0, 0, 0",
        "",
    ),
    (
        "zero_by_name",
        initial("«B_qw: zero"),
        "the initial quaternion of 'B' is zero",
        "not all zero",
        "",
    ),
    (
        "no_first_entry",
        initial("«B_qx: 0.1"),
        "a quaternion without its first entry 'B_qw'",
        "(1, 0, 0, 0) is no turn",
        "",
    ),
    ("quaternion_unit", initial("B_qw: «1 m"), "the initial B_qw in m", "a plain number", ""),
]


@pytest.mark.parametrize(
    ("marked", "message", "expected", "hint"),
    [case[1:] for case in ERRORS],
    ids=[case[0] for case in ERRORS],
)
def test_error(marked: str, message: str, expected: str, hint: str) -> None:
    with pytest.raises(ModelError) as caught:
        load_text(marked.replace("«", ""), "model.yaml")
    found = caught.value.diagnostics[0]
    assert message in found.message
    assert expected in found.expected
    assert hint in found.hint
    before = marked[: marked.index("«")].split("\n")
    assert (found.line, found.column) == (len(before), len(before[-1]) + 1)


@pytest.mark.parametrize(
    "what",
    [
        "closures: {C: {type: revolute, between: [tip, ground], at: [[0, 0], [l, 0]]}}\n",
        "constraints: {c: {type: distance, between: [tip, ground], at: [[0, 0], [l, 0]], length: l}}\n",
        "constraints: {c: {holonomic: T - 1}}\n",
        "where: {turned: 2*T}\nconstraints: {c: {holonomic: turned - 1}}\n",
        "constraints: {c: {type: gear, joints: [T, A], ratio: 2}}\n",
        "loads: {r: {type: armature, joint: T, inertia: 0.1}}\n",
        "inputs: {u: {joint: T, rotor_inertia: 0.1}}\n",
        "kinetic: m*(l*der(T))^2\n",
    ],
)
def test_a_massless_tip_is_left_to_the_mechanics_where_something_speaks_of_it(what: str) -> None:
    assert isinstance(load_text(CHAIN.replace("«", "") + TIP + what), Model)


def test_a_mere_frame_may_be_massless() -> None:
    text = CHAIN.replace("«", "") + TIP.replace("T: {type: revolute", "T: {type: fixed")
    assert isinstance(load_text(text), Model)
    carried = CHAIN.replace("«", "").replace("}}\n", "}, hand: {mass: m}}\n") + TIP.replace(
        "}}\n", "}, H: {type: fixed, parent: tip, child: hand}}\n"
    )
    assert isinstance(load_text(carried), Model)


WORDS = [
    "[0, 0, 0]",
    "[1, 2, 2]",
    "z",
    "quaternion",
    "0",
    "-1",
    "m",
    "[[0, 0, 0], {rpy: [0, 0, 1]}]",
    "{parent: {}}",
    "{}",
    "[]",
]
KEYS = [
    "axis",
    "axis2",
    "at",
    "rpy",
    "matrix",
    "axis_angle",
    "orientation",
    "pitch",
    "limits",
    "spring",
    "friction",
    "coordinates",
]
KINDS = [
    "revolute",
    "screw",
    "universal",
    "ball",
    "free",
    "fixed",
    "planar",
    "cylindrical",
    "nothing",
]


def test_more_bodies_than_can_be_derived_are_refused_before_anything_is_made_of_them() -> None:
    many = 20_001
    bodies = "".join(f"  b{i}: {{mass: 1}}\n" for i in range(many))
    with pytest.raises(ModelError) as error:
        load_text(f"model: m\nbodies:\n{bodies}joints: {{}}\n")
    (problem,) = error.value.diagnostics
    assert problem.message == f"the model has {many} bodies" and problem.expected == "at most 20000"
    assert problem.line == many + 2


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(KINDS),
    st.dictionaries(st.sampled_from(KEYS), st.sampled_from(WORDS), max_size=4),
)
def test_any_joint(kind: str, given: dict[str, str]) -> None:
    readable(
        joint(", ".join([f"type: {kind}", *(f"{key}: {value}" for key, value in given.items())]))
    )


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(
        [
            "gear",
            "prescribed",
            "distance",
            "point_on_surface",
            "rolling",
            "bushing",
            "friction",
            "armature",
        ]
    ),
    st.dictionaries(
        st.sampled_from(
            [
                "between",
                "at",
                "length",
                "joints",
                "joint",
                "ratio",
                "motion",
                "body",
                "surface",
                "shape",
                "plane",
                "inertia",
            ]
        ),
        st.recursive(
            st.sampled_from(["a", "A", "q", "1", "z - x", "l"]),
            lambda x: (
                st.lists(x, max_size=3)
                | st.dictionaries(st.sampled_from(["disk", "radius", "normal"]), x)
            ),
            max_leaves=6,
        ),
    ),
)
def test_any_tie(kind: str, entry: dict[str, object]) -> None:
    section = "loads" if kind in ("bushing", "friction", "armature") else "constraints"
    readable(SCENE + f"{section}: {{k: {json.dumps({'type': kind, **entry})}}}\n")


def readable(text: str) -> None:
    """Any text gives a Model or a ModelError, never another exception."""
    try:
        assert isinstance(load_text(text), Model)
    except ModelError as error:
        assert error.diagnostics and all(problem.message for problem in error.diagnostics)
