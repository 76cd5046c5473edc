"""What a model file means: the Model that comes out of it.

Of derive.model.mechanism: axes, bodies, frames, massless, placements, space, ties, tree.
Of derive.model: build, definitions, scope.
Of derive.model.motion: events, motions, published, quaternions, steady.
Of derive.model.language: structure.
Of derive.model.kinematics: arguments, meanings, measures, products, rates, rewriting.
"""

import json
import math
import re
from pathlib import Path

import pytest

import derive.model
from derive.diagnostics import ModelError
from derive.expressions import tree
from derive.expressions.parser import expression
from derive.expressions.tree import ONE, ZERO, Name, Negative, Number, Rate
from derive.joints import JOINTS
from derive.model import Model, load, load_text, names, schema
from derive.model.constraint_records import Holonomic, NoSlip, Rolling
from derive.model.load_records import (
    Force,
    GeneralisedForce,
    JointDamper,
    JointSpring,
    PointSpring,
    Torque,
)
from derive.model.records import Span

FOLDER = Path(__file__).parents[3] / "models"
MODELS = sorted(FOLDER.rglob("*.yaml"))
UNRANKED = (
    "forty_four_bars",
    "stewart",
    "bead_in_bowl",
    "bicycle",
    "bicycle_toroidal",
    "waveboard",
)  # no choice `auto`: ranking takes long, or is idle
ARM = """
model: arm
plane: xy
parameters: {m: 1 kg, l: 1 m}
bodies: {b: {mass: m, com: [l/2, 0], inertia: m*l^2/12}}
joints: {A: {type: revolute, parent: ground, child: b, coordinate: q}}
"""
SPACE = (
    ARM.replace("plane: xy\n", "")
    .replace("com: [l/2, 0]", "com: [l/2, 0, 0]")
    .replace("child: b", "child: b, axis: z")
)


def named(entries, name):
    return next(entry for entry in entries if entry.name == name)


@pytest.mark.parametrize("path", MODELS, ids=[path.stem for path in MODELS])
def test_models_load_and_say_what_they_are_there_for(path: Path) -> None:
    model = load(path)
    assert model.name == path.stem
    assert path.read_text().startswith("# Difficulty: ")
    assert (
        model.choices and any(choice.kind == "auto" for choice in model.choices)
    ) or model.name in UNRANKED


def test_the_first_nine_models_are_there() -> None:
    wanted = "bead_in_bowl cart_pole chaplygin_sleigh double_pendulum four_bar pendulum rolling_disk slider_crank snake3"
    assert set(wanted.split()) <= {path.stem for path in MODELS}


def test_four_bar() -> None:
    model = load(FOLDER / "four_bar.yaml")
    assert model.gravity == (ZERO, Number(-9.81, "m/s^2"), ZERO)
    assert [c.name for c in model.coordinates] == ["q1", "q2", "q3"]
    assert [v.name for v in model.velocities] == ["der(q1)", "der(q2)", "der(q3)"]
    assert named(model.parameters, "m1").about == "mass of the crank"
    assert named(model.bodies, "crank").inertia[:2] == (ZERO, ZERO)
    assert named(model.bodies, "crank").inertia[2] == expression("m1*l1**2/12")
    assert named(model.joints, "B").at_parent.position == (Name("l1"), ZERO, ZERO)
    assert named(model.joints, "B").axis == (ZERO, ZERO, ONE)
    assert model.closures[0].bodies == ("coupler", "rocker")
    assert model.closures[0].placements[1].position == (Name("l3"), ZERO, ZERO)
    assert (model.inputs[0].velocity, model.inputs[0].unit) == ("der(q1)", "N*m")
    assert model.loads == (
        JointDamper("bearing", "der(q3)", Number(0.01, "N*m*s/rad"), model.loads[0].span),
    )
    assert [(c.name, c.kind) for c in model.choices] == [
        ("crank", "rows"),
        ("rocker", "rows"),
        ("tangent", "orthonormal"),
        ("best", "auto"),
    ]
    assert model.choices[0].rows == (("q1_dot", Rate("q1")),)
    held = {value.name: (value.value, value.held) for value in model.initial}
    assert held["q1"] == (Number(60 * math.pi / 180, "rad"), True)
    assert held["der(q1)"] == (Number(5.0, "rad/s"), True)
    assert held["q3"] == (Number(100 * math.pi / 180, "rad"), False)
    tip = model.outputs[0]
    assert tip.expression == tree.Call(
        "position", (Name("coupler"), tree.Vector((expression("l2/2"), Number(0.1, "m"), ZERO)))
    )
    assert (tip.text, tip.unit) == ("position(coupler, [l2/2, 0.1 m])", "m")


def test_snake3() -> None:
    model = load(FOLDER / "snake3.yaml")
    assert [v.name for v in model.velocities] == [
        "base.vx",
        "base.vy",
        "base.w",
        "der(phi1)",
        "der(phi2)",
    ]
    assert model.gravity is None
    assert model.constraints[0] == NoSlip(
        "wheel1", "link1", (ZERO, ZERO, ZERO), (ZERO, ONE, ZERO), model.constraints[0].span
    )
    assert model.choices[0].rows == (("v", Name("base.vx")), ("om", Name("base.w")))
    assert [name for name, _ in model.choices[2].rows] == ["x_dot", "y_dot"]


def test_bead_in_bowl() -> None:
    model = load(FOLDER / "bead_in_bowl.yaml")
    bowl = model.constraints[0]
    assert isinstance(bowl, Holonomic) and bowl.nonideal == tuple(
        expression(f"-c*speed*der({q})") for q in "xyz"
    )
    assert model.definitions == (("speed", expression("sqrt(der(x)**2 + der(y)**2 + der(z)**2)")),)
    assert model.kinetic == expression("m/2*(der(x)**2 + der(y)**2 + der(z)**2)")
    assert [v.unit for v in model.velocities] == ["m/s"] * 3


def test_rolling_disk() -> None:
    model = load(FOLDER / "rolling_disk.yaml")
    joint = model.joints[0]
    assert (
        joint.coordinates == ("x", "y", "z", "yaw", "lean", "spin") and joint.orientation == "zxy"
    )
    assert joint.velocities == ("base.vx", "base.vy", "base.vz", "base.wx", "base.wy", "base.wz")
    contact = model.constraints[0]
    assert isinstance(contact, Rolling)
    assert (contact.radius, contact.axis, contact.normal) == (
        Name("r"),
        (ZERO, ONE, ZERO),
        (ZERO, ZERO, ONE),
    )
    motion = model.steady_motions[0]
    assert motion.sweepable == ("speed",)
    assert dict(motion.values) == {"lean": ZERO, "der(yaw)": ZERO, "der(spin)": Name("speed")}
    assert [value.name for value in model.initial] == ["lean", "der(spin)"]


@pytest.mark.parametrize(
    ("plane", "axis", "point", "index"),
    [
        ("xy", (0, 0, 1), ("l/2", "0", "0"), 2),
        ("xz", (0, -1, 0), ("l/2", "0", "0"), 1),
        ("yz", (1, 0, 0), ("0", "l/2", "0"), 0),
    ],
)
def test_planes_turn_from_their_first_to_their_second_axis(
    plane: str, axis: tuple, point: tuple, index: int
) -> None:
    model = load_text(ARM.replace("plane: xy", f"plane: {plane}") + "gravity: [0, -9.81 m/s^2]\n")
    assert tuple(component.value for component in model.joints[0].axis) == axis  # type: ignore[union-attr]
    assert model.bodies[0].com == tuple(expression(text) for text in point)
    assert [i for i, moment in enumerate(model.bodies[0].inertia) if moment != ZERO] == [index]
    assert model.gravity is not None and [c == ZERO for c in model.gravity] == [
        letter != plane[1] for letter in "xyz"
    ]


def test_zero_gravity_is_no_gravity() -> None:
    assert load_text(ARM + "gravity: [0, 0 m/s^2]\n").gravity is None
    assert load_text(ARM).gravity is None


def test_joints_come_parents_first_and_otherwise_in_the_order_of_the_file() -> None:
    text = """
model: chain
plane: xy
bodies: {a: {mass: 1 kg}, b: {mass: 1 kg}, c: {mass: 1 kg}, d: {mass: 1 kg}}
joints:
  C: {type: revolute, parent: b, child: c}
  D: {type: prismatic, parent: ground, child: d, axis: y}
  B: {type: revolute, parent: a, child: b}
  A: {type: planar, parent: ground, child: a}
"""
    model = load_text(text)
    assert [joint.name for joint in model.joints] == ["A", "B", "C", "D"]
    assert [c.name for c in model.coordinates] == ["A_x", "A_y", "A_angle", "B", "C", "D"]
    assert [v.name for v in model.velocities] == [
        "A.vx",
        "A.vy",
        "A.w",
        "der(B)",
        "der(C)",
        "der(D)",
    ]
    assert [c.unit for c in model.coordinates] == ["m", "m", "rad", "rad", "rad", "m"]


def test_names_of_a_joint_s_one_rate() -> None:
    model = load_text(
        ARM
        + "outputs: {o: 2*A.w}\nquasi_velocities: {c: [A.w]}\ninitial: {A.w: 3 rad/s}\ninputs: {u: {velocity: A.w}}\n"
    )
    assert model.outputs[0].expression == tree.Product((Number(2.0), Rate("q")))
    assert model.choices[0].rows == (("q_dot", Rate("q")),)
    assert model.initial[0].name == "der(q)"
    assert model.inputs[0].velocity == "der(q)"
    slide = ARM.replace("revolute", "prismatic").replace("child: b", "child: b, axis: x")
    assert load_text(slide + "outputs: {o: A.v}\n").outputs[0].expression == Rate("q")


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        ("z", (0, 0, 1)),
        ("-x", (-1, 0, 0)),
        ("[0, 0, 2]", (0, 0, 1)),
        ("[3, 0, 4]", (0.6, 0, 0.8)),
        ("[0, -1 - 1, 0]", (0, -1, 0)),
    ],
)
def test_axes_have_length_one(axis: str, expected: tuple[float, ...]) -> None:
    found = load_text(SPACE.replace("axis: z", f"axis: {axis}")).joints[0].axis
    assert tuple(component.value for component in found) == pytest.approx(expected, rel=1e-15)  # type: ignore[union-attr]
    assert all((component == ZERO) == (number == 0) for component, number in zip(found, expected))


def test_placements() -> None:
    both = load_text(ARM.replace("child: b", "child: b, at: [[1 m, l], [-l, 0]]")).joints[0]
    assert both.at_parent.position == (Number(1.0, "m"), Name("l"), ZERO)
    assert both.at_child.position == (Negative(Name("l")), ZERO, ZERO)
    turned = (
        load_text(ARM.replace("child: b", "child: b, angle: 90 deg")).joints[0].at_parent.rotation
    )
    assert turned == ((ZERO, Number(-1.0), ZERO), (ONE, ZERO, ZERO), (ZERO, ZERO, ONE))
    rolled = (
        load_text(SPACE.replace("child: b", "child: b, rpy: [90 deg, 0, 0]"))
        .joints[0]
        .at_parent.rotation
    )
    assert rolled == ((ONE, ZERO, ZERO), (ZERO, ZERO, Number(-1.0)), (ZERO, ONE, ZERO))
    assert (
        load_text(SPACE.replace("child: b", "child: b, rpy: [0, 0, 360 deg]"))
        .joints[0]
        .at_parent.rotation
        is None
    )


def test_general_rpy_is_a_rotation() -> None:
    rows = (
        load_text(SPACE.replace("child: b", "child: b, rpy: [0.1, 0.2, 0.3]"))
        .joints[0]
        .at_parent.rotation
    )
    assert rows is not None
    R = [[component.value for component in row] for row in rows]  # type: ignore[union-attr]
    for i in range(3):
        for j in range(3):
            assert sum(R[i][k] * R[j][k] for k in range(3)) == pytest.approx(
                float(i == j), abs=1e-15
            )
    assert R[2][0] == pytest.approx(-math.sin(0.2))


def test_inertia_in_space() -> None:
    assert load_text(SPACE).bodies[0].inertia[:3] == (expression("m*l^2/12"),) * 3
    six = (
        load_text(SPACE.replace("inertia: m*l^2/12", "inertia: [2, 2, 2, 0.1, 0.2, 0.3]"))
        .bodies[0]
        .inertia
    )
    assert six == tuple(Number(value) for value in (2.0, 2.0, 2.0, 0.1, 0.2, 0.3))
    rows = "[[2, 1e-1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2]]"
    near = rows.replace("[0.1,", "[0.1000000000000001,")
    for written in (rows, near, f"{{tensor: {rows}, about: com}}"):
        found = load_text(SPACE.replace("inertia: m*l^2/12", f"inertia: {written}"))
        assert [number.value for number in found.bodies[0].inertia] == [
            2.0,
            2.0,
            2.0,
            0.1,
            0.2,
            0.3,
        ]  # type: ignore[union-attr]


def test_round_numbers_beyond_a_turn_are_noted_as_radians() -> None:
    noted = load_text(ARM + "initial: {q: 30}\n").notes
    assert noted == ("'q' starts at 30 rad, as no unit is said; degrees are 30 deg",)
    for plain in ("30 deg", "30 rad", "6", "7.3"):
        assert not load_text(ARM + f"initial: {{q: {plain}}}\n").notes


def test_what_does_nothing_is_noted() -> None:
    """Parameters that no formula names, and events that nothing changes."""
    spare = ARM.replace("parameters: {", "parameters: {spare: 1 kg, ", 1)
    model = load_text(spare + "events: {never: l - 1, once: q - l/l}\n")
    notes = [note for note in model.notes if "nowhere" in note or "never happens" in note]
    assert notes == [
        "event never never happens: nothing in 'l - 1' changes",
        "parameter spare is used nowhere",
    ]


def test_massless_bodies_and_point_masses() -> None:
    frame = (
        ARM.replace("mass: m", "mass: 0").replace("m*l^2/12", "0")
        + "closures: {C: {type: revolute, between: [b, ground], at: [[l, 0], [l, 0]]}}\n"
    )
    assert load_text(frame).bodies[0].mass == ZERO
    assert load_text(ARM.replace(", inertia: m*l^2/12", "")).bodies[0].inertia == (ZERO,) * 6


def test_loads() -> None:
    model = load_text(
        ARM.replace("bodies: {", "bodies: {c: {mass: m}, ").replace(
            "joints: {", "joints: {P: {type: planar, parent: ground, child: c}, "
        )
        + """
inputs: {u: {unit: N}, tau: {joint: A, about: motor}, push: {velocity: P.vx}, free: {}}
loads:
  s: {type: spring, joint: A, stiffness: 3 N*m/rad, rest: 30 deg}
  x: {type: spring, coordinate: P_x, stiffness: 3 N/m}
  w: {type: damper, velocity: P.w, coefficient: 0.1}
  ps: {type: spring, between: [c, ground], at: [[l, 0], [0, 1 m]], stiffness: 100 N/m, length: 0.1 m, damping: 2 N*s/m}
  pd: {type: damper, between: [b, c], at: [[l, 0], [0, 0]], coefficient: 2 N*s/m}
  f: {type: force, body: b, at: [l, 0], components: [u*cos(q), 0], frame: body}
  T: {type: torque, body: b, components: free*sin(t/(1 s))}
  law: {type: expression, joint: A, expression: "-(0.1 N*m)*tanh(der(q)/(1 rad/s))"}
"""
    )
    s, x, w, ps, pd, f, torque, law = model.loads
    assert isinstance(s, JointSpring) and (s.coordinate, s.rest) == (
        "q",
        Number(30 * math.pi / 180, "rad"),
    )
    assert isinstance(x, JointSpring) and (x.coordinate, x.rest) == ("P_x", ZERO)
    assert isinstance(w, JointDamper) and w.velocity == "P.w"
    assert (
        isinstance(ps, PointSpring)
        and ps.bodies == ("c", "ground")
        and ps.points[1] == (ZERO, Number(1.0, "m"), ZERO)
    )
    assert (
        isinstance(pd, PointSpring) and pd.stiffness == ZERO and pd.damping == Number(2.0, "N*s/m")
    )
    assert isinstance(f, Force) and f.frame == "body" and f.components[0] == expression("u*cos(q)")
    assert (
        isinstance(torque, Torque)
        and torque.frame == "ground"
        and torque.components[:2] == (ZERO, ZERO)
    )
    assert isinstance(law, GeneralisedForce) and law.velocity == "der(q)"
    assert [(u.name, u.velocity, u.unit) for u in model.inputs] == [
        ("u", "", "N"),
        ("tau", "der(q)", "N*m"),
        ("push", "P.vx", "N"),
        ("free", "", ""),
    ]


def test_a_torque_in_the_xz_plane_is_about_minus_y() -> None:
    model = load_text(
        ARM.replace("plane: xy", "plane: xz")
        + "loads: {T: {type: torque, body: b, components: 2 N*m}}\n"
    )
    torque = model.loads[0]
    assert isinstance(torque, Torque) and torque.components == (
        ZERO,
        Negative(Number(2.0, "N*m")),
        ZERO,
    )


def test_analytic_form_on_top_of_a_mechanism() -> None:
    model = load_text(
        ARM
        + "coordinates: {z: {unit: m, about: extra}}\nkinetic: m/2*(der(z) + l*der(q))^2\nforces: {z: -m*(9.81 m/s^2)}\n"
    )
    assert [c.name for c in model.coordinates] == ["q", "z"]
    assert [v.name for v in model.velocities] == ["der(q)", "der(z)"]
    force = model.loads[0]
    assert isinstance(force, GeneralisedForce) and (force.name, force.velocity) == (
        "force_z",
        "der(z)",
    )


def test_definitions_come_in_the_order_of_their_use() -> None:
    model = load_text(ARM + "where: {c: a*b, a: 2*l, b: a + q*l}\noutputs: {o: c}\n")
    assert [name for name, _ in model.definitions] == ["a", "b", "c"]
    assert model.outputs[0].unit == "m^2"
    assert load_text(ARM.replace("com: [l/2, 0]", "com: [h, 0]") + "where: {h: l/2}\n").bodies[
        0
    ].com[0] == Name("h")


def test_units_win_where_the_place_says_which_unit_it_wants() -> None:
    model = load_text(ARM.replace("m: 1 kg", "m: 1 kg, s: 2") + "gravity: [0, -9.81 m/s^2]\n")
    assert model.gravity is not None and model.gravity[1] == Number(-9.81, "m/s^2")


OWN = ("m", "s", "N", "J", "W", "kg", "rad", "Hz", "g", "mm", "deg")  # that are units as well
MIXED = "1 rad/s*cos"  # a formula in which s is either
EXAMPLES = sorted(Path(derive.model.__file__).parent.glob("examples/*.yaml"))


def with_own_names(text: str) -> str:
    """A model text with a parameter of the name of each unit that names nothing in it yet."""
    free = [unit for unit in OWN if not re.search(rf"(\n *|[{{,] *|coordinate: ){unit}\b", text)]
    entries = [f"{unit}: 1" for unit in free]
    flow = "parameters: {" + ", ".join(entries)
    if re.search("\nparameters: *{", text):
        return re.sub("\nparameters: *{", f"\n{flow}, ", text, count=1)
    block = re.search("\nparameters:\n( +)", text)
    if block is None:
        return f"{text}\n{flow}}}\n"
    lines = "".join(f"{block[1]}{entry}\n" for entry in entries)
    return text.replace("\nparameters:\n", f"\nparameters:\n{lines}", 1)


@pytest.mark.parametrize("path", [*MODELS, *EXAMPLES], ids=lambda path: path.stem)
def test_parameters_called_like_units_spoil_no_number(path: Path) -> None:
    """`inertia: 0.01 kg*m^2` stays what it is beside a parameter m."""
    text = path.read_text()
    try:
        load_text(text, str(path))
    except ModelError:
        return  # one that shows an error
    if MIXED not in text:
        load_text(with_own_names(text), str(path))


def test_bare_numbers_are_si() -> None:
    model = load_text(
        ARM.replace("m: 1 kg", "m: 1").replace("l: 1 m", "l: 250 mm") + "outputs: {o: l + 0.5}\n"
    )
    assert (named(model.parameters, "m").value, named(model.parameters, "m").unit) == (1.0, "")
    assert (named(model.parameters, "l").value, named(model.parameters, "l").unit) == (0.25, "m")


def test_yaml_1_2_scalars() -> None:
    model = load_text(
        "model: a\ndescription: no\ncoordinates: {y: m}\nparameters: {n: 1e3, yes: 2}\nkinetic: n*yes*der(y)^2\n"
    )
    assert model.description == "no"
    assert [(p.name, p.value) for p in model.parameters] == [("n", 1000.0), ("yes", 2.0)]


def test_arithmetic_in_parameters() -> None:
    model = load_text(
        "model: a\ncoordinates: {y: m}\nparameters: {f: 2*pi*(3 Hz), k: -(2 N/m)}\nkinetic: (1 kg)*der(y)^2\n"
    )
    assert (
        model.parameters[0].value == pytest.approx(6 * math.pi)
        and model.parameters[0].unit == "1/s"
    )
    assert (model.parameters[1].value, model.parameters[1].unit) == (-2.0, "N/m")


def test_row_names() -> None:
    model = load_text(
        ARM.replace("revolute", "planar")
        .replace("coordinate: q", "coordinates: [x, y, th]")
        .replace("l: 1 m", "l: 1 m, x_dot: 1, w3: 1")
        + "quasi_velocities: {c: [der(x), A.vy, A.w*l + A.vx], d: {a: A.vx}}\n"
    )
    assert [name for name, _ in model.choices[0].rows] == ["x_dot_w", "A_vy", "w3_w"]
    assert [name for name, _ in model.choices[1].rows] == ["a"]


def test_a_choice_is_always_there() -> None:
    assert [(choice.name, choice.kind) for choice in load_text(ARM).choices] == [("auto", "auto")]


def test_nonideal_forces_by_name() -> None:
    model = load_text(
        "model: a\ncoordinates: {x: m, y: m}\nkinetic: (1 kg)*(der(x)^2 + der(y)^2)\n"
        "constraints: {c: {nonholonomic: der(y), nonideal: {y: -2 N}}}\n"
    )
    assert model.constraints[0].nonideal == (ZERO, Number(-2.0, "N"))  # type: ignore[union-attr]


def test_outputs() -> None:
    model = load_text(
        ARM.replace("child: b", "child: b, at: [0, 0]")
        + "constraints: {c: {holonomic: q - 1}}\n"
        + 'outputs: {a: position(b), v: "velocity(b, [l, 0])", th: angle(b), r: reaction(c), '
        + "qq: q, w: der(q), T: m*l^2*der(q)^2}\n"
    )
    assert {output.name: output.unit for output in model.outputs} == {
        "a": "m",
        "v": "m/s",
        "th": "rad",
        "r": "",
        "qq": "rad",
        "w": "rad/s",
        "T": "N*m",
    }
    assert model.outputs[0].expression == tree.Call(
        "position", (Name("b"), tree.Vector((ZERO, ZERO, ZERO)))
    )


def test_spans_point_at_the_names() -> None:
    model = load_text(ARM)
    assert model.bodies[0].span == Span(5, 10, 1)
    assert model.coordinates[0].span == Span(6, 68, 1)


def test_models_compare_and_hash_by_value() -> None:
    assert load_text(ARM) == load_text(ARM) and hash(load_text(ARM)) == hash(load_text(ARM))


def test_large_models_load_in_seconds() -> None:
    bodies = "".join(
        f"  b{i}: {{mass: m, com: [l/2, 0], inertia: m*l^2/12}}\n" for i in range(1000)
    )
    joints = "".join(
        f"  j{i}: {{type: revolute, parent: {f'b{i - 1}' if i else 'ground'}, child: b{i}, at: [l, 0]}}\n"
        for i in reversed(range(1000))
    )
    model = load_text(
        f"model: chain\nplane: xy\nparameters: {{m: 1 kg, l: 1 m}}\nbodies:\n{bodies}joints:\n{joints}"
    )
    assert [joint.name for joint in model.joints] == [f"j{i}" for i in range(1000)]


def test_schema_names_every_section_and_joint() -> None:
    found = schema()
    json.dumps(found)
    assert set(found["properties"]) >= {
        "model",
        "bodies",
        "joints",
        "closures",
        "constraints",
        "quasi_velocities",
        "initial",
    }
    assert found["required"] == ["model"] and found["additionalProperties"] is False
    assert found["$defs"]["JointEntry"]["properties"]["type"]["enum"] == [
        joint.name for joint in JOINTS
    ]
    undescribed = [
        name for name, entry in found["properties"].items() if "description" not in entry
    ]
    assert undescribed == []


def test_the_python_yaml_parser_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    import yaml

    before: list[Model] = [load(path) for path in MODELS]
    monkeypatch.delattr(yaml, "CLoader")
    assert [load(path) for path in MODELS] == before


def test_a_unit_is_no_name_that_cannot_stand_there():
    """A slide s and speeds in m/s: where no coordinate may stand, s is a second."""
    text = """model: slide
plane: xy
bodies: {a: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: a, axis: x, coordinate: s, spring: {stiffness: 3 N/m}}}
steady_motion: {even: {der(s): speed, sweep: {speed: [2*1 m/s, 5 m/s]}}}
"""
    assert load_text(text, "slide.yaml").steady_motions[0].ranges == (("speed", 2.0, 5.0, 101),)


def test_a_greek_letter_is_told_how_to_be_written(tmp_path):
    """Two of them do not become one name in generated code: neither is a name."""
    text = """model: m
plane: xy
parameters: {λ: 1 m}
bodies: {a: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01 kg*m^2}}
joints: {j: {type: revolute, parent: ground, child: a, coordinate: φ}}
"""
    path = tmp_path / "m.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        load(path)
    said = [(d.message, d.expected) for d in caught.value.diagnostics]
    assert [message for message, _ in said] == ["'λ' is not a name", "'φ' is not a name"]
    assert r"lambda1 with `symbol: \lambda` is shown as λ" in said[0][1]
    assert r"phi with `symbol: \phi` is shown as φ" in said[1][1]


def test_what_is_cut_of_a_long_name_is_marked() -> None:
    for name in ("x" * 61, "9" * 61):
        said = names.objection(name)
        assert said and said[0] == f"'{name[:60]}…' is not a name"


@pytest.mark.parametrize(
    "letter, hint",
    (
        ("Δ", r"; Delta with `symbol: \Delta` is shown as Δ"),
        ("π", r"; pi1 with `symbol: \pi` is shown as π"),
        ("Α", "; Alpha"),
        ("é", ""),
        ("φφ", ""),
    ),
)
def test_the_hint_for_a_letter_is_one_that_the_language_takes(letter: str, hint: str):
    said = names.objection(letter)
    assert said is not None and said[1].endswith(f"at most 60{hint}")
