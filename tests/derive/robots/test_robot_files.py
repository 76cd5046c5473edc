"""Robot files as users have them: inertias of no body, transmissions, rotors, friction of light
joints, inertial parameters at run time; against mass matrices that are derived from other numbers.

Of derive.robots: friction, parameters, transmissions.
"""

from __future__ import annotations

from math import comb
from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.choices.limits import MOST_SUBSETS
from derive.diagnostics import HamelError, ModelError
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load_text
from derive.robots.numbers import written
from derive.robots.reading import imported
from derive.states import system

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
LINK = (
    '<link name="{0}"><inertial><mass value="{1}"/><origin xyz="0.1 0.2 0.3"/>'
    '<inertia ixx="{2}" iyy="{3}" izz="{4}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
    '<origin xyz="0 0 0.5" rpy="0.3 0 0"/><axis xyz="{4}"/>{3}</joint>'
)


def two_links(tmp_path: Path, upper=(2, 0.1, 0.2, 0.15), lower=(1, 0.02, 0.03, 0.04), more=""):
    parts = [
        '<robot name="two"><link name="base"/>',
        LINK.format("upper", *upper),
        LINK.format("lower", *lower),
        JOINT.format("a", "base", "upper", '<dynamics friction="2"/>', "0 0 1"),
        JOINT.format("b", "upper", "lower", '<dynamics friction="30"/>', "0 1 0"),
        more,
        "</robot>",
    ]
    file = tmp_path / "two.urdf"
    file.write_text("".join(parts))
    return file


def mass(text: str, p=()) -> np.ndarray:
    """The mass matrix with every joint at zero."""
    found = evaluator(equations(system(load_text(text, "m.yaml"))))
    model = found.equations.system.model
    q = [1.0 if name.endswith("qw") else 0.0 for name in (x.name for x in model.coordinates)]
    count = len(model.velocities)
    given = [y.value for y in model.parameters] if not len(p) else p
    u = np.zeros(len(model.inputs))
    x = [*q, *np.zeros(len(found.equations.w))]
    return np.array(found("mass", 0.0, x, u, given)).reshape(count, count)


@pytest.mark.parametrize(
    ("lower", "why"),
    [
        ((1, 0.02, 0.03, 0.06), "no body has the inertia of 'lower': 0.02 + 0.03 < 0.06"),
        ((1, -0.01, 0.03, 0.03), "a moment of inertia of 'lower' is -0.01"),
    ],
)
def test_inertias_of_no_body_are_refused_or_taken_as_they_are(lower, why, tmp_path):
    file = two_links(tmp_path, lower=lower)
    with pytest.raises(ModelError) as refused:
        imported(file)
    assert why in str(refused.value) and "--allow-unphysical" in str(refused.value)
    waived = imported(hamel.RobotFile(file, unphysical=True))
    assert "physical: false" in waived.text
    assert any(why in note for note in waived.model.notes)
    # inertia is linear in the entries: what the file says differs from a possible one by that
    possible = imported(two_links(tmp_path, lower=(lower[0], 0.02, 0.03, 0.04)))
    difference = mass(waived.text) - mass(possible.text)
    assert abs(difference[1, 1] - (lower[2] - 0.03)) < 1e-15
    assert abs(difference[0, 0] - inclined(lower[1] - 0.02, lower[3] - 0.04)) < 1e-15


def test_an_inertia_without_mass_counts_and_is_noted(tmp_path):
    found = imported(two_links(tmp_path, lower=(0, 0.02, 0.03, 0.04)))
    assert any("'lower' has inertia but no mass" in note for note in found.model.notes)
    assert abs(mass(found.text)[1, 1] - 0.03) < 1e-15


def inclined(xx: float, zz: float) -> float:
    """The moment about an axis at 0.3 rad between y and z, of moments about x and z alone."""
    return zz * np.cos(0.3) ** 2


def test_a_possible_inertia_needs_no_waiver(tmp_path):
    found = imported(hamel.RobotFile(two_links(tmp_path), unphysical=True))
    assert "physical" not in found.text and not any("body" in note for note in found.model.notes)


def test_a_model_file_waives_at_the_body(tmp_path):
    text = (
        "model: m\nbodies: {{a: {{mass: 1, inertia: [1, 1, 3]{}}}}}\n"
        "joints: {{q: {{type: revolute, parent: ground, child: a, axis: z}}}}"
    )
    with pytest.raises(ModelError, match="physical: false takes it as it is"):
        load_text(text.format(""), "m.yaml")
    assert load_text(text.format(", physical: false"), "m.yaml").notes
    with pytest.raises(ModelError, match="unknown answer 'no'"):
        load_text(text.format(", physical: no"), "m.yaml")
    file = tmp_path / "m.yaml"
    file.write_text(text.format(""))
    with pytest.raises(ModelError, match="--allow-unphysical is for URDF and MJCF files"):
        hamel.check(hamel.RobotFile(file, unphysical=True))


def test_light_joints_rub_over_a_wider_range(tmp_path):
    """The width is what the friction takes from the diagonal of M in a millisecond."""
    found = imported(two_links(tmp_path))
    M = mass(found.text)
    assert "coulomb: 2, smoothing: 0.01}" in found.text and 2e-3 / M[0, 0] < 0.01
    assert f"coulomb: 30, smoothing: {30e-3 / M[1, 1]:.2g}}}" in found.text


def test_what_a_joint_carries_is_the_diagonal_of_the_mass_matrix(tmp_path):
    for name in ("arm.urdf", "quadruped.urdf", "hand.xml"):
        text = (ROBOTS / name).read_text()
        rubbing = text.replace('friction="0.3"', 'friction="300"').replace(
            'frictionloss="0.1"', 'frictionloss="500"'
        )
        (tmp_path / name).write_text(rubbing)
        if rubbing == text:
            continue
        made = imported(tmp_path / name)
        model = made.model
        M = mass(made.text)
        rates = [velocity.owner for velocity in model.velocities]
        for line in made.text.splitlines():
            if "coulomb" in line and "smoothing" in line:
                joint = line.split(":")[0].strip()
                force, width = (
                    float(line.split(f"{word}: ")[1].split(",")[0].split("}")[0])
                    for word in ("coulomb", "smoothing")
                )
                own = M[rates.index(joint), rates.index(joint)]
                assert width == max(0.01, float(f"{force * 1e-3 / own:.2g}"))


MIMIC = '<mimic joint="{}" multiplier="{}" offset="0.2"/><dynamics friction="{}"/>'
FINGERS = {  # joint: what carries it, what it carries, what it follows and how fast
    "one behind the other": {"b": ("la", "lb", "a", 0.7), "c": ("lb", "lc", "b", -2)},
    "beside each other": {"b": ("base", "lb", "a", 20), "c": ("base", "lc", "a", 0.1)},
    "backwards": {"b": ("lc", "lb", "a", 1), "c": ("base", "lc", "b", -1.5)},
}


def fingers(tmp_path: Path, joints: dict, order: str) -> Path:
    """Joint a, and two that follow it, each with friction, in any order of the file."""
    rows = {"a": JOINT.format("a", "base", "la", '<dynamics friction="50"/>', "0 0 1")}
    for name, (parent, child, leader, ratio) in joints.items():
        axis = "0 1 0" if name == "b" else "1 0 0"
        rows[name] = JOINT.format(name, parent, child, MIMIC.format(leader, ratio, 30), axis)
    links = [LINK.format(f"l{x}", 1 + k, 0.1, 0.2, 0.15 + k / 50) for k, x in enumerate("abc")]
    file = tmp_path / "f.urdf"
    parts = ('<robot name="f"><link name="base"/>', *links, *(rows[x] for x in order), "</robot>")
    file.write_text("".join(parts))
    return file


@pytest.mark.parametrize("how", FINGERS)
def test_what_mimics_a_joint_counts_to_its_inertia(how, tmp_path):
    """rᵀ M r of the mass matrix, r the speeds of all three at the joint's own unit speed."""
    made = imported(fingers(tmp_path, FINGERS[how], "abc"))
    rates = [velocity.owner for velocity in made.model.velocities]
    speeds = {"a": 1.0}
    while len(speeds) < 3:
        speeds |= {x: r * speeds[y] for x, (_, _, y, r) in FINGERS[how].items() if y in speeds}
    r = np.array([speeds[name] for name in rates])
    own = r @ mass(made.text) @ r
    for name, force in (("a", 50), ("b", 30), ("c", 30)):
        width = max(0.01, float(f"{force * 1e-3 * speeds[name] ** 2 / own:.2g}"))
        line = next(x for x in made.text.splitlines() if x.strip().startswith(f"{name}:"))
        assert f"coulomb: {force}, smoothing: {written(width)}}}" in line


@pytest.mark.parametrize("how", FINGERS)
@pytest.mark.parametrize("order", ["abc", "cba", "bca"])
def test_what_follows_is_never_independent(how, order, tmp_path):
    """Whatever the ratios, the order of the file and the order of the joints in the tree are."""
    made = imported(fingers(tmp_path, FINGERS[how], order)).model
    assert equations(system(made)).w == ("a_dot",)


PARALLEL = """<mujoco><worldbody>
<body name="left"><joint name="l" axis="0 1 0"/><geom type="box" size=".1 .1 .5" pos="0 0 .5"/>
 <body name="bar" pos="0 0 1"><joint name="m" axis="0 1 0"/><geom type="box" size=".5 .1 .1" pos=".5 0 0"/></body></body>
<body name="right" pos="1 0 0"><joint name="r" axis="0 1 0"/><geom type="box" size=".1 .1 .5" pos="0 0 .5"/>{}</body>
</worldbody>
<equality><connect body1="bar" body2="right" anchor="1 0 0"/>{}</equality>
<actuator><motor name="drive" joint="s"/></actuator></mujoco>"""
FOLLOWER = '<body name="tail" pos="0 0 1"><joint name="s" axis="0 1 0"/><geom size=".1" pos="0 0 .2"/></body>'


CARRIAGES = """
model: carriages
bodies: {{a: {{mass: 2 kg}}, b: {{mass: 2 kg}}}}
joints:
  l: {{type: prismatic, parent: ground, child: a, axis: x}}
  r: {{type: prismatic, parent: ground, child: b, axis: x}}
constraints: {{belt: {{holonomic: l + r}}}}
inputs: {{drive: {{joint: {}}}}}
"""


@pytest.mark.parametrize("driven", ["l", "r"])
def test_of_equal_joints_the_actuated_one_is_independent(driven):
    """Two carriages on one belt, none of which follows the other, are the same from either side."""
    assert equations(system(load_text(CARRIAGES.format(driven)))).w == (f"{driven}_dot",)


def belts(count: int, driven: str) -> str:
    """Pairs of carriages l0 r0 l1 r1 …, each pair on a belt of its own and driven on one side."""
    numbers = range(count)
    bodies = ", ".join(f"a{k}: {{mass: 2 kg}}, b{k}: {{mass: 2 kg}}" for k in numbers)
    joints = "".join(
        f"  {side}{k}: {{type: prismatic, parent: ground, child: {body}{k}, axis: x}}\n"
        for k in numbers
        for side, body in zip("lr", "ab")
    )
    ties = ", ".join(f"belt{k}: {{holonomic: l{k} + r{k}}}" for k in numbers)
    inputs = ", ".join(f"drive{k}: {{joint: {driven}{k}}}" for k in numbers)
    return (
        f"model: belts\nbodies: {{{bodies}}}\njoints:\n{joints}"
        f"constraints: {{{ties}}}\ninputs: {{{inputs}}}\n"
    )


@pytest.mark.parametrize("driven", ["l", "r"])
def test_of_many_equal_joints_the_actuated_ones_are_independent(driven):
    """Four belts have 70 partitions, more than are enumerated."""
    count = 4
    assert comb(2 * count, count) > MOST_SUBSETS
    chosen = equations(system(load_text(belts(count, driven))))
    assert chosen.w == tuple(f"{driven}{k}_dot" for k in range(count))


@pytest.mark.parametrize("ratio", ["1", "0.1", "-7"])
def test_what_follows_a_joint_of_a_loop_is_not_independent(ratio, tmp_path):
    """Though the input acts there, as MJCF allows."""
    tie = f'<joint joint1="s" joint2="r" polycoef="0 {ratio} 0 0 0"/>'
    file = tmp_path / "p.xml"
    file.write_text(PARALLEL.format(FOLLOWER, tie))
    (speed,) = equations(system(imported(file).model)).w
    assert speed in ("l_dot", "m_dot", "r_dot")


def test_a_joint_named_like_the_rate_of_another_has_a_column_of_its_own(tmp_path):
    joints = [
        JOINT.format(*row, "", "0 0 1") for row in (("q", "base", "la"), ("q_dot", "la", "lb"))
    ]
    links = [LINK.format(name, 1, 0.1, 0.2, 0.15) for name in ("la", "lb")]
    file = tmp_path / "q.urdf"
    file.write_text("".join(['<robot name="qq"><link name="base"/>', *links, *joints, "</robot>"]))
    found = system(imported(file).model)
    for formulation in ("quasi_velocities", "augmented"):
        names = equations(found, None, formulation).arguments[1].labels
        assert names == ("q", "q_dot", "q_dot_w", "q_dot_dot")


TRANSMISSION = """<transmission name="{0}"><type>transmission_interface/SimpleTransmission</type>
<joint name="{1}"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
<actuator name="m"><mechanicalReduction>{2}</mechanicalReduction>{3}</actuator></transmission>"""


def test_transmissions_give_ratios_and_rotors(tmp_path):
    rotor = '<drake:rotor_inertia value="2e-5"/>'
    both = TRANSMISSION.format("t", "a", 100, rotor) + TRANSMISSION.format("s", "b", 50, "")
    found = imported(two_links(tmp_path, more=both))
    assert "100 turns of its motor to one of the joint" in found.text
    assert "50 turns of its motor" in found.text
    assert not any("transmission" in note for note in found.assumed)
    without = imported(two_links(tmp_path))
    assert np.allclose(mass(found.text) - mass(without.text), np.diag([0.2, 0]), atol=1e-15)


@pytest.mark.parametrize(
    ("transmission", "said"),
    [
        (TRANSMISSION.format("t", "nobody", 2, ""), "'t': joints that the robot does not have"),
        (
            '<transmission name="d"><joint name="a"/><joint name="b"/></transmission>',
            "2 joints in one",
        ),
        ('<transmission name="e"><joint name="a"/></transmission>', "the transmission 'e'"),
        (TRANSMISSION.format("t", "a", "reduction", ""), "'t': its ratio is no number"),
    ],
)
def test_other_transmissions_are_said_to_be_left_out(transmission, said, tmp_path):
    found = imported(two_links(tmp_path, more=transmission))
    assert any(said in note and "not read" in note for note in found.assumed)


@pytest.mark.parametrize(
    ("ratio", "rotor", "said"),
    [
        ("0", "", "the mechanicalReduction of an actuator is zero"),
        ("x", '<rotor_inertia value="1"/>', "'x' in 'value' of <mechanicalReduction>"),
        ("2", '<rotor_inertia value="-1"/>', "the rotor of 'a' has the inertia -1"),
    ],
)
def test_wrong_numbers_in_transmissions_are_told(ratio, rotor, said, tmp_path):
    with pytest.raises(ModelError, match=said):
        imported(two_links(tmp_path, more=TRANSMISSION.format("t", "a", ratio, rotor)))


def test_inertial_numbers_become_parameters_and_a_payload_is_added(tmp_path):
    file = two_links(tmp_path)
    plain, named = imported(file), imported(hamel.RobotFile(file, parameters="inertial"))
    names = [parameter.name for parameter in named.model.parameters]
    assert len(names) == 2 * 7 + 4 and {"m_upper", "c_lower_z", "I_lower_yy"} <= set(names)
    assert np.allclose(mass(named.text), mass(plain.text), rtol=1e-15, atol=0)
    p = np.array([parameter.value for parameter in named.model.parameters])
    p[names.index("m_payload")], p[names.index("c_payload_x")] = 0.5, 0.4
    added = mass(named.text, p) - mass(plain.text)
    assert abs(added[1, 1] - 0.5 * 0.4**2) < 1e-15  # at 0.4 m beside the axis of the last joint


def test_barycentric_parameters_are_those_that_forces_are_linear_in(tmp_path):
    """The mass matrix of the file, and it is linear in all of them but the payload's."""
    file = two_links(tmp_path)
    plain, named = imported(file), imported(hamel.RobotFile(file, parameters="barycentric"))
    names = [parameter.name for parameter in named.model.parameters]
    assert len(names) == 2 * 10 + 4 and {"m_upper", "h_lower_z", "I_lower_xy"} <= set(names)
    assert np.allclose(mass(named.text), mass(plain.text), rtol=1e-14, atol=1e-15)
    p = np.array([parameter.value for parameter in named.model.parameters])
    steps = p[:-4] * np.random.default_rng(0).uniform(-0.1, 0.1, len(p) - 4)
    there = [mass(named.text, p + k * np.append(steps, [0.0] * 4)) for k in (0, 1, 2)]
    assert np.abs(there[1] - there[0]).max() > 1e-3
    assert np.allclose(there[2] - there[1], there[1] - there[0], rtol=0, atol=1e-14)


def test_only_inertial_parameters_are_known(tmp_path):
    with pytest.raises(ModelError, match="unknown parameters 'mass'"):
        imported(hamel.RobotFile(two_links(tmp_path), parameters="mass"))


def test_a_link_world_that_nothing_declares_is_the_ground(tmp_path):
    declared = two_links(tmp_path)
    text = declared.read_text()
    implied = tmp_path / "implied.urdf"
    implied.write_text(text.replace('<link name="base"/>', "").replace('"base"', '"world"'))
    found = imported(implied)
    assert "parent: world, child: upper" in found.text
    assert np.allclose(mass(found.text), mass(imported(declared).text), atol=1e-15)
    # any other name that nothing declares is a mistake
    implied.write_text(text.replace('<link name="base"/>', ""))
    with pytest.raises(ModelError, match="unknown link 'base'"):
        imported(implied)


def test_limits_that_are_the_other_way_round_are_turned_and_said(tmp_path):
    file = two_links(tmp_path)
    limit = '<limit lower="2.775" upper="-1.5" effort="1" velocity="1"/>'
    file.write_text(file.read_text().replace('<dynamics friction="2"/>', limit))
    found = imported(file)
    assert "limits: [-1.5, 2.775]" in found.text
    assert any("the other way round: a" in note for note in found.assumed)


def test_an_impossible_inertia_on_the_ground_is_left_away(tmp_path):
    """Nothing feels it; where the root link is free, it is refused like any other."""
    file = two_links(tmp_path)
    base = LINK.format("base", 1, 0, 0, 0.01)
    plain = imported(file)
    file.write_text(file.read_text().replace('<link name="base"/>', base))
    found = imported(file)
    assert np.array_equal(mass(found.text), mass(plain.text))
    assert "left away: it never moves" in found.text
    with pytest.raises(ModelError, match="no body has the inertia of 'base'"):
        imported(hamel.RobotFile(file, floating=True))


NOTHING_HOLDS = """<robot name="z"><link name="b"/><link name="c"/><link name="d"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="b"/><child link="c"/></joint>
<joint name="k" type="floating"><parent link="c"/><child link="d"/></joint></robot>"""


def test_what_check_refuses_for_want_of_mass_is_not_imported(tmp_path: Path) -> None:
    """A link without mass between a hinge and a free joint: it may turn as it likes."""
    file = tmp_path / "z.urdf"
    file.write_text(NOTHING_HOLDS, encoding="utf-8")
    with pytest.raises(HamelError, match="the axes of the joints j, k depend on each other"):
        hamel.import_(file, out=tmp_path / "z.yaml")
    assert not (tmp_path / "z.yaml").exists()
