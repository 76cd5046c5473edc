"""MJCF files as users have them: copies, damping by ratios, welds without torques, and what is said
of the rest. Ratios against the mass matrix that is derived of the model they stand in.

Of derive.robots.mjcf: reference, replicas, laws, actuators, ties.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.robots.reading import Imported, imported
from derive.states import system
from derive.states.initial import initial_state

ARM = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0.1 0.2 0.3" euler="0.3 0.2 0.1">
      <joint name="a" axis="0 1 0.2" pos="0.01 0 0" armature="0.02" ref="0.4"/>
      <joint name="b" type="slide" axis="1 0 1" {spring}/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0"/>
      <body name="lower" pos="0.4 0 0" euler="0 0.7 0">
        <joint name="c" axis="1 1 0"/>
        <geom type="box" size="0.02 0.05 0.2" pos="0 0.1 0.2"/>
      </body>
    </body>
    <body name="apart" pos="1 2 3" euler="0.5 0 0">
      <joint name="d" type="ball" armature="0.1"/>
      <geom size="0.1" pos="0 0 0.3"/>
      <body pos="0 0 0.5"><joint name="e" axis="0 1 0"/><geom size="0.05" pos="0.1 0 0"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="a" coef="0.5"/><joint joint="c" coef="-2"/></fixed></tendon>
  <actuator>{actuator}</actuator>
</mujoco>"""


def read(tmp_path, text: str) -> Imported:
    file = tmp_path / "robot.xml"
    file.write_text(text)
    return imported(file)


def inverse_mass(found: Imported) -> tuple[np.ndarray, list[str]]:
    """M⁻¹ of the derived equations where every joint is as the file has it, and whose rows are
    whose."""
    mechanics = evaluator(equations(system(found.model)))
    model = mechanics.equations.system.model
    start = {"a": 0.4} | {x.name: 1.0 for x in model.coordinates if x.name.endswith("qw")}
    q = [start.get(x.name, 0.0) for x in model.coordinates]
    count = len(model.velocities)
    x = [*q, *np.zeros(len(mechanics.equations.w) + len(mechanics.equations.z))]
    M = np.array(mechanics("mass", 0.0, x, np.zeros(len(model.inputs)), [])).reshape(count, count)
    return np.linalg.inv(M), [velocity.owner for velocity in model.velocities]


@pytest.mark.parametrize(
    ("actuator", "along", "kp"),
    [
        ('<position joint="{}" kp="50" dampratio="0.7"/>', {"a": 1.0}, 50.0),
        ('<position joint="{}" kp="50" dampratio="0.7" gear="3"/>', {"c": 3.0}, 50.0),
        ('<intvelocity joint="{}" kp="9" dampratio="0.7"/>', {"b": 1.0}, 9.0),
        ('<position tendon="t" kp="20" dampratio="0.7"/>', {"a": 0.5, "c": -2.0}, 20.0),
        (
            '<general joint="{}" gainprm="8" biastype="affine" biasprm="0 -8 0.7"/>',
            {"e": 1.0},
            8.0,
        ),
    ],
)
def test_a_damping_ratio_is_of_what_the_force_accelerates(actuator, along, kp, tmp_path):
    text = ARM.format(spring="", actuator=actuator.format(*along))
    found = read(tmp_path, text)
    inverse, owners = inverse_mass(found)
    c = np.array([along.get(owner, 0.0) for owner in owners])
    damping = 2.0 * 0.7 * math.sqrt(kp / (c @ inverse @ c))
    first, factor = next(iter(along.items()))
    load = next(line for line in found.text.splitlines() if f"expression, joint: {first}," in line)
    (said,) = re.findall(rf"\((\S+) N\S*\)\*der\({first}\)", load)
    assert float(said) == pytest.approx(-(factor**2) * damping, rel=1e-12)


def test_springs_by_time_constant_and_ratio(tmp_path):
    found = read(tmp_path, ARM.format(spring='springdamper="0.05 0.6" damping="9"', actuator=""))
    inverse, owners = inverse_mass(found)
    inertia = 1.0 / inverse[owners.index("b"), owners.index("b")]
    assert f"stiffness: {inertia / 0.03**2:.9g}"[:-2] in found.text
    assert f"damper: {2.0 * inertia / 0.05:.9g}"[:-2] in found.text
    motor = '<motor joint="b" gear="2" damping="0.5"/>'
    driven = read(
        tmp_path, ARM.format(spring='springdamper="0.05 0.6" damping="9"', actuator=motor)
    )
    assert f"damper: {2.0 * inertia / 0.05 + 2.0:.9g}"[:-2] in driven.text
    free = ARM.format(spring="", actuator="").replace('"ball"', '"free" springdamper="1 1"')
    with pytest.raises(ModelError, match="a spring in a free joint"):
        read(tmp_path, free)


def test_a_spring_of_a_ball_joint_by_its_time_constant(tmp_path):
    """Of the mean inertia that the joint's rates have at the reference configuration: MuJoCo's
    dof_invweight0, and its qacc."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body>
      <joint axis="0 1 0"/><inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.2 0.25"/>
      <body pos="0.3 0 0"><joint type="ball" springdamper="0.2 0.7" stiffness="5" damping="9 0.1"
        armature="0.05"/><inertial pos="0.1 0.2 0.3" mass="1" diaginertia="0.1 0.12 0.05"/>
      </body></body></worldbody></mujoco>"""
    mechanics = evaluator(equations(system(read(tmp_path, text).model)))
    q, v = [0.3, 0.8, 0.6, 0.0, 0.0], [0.1, 0.2, 0.3, -0.4]
    rates = np.ravel(mechanics("dynamics", 0.0, np.array([*q, *v]), np.zeros(0), np.zeros(0)))
    wanted = [7.9181408118, -45.9178902382, -9.2022136663, -0.6144196872]
    assert np.allclose(rates[5:], wanted, rtol=1e-9)


SCENE = """<mujoco>
  <compiler angle="radian" eulerseq="XYZ"/>
  <worldbody>{}</worldbody>
  <tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>
  <equality><connect body1="b" anchor="0 0 0.2"/></equality>
  <actuator><motor name="m" joint="k"/><motor tendon="t"/><motor name="lone" joint="l"/></actuator>
</mujoco>"""
PART = (
    '<body name="b" pos="0.3 0 0"><joint name="j"/><joint name="k" type="slide"/>'
    '<geom size="0.1"/><site name="s"/></body>'
)
LONE = '<body name="lone"><joint name="l"/><geom size="0.2" pos="1 0 0"/></body>'


def test_copies_are_what_is_written_out(tmp_path):
    copies = f'<replicate count="3" sep="_" offset="0 1 0" euler="0.1 0.2 0">{PART}</replicate>'
    found = read(tmp_path, SCENE.format(LONE + copies))
    frames, at = "", np.zeros(3)
    for k in range(3):
        rx, ry = 0.1 * k, 0.2 * k
        named = PART
        for name in ("b", "j", "k", "s"):
            named = named.replace(f'name="{name}"', f'name="{name}_{k}"')
        place = " ".join(map(repr, at.tolist()))
        frames += f'<frame pos="{place}" euler="{rx!r} {ry!r} 0">{named}</frame>'
        up = math.sin(rx)  # about fixed axes: Ry Rx takes y to Ry (0, cos rx, sin rx)
        at += [up * math.sin(ry), math.cos(rx), up * math.cos(ry)]
    by_hand = SCENE.format(LONE + frames)
    by_hand = by_hand.replace(
        '<fixed name="t"><joint joint="j" coef="2"/></fixed>',
        "".join(f'<fixed name="t_{k}"><joint joint="j_{k}" coef="2"/></fixed>' for k in range(3)),
    )
    by_hand = by_hand.replace(
        '<connect body1="b" anchor="0 0 0.2"/>',
        "".join(f'<connect body1="b_{k}" anchor="0 0 0.2"/>' for k in range(3)),
    )
    motors = "".join(f'<motor name="m_{k}" joint="k_{k}"/>' for k in range(3))
    motors += "".join(f'<motor tendon="t_{k}"/>' for k in range(3))
    by_hand = by_hand.replace('<motor name="m" joint="k"/><motor tendon="t"/>', motors)
    expected = read(tmp_path, by_hand)
    ours, theirs = (found.text.splitlines(), expected.text.splitlines())
    assert [len(line.split()) for line in ours] == [len(line.split()) for line in theirs]
    for one, other in zip(ours, theirs):
        assert numbers(one) == pytest.approx(numbers(other), abs=1e-15), one
        assert letters(one) == letters(other)


def numbers(line: str) -> list[float]:
    return [float(word) for word in re.findall(r"(?<![\w.])-?\d[\d.]*(?:e-?\d+)?", line)]


def letters(line: str) -> str:
    return "".join(character for character in line if character.isalpha() or character in ":_{}")


def test_copies_of_copies_have_the_inner_number_first(tmp_path):
    inner = '<replicate count="2" sep="-" offset="1 0 0">{}</replicate>'
    part = '<body name="b"><joint/><geom size="0.1"/></body>'
    text = f'<replicate count="11" offset="0 1 0">{inner.format(part)}</replicate>'
    found = read(tmp_path, f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    assert len(found.model.bodies) == 22
    assert "# was 'b-010'" in found.text and "# was 'b-109'" in found.text


@pytest.mark.parametrize(
    ("count", "why"),
    [
        ("0", "a replicate without a count"),
        ("2.5", "a replicate without a count"),
        ("999999", "so many copies are too large a file"),
        ("1e15", "so many copies are too large a file"),  # nothing of that length is made
    ],
)
def test_copies_are_bounded(count, why, tmp_path):
    part = f'<replicate count="{count}">{LONE}</replicate>'
    with pytest.raises(ModelError, match=why):
        read(tmp_path, f"<mujoco><worldbody>{part}</worldbody></mujoco>")


WELDED = """<mujoco><worldbody>
  <body name="a"><geom size="0.1"/></body>
  <body name="b" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.2 0.3"/><site name="s" pos="0.1 0 0"/></body>
  <site name="g" pos="0 0 1"/>
</worldbody><equality>{}</equality></mujoco>"""


@pytest.mark.parametrize(
    ("weld", "closure"),
    [
        ('body1="a" body2="b" torquescale="0" anchor="0 0 -0.4"', "[[0, 0, 0.6], [0, 0, -0.4]]"),
        ('body1="a" body2="b" torquescale="0"', "[[0, 0, 1], [0, 0, 0]]"),
        ('site1="g" site2="s" torquescale="0"', "[[0, 0, 1], [0.1, 0, 0]]"),
    ],
)
def test_a_weld_without_torques_holds_a_point(weld, closure, tmp_path):
    found = read(tmp_path, WELDED.format(f"<weld {weld}/>"))
    assert "{type: ball, " in found.text and f"at: {closure}}}" in found.text
    whole = read(tmp_path, WELDED.format(f"<weld {weld}/>".replace(' torquescale="0"', "")))
    assert "{type: fixed, " in whole.text.split("closures:")[1]


def test_what_is_not_read_of_actuators_and_free_joints_is_said(tmp_path):
    text = """<mujoco>
      <compiler alignfree="true"/><option actuatorgroupdisable="2 5"/>
      <worldbody>
        <body><joint name="j"/><geom size="1"/></body>
        <body><freejoint name="own"/><geom size="1"/></body>
        <body><freejoint name="not" align="false"/><geom size="1"/></body>
        <body name="target" mocap="true"/>
      </worldbody>
      <actuator>
        <motor name="idle" joint="j" group="5"/>
        <motor name="late" joint="j" delay="0.1" nsample="2"/>
        <general name="early" joint="j" dyntype="filter" actearly="true"/>
      </actuator></mujoco>"""
    found = read(tmp_path, text)
    assert [given.name for given in found.model.inputs] == ["late", "early"]
    for words in (
        "1 actuator of groups that are switched off",
        "LEFT OUT: the delay of 1 actuator",
        "LEFT OUT: what moves the mocap body 'target', which is fixed",
        "LEFT OUT: actearly, a step's advance of the force, of 1 actuator",
        "coordinates of own are those of the body's own frame",
    ):
        assert words in found.text
        assert any(words.removeprefix("LEFT OUT: ") in note for note in found.model.notes)


def test_the_armature_of_a_free_joint_is_felt_along_the_ground(tmp_path):
    """In the ground frame a ball feels m + a and its weight alone, whatever its spin."""
    text = """<mujoco><worldbody><body>
      <joint name="base" type="free" armature="0.5"/><geom size="0.1" mass="2"/>
    </body></worldbody></mujoco>"""
    mechanics = evaluator(equations(system(read(tmp_path, text).model)))
    q, v, w = np.array([0.0, 0, 0, 0.6, 0.8, 0, 0]), [0.3, -0.2, 0.7], [1.0, 2.0, 3.0]
    rates = np.ravel(mechanics("dynamics", 0.0, np.array([*q, *v, *w]), np.zeros(0), np.zeros(0)))
    turn = np.array([[1, 0, 0], [0, -0.28, -0.96], [0, 0.96, -0.28]])
    fall = np.array([0.0, 0.0, -9.81 * 2.0 / 2.5])
    assert np.allclose(rates[7:10], turn.T @ fall - np.cross(w, v), atol=1e-14)
    assert np.allclose(rates[10:], 0.0, atol=1e-14)


PRM = '<general gainprm="50" biasprm="1 -50 -3" biastype="affine"/>'
INNER, INSIDE = '<default class="z">{}</default>', '<position class="z"/>'
SERVO = """<mujoco><default>{}</default><worldbody><body>
  <joint name="j" {}/><geom size="0.1" {}/>
</body></worldbody><actuator>{}</actuator></mujoco>"""


@pytest.mark.parametrize(
    ("default", "own", "force"),
    [  # gains and biases as MuJoCo 4.0.0 compiles them
        ('<position kp="30" kv="2"/>', "<general/>", "30*a + (-30 k)*j + (-2 d)*der(j)"),
        ('<position kp="30" kv="2"/>', '<position kv="3"/>', "30*a + (-30 k)*j + (-3 d)*der(j)"),
        ('<position kp="30" kv="2"/>', "<velocity/>", "a + (-1 d)*der(j)"),
        (
            '<position kp="30" dampratio="1"/>',
            '<position kv="3"/>',
            "30*a + (-30 k)*j + (-3 d)*der(j)",
        ),
        (PRM, "<general/>", "50*a + (1 N*m) + (-50 k)*j + (-3 d)*der(j)"),
        (PRM, "<position/>", "50*a + (-50 k)*j + (-3 d)*der(j)"),
        (PRM, '<position kv="4"/>', "50*a + (-50 k)*j + (-4 d)*der(j)"),
        (PRM, "<velocity/>", "50*a + (-50 d)*der(j)"),
        ('<velocity kv="4"/>', "<general/>", "4*a + (-4 d)*der(j)"),
        ('<velocity kv="4"/>', "<position/>", "a + (-1 k)*j"),
        (PRM.replace("/>", ' gaintype="affine"/>'), "<velocity/>", "a + (-1 d)*der(j)"),
        (PRM + '<position kp="9"/>', "<velocity/>", "a + (-1 d)*der(j)"),
        (PRM + '<position kp="9"/>', "<position/>", "9*a + (-9 k)*j + (-3 d)*der(j)"),
        ('<position kp="9"/>' + PRM, "<position/>", "50*a + (-50 k)*j + (-3 d)*der(j)"),
        ('<motor gear="3"/>', '<position kv="3"/>', "3*a + (-9 k)*j + (-27 d)*der(j)"),
        ('<cylinder area="3" bias="1 2 3"/>', '<position kp="2"/>', "2*a + (-2 k)*j"),
        (
            '<general gainprm="4"/><position kv="1"/>',
            "<general/>",
            "4*a + (-4 k)*j + (-1 d)*der(j)",
        ),
        ('<velocity kv="4"/><position kp="7"/>', "<velocity/>", "a + (-1 d)*der(j)"),
        ('<velocity kv="4"/><position kp="7"/>', "<general/>", "7*a + (-7 k)*j"),
        ('<position kp="7"/><velocity kv="4"/>', "<velocity/>", "4*a + (-4 d)*der(j)"),
        ('<position kp="7" kv="2"/><velocity kv="4"/>', "<position/>", "a + (-1 k)*j"),
        ('<position kp="7"/>' + INNER.format('<velocity kv="4"/>'), INSIDE, "7*a + (-7 k)*j"),
        (PRM + INNER.format('<muscle force="5"/>'), INSIDE, "50*a + (-50 k)*j + (-3 d)*der(j)"),
    ],
)
def test_defaults_of_one_kind_of_actuator_for_another(default, own, force, tmp_path):
    named = own.replace("/>", ' name="a" joint="j"/>')
    found = read(tmp_path, SERVO.format(default, "", "", named))
    written = force.replace(" k)", " N*m/rad)").replace(" d)", " N*m*s/rad)")
    assert f"expression: {written}}}" in found.text


def test_a_general_actuator_over_defaults_of_a_kind_that_is_not_read_is_refused(tmp_path):
    text = SERVO.format('<muscle force="5"/>', "", "", '<general name="a" joint="j"/>')
    with pytest.raises(ModelError, match="a <general> over defaults of a <muscle>") as caught:
        read(tmp_path, text)
    assert caught.value.diagnostics[0].line == 3


@pytest.mark.parametrize(
    ("default", "own"),
    [
        ('<position kp="30" kv="2"/>', "<motor/>"),
        (PRM, "<motor/>"),
        ('<position kp="30" timeconst="1"/>', "<motor/>"),
    ],
)
def test_a_motor_is_one_whatever_the_defaults_say(default, own, tmp_path):
    named = own.replace("/>", ' name="a" joint="j"/>')
    assert "a: {joint: j}" in read(tmp_path, SERVO.format(default, "", "", named)).text


def test_rotors_and_dampers_of_actuators(tmp_path):
    motor = '<motor name="a" joint="j" gear="3" armature="0.5" damping="2"/>'
    found = read(tmp_path, SERVO.format("", 'damping="1" armature="0.25"', "", motor))
    assert "damper: 19, armature: 4.75" in found.text
    # a ratio of the critical damping counts every rotor, whatever comes first
    servo, more = '<position joint="j" kp="2" dampratio="0.5"/>', '<motor joint="j" armature="4"/>'
    found = read(tmp_path, SERVO.format("", "", 'mass="10"', servo + more))
    assert f"(-{math.sqrt(2.0 * (4.0 + 0.4 * 10 * 0.1**2)):.12g}"[:14] in found.text
    with pytest.raises(ModelError, match="drives no hinge or slide"):
        read(tmp_path, WELDED.format("").replace("<equality>", AT_SITE))
    with pytest.raises(ModelError, match="damping with the square"):
        read(tmp_path, SERVO.format("", "", "", motor.replace('"2"', '"2 1 0"')))


def test_a_ratio_of_a_force_that_moves_nothing(tmp_path):
    for servo in ('<position joint="j" dampratio="1" gear="0"/>', TENDON_SERVO):
        tendon = '<tendon><fixed name="t"><joint joint="j" coef="0"/></fixed></tendon><actuator>'
        text = SERVO.format("", "", "", servo).replace("<actuator>", tendon)
        assert "der(j)" not in read(tmp_path, text).text


TENDON_SERVO = '<position tendon="t" kp="2" dampratio="0.5"/>'


def test_damping_of_an_actuator_along_a_tendon_comes_to_that_of_its_ratio(tmp_path):
    servo = '<position tendon="t" kp="2" dampratio="0.5" gear="3" damping="{}"/>'
    text = SERVO.format("", 'armature="1"', 'mass="1e-9"', servo).replace(
        "<actuator>",
        '<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon><actuator>',
    )

    def coefficient(damping: float) -> float:
        found = read(tmp_path, text.format(damping))
        return float(re.findall(r"\((\S+) N\S*\)\*der", found.text)[0])

    assert coefficient(0.25) - coefficient(0.0) == pytest.approx(-0.25 * 6.0**2, rel=1e-12)
    assert coefficient(0.0) == pytest.approx(-math.sqrt(2.0 / 36.0) * 6.0**2, rel=1e-6)


AT_SITE = '<actuator><motor site="s" armature="1"/></actuator><equality>'


def test_a_servo_of_gain_zero_and_names_that_only_look_taken(tmp_path):
    servo = '<position name="a" joint="j" kp="0"/>'
    text = SERVO.format("", "", "", servo)
    text = text.replace("<body>", '<body name="body"><joint axis="1 0 0"/>', 1)
    text = text.replace("</worldbody>", OTHER + "</worldbody>")
    found = read(tmp_path, text)
    assert [given.name for given in found.model.inputs] == ["a"]
    assert len(found.model.joints) == 3


OTHER = '<body name="else"><joint name="body_joint"/><geom size="1"/></body>'


@pytest.mark.parametrize(("joint", "rest"), [('springref="30"', 30.0), ('ref="30"', 0.0)])
def test_a_tendon_without_a_length_rests_where_the_springs_do(joint, rest, tmp_path):
    text = SERVO.format("", joint, "", "").replace("<actuator>", TENDON + "<actuator>")
    found = read(tmp_path, text)
    assert f"{40.0 * math.radians(rest):.12g}"[:12] in found.text or rest == 0.0
    assert ("N*m) +" in found.text) == (rest != 0.0)


TENDON = '<tendon><fixed name="t" stiffness="10"><joint joint="j" coef="2"/></fixed></tendon>'


def test_an_orientation_takes_the_place_of_one_in_other_words(tmp_path):
    default = '<geom type="box" size="0.1 0.2 0.3" quat="0 1 1 0"/>'
    scene = SERVO.replace('size="0.1" ', "")
    turned = read(tmp_path, scene.format(default, "", 'euler="0 0 90"', "")).text
    plain = default.replace(' quat="0 1 1 0"', "")
    assert turned == read(tmp_path, scene.format(plain, "", 'euler="0 0 90"', "")).text


def test_a_flag_is_what_was_said_last(tmp_path):
    off = '<option><flag gravity="disable" spring="disable"/></option>'
    text = SERVO.format("", 'stiffness="3"', "", "")
    twice = text.replace("<default>", off + off.replace("disable", "enable") + "<default>")
    assert read(tmp_path, twice).text == read(tmp_path, text).text
    assert "spring:" not in read(tmp_path, text.replace("<default>", off + "<default>")).text


def test_a_weld_with_a_pose_has_its_anchor_there(tmp_path):
    weld = '<weld body1="a" body2="b" relpose="0.5 0.1 0.2 1 0 0 0" anchor="0.3 0.1 -0.2"/>'
    assert "at: [[0.5, 0.1, 0.2], [0.3, 0.1, -0.2]]" in read(tmp_path, WELDED.format(weld)).text


def test_what_only_ends_a_motion_or_a_force_is_said(tmp_path):
    tendon = TENDON.replace("stiffness", 'range="-1 1" stiffness')
    joint = 'range="-1 1" limited="false" actuatorfrcrange="-2 2"'
    text = SERVO.format("", joint, "", "").replace("<actuator>", tendon + "<actuator>")
    found = read(tmp_path, text)
    assert "limits:" not in found.text
    assert "LEFT OUT: of tendons, the ranges of 't'" in found.text
    assert "LEFT OUT: the ranges of the forces of actuators at j" in found.text


def test_ties_of_bodies_that_are_one_do_nothing(tmp_path):
    """A weld of two bodies on one rigid piece, turned so that its rows are made of rounding."""
    text = """<mujoco><worldbody><body name="a"><joint axis="1 2 3"/><geom size="0.1" pos="1 0 0"/>
      <site name="s" euler="10 20 30"/><body name="b" pos="0.1 0.2 0.3" euler="20 30 40">
      <geom size="0.2"/><site name="r"/></body></body></worldbody><equality>{}</equality></mujoco>"""
    ties = '<weld body1="a" body2="b"/><connect site1="s" site2="r"/><connect body1="b" body2="a" anchor="1 0 0"/>'
    found = read(tmp_path, text.format(ties))
    assert not found.model.closures
    assert sum("of bodies that are one" in note for note in found.changed) == 3


DRAWN = """<mujoco>
  <default><joint axis="0 1 0"/><default class="bent"><joint ref="-390"/></default></default>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="a" ref="20"/>
      <joint name="s" type="slide" axis="1 0 0" ref="0.3"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0"/>
      <body name="lower" pos="0.4 0 0">
        <joint name="b" class="bent"/>
        <geom type="box" size="0.02 0.05 0.2" pos="0 0.1 0.2"/>
        <body name="hand" pos="0 0 0.4">
          <joint name="c" ref="33.5"/>
          <joint name="d" type="ball" ref="7"/>
          <joint name="e" type="slide"/>
          <geom size="0.1" pos="0 0.1 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>{}</equality>
  <keyframe><key qpos="1 1 1 1 1 0 0 0 1"/></keyframe>
</mujoco>"""


def starts_of(found: Imported) -> dict[str, float]:
    names = [x.name for x in found.model.coordinates]
    return dict(zip(names, initial_state(system(found.model)).q))


@pytest.mark.parametrize(
    "equality",
    [
        "",
        '<joint joint1="c" joint2="a"/>',
        '<joint joint1="c" joint2="a" polycoef="0 2 0.3"/>',
        '<connect body1="lower" body2="world" anchor="0.2 0 0"/>',
    ],
)
def test_hinges_and_slides_start_at_ref_where_the_file_draws_them(equality, tmp_path):
    """That is MuJoCo's qpos0; ball joints have no ref."""
    found = read(tmp_path, DRAWN.format(equality))
    wanted = {
        "a": math.radians(20), "s": 0.3, "b": math.radians(-390), "c": math.radians(33.5),
        "d_qw": 1.0, "d_qx": 0.0, "d_qy": 0.0, "d_qz": 0.0, "e": 0.0,
    }  # fmt: skip
    assert starts_of(found) == pytest.approx(wanted, abs=1e-9)
    for line in ("  a: 20 deg", "  s: 0.3", "  b: -390 deg"):
        assert line in found.text.splitlines()


def test_a_start_at_ref_that_an_equality_moves_is_assembled_near_it(tmp_path):
    found = read(tmp_path, DRAWN.format('<joint joint1="c" joint2="a" polycoef="0.01"/>'))
    start = starts_of(found)
    a, c = start["a"] - math.radians(20), start["c"] - math.radians(33.5)
    assert c - a == pytest.approx(0.01) and max(abs(a), abs(c)) < 0.01


def test_stiffness_of_a_ball_joint_turns_it_back(tmp_path):
    text = ARM.format(spring="", actuator="").replace(
        '"ball"', '"ball" stiffness="3" damping="0.2"'
    )
    found = read(tmp_path, text)
    assert re.search(r"spring_d: +{type: spring, joint: d, stiffness: 3}", found.text)
    e = equations(system(found.model))
    assert found.text.count("type: damper, velocity: d.w") == 3 and e.has("dynamics")
    with pytest.raises(ModelError, match="a spring in a free joint"):
        read(tmp_path, text.replace('"ball"', '"free"'))


FLOATING = """<mujoco model="floating">
  <worldbody><body name="a" euler="20 10 5"><freejoint name="f"/><geom size="0.1"/>
    <body name="c" pos="0.4 0 0" euler="0 90 0"><joint name="b" type="ball"/><geom size="0.1" pos="0.1 0 0"/></body>
  </body></worldbody>
  <actuator>{}</actuator>
</mujoco>"""


@pytest.mark.parametrize(
    ("actuator", "loads"),
    [
        (
            'joint="f" gear="1 2 0 0 0 3"',
            [
                "{type: force, body: a, at: [0, 0, 0], components: [m, 2*m, 0], frame: ground}",
                "{type: torque, body: a, components: [0, 0, 3*m], frame: body}",
            ],
        ),
        (
            'jointinparent="f" gear="0 0 0 1 0 0"',
            ["{type: torque, body: a, components: [m, 0, 0], frame: ground}"],
        ),
        (
            'jointinparent="b" gear="2 0 0"',  # the joint's axes are turned by the body's place
            [
                "{type: torque, body: c, components: [0, 0, (-2)*m], frame: a}",
                "{type: torque, body: a, components: [0, 0, 2*m], frame: a}",
            ],
        ),
    ],
)
def test_motors_at_free_and_ball_joints(actuator, loads, tmp_path):
    """Accelerations of such a file are MuJoCo's to 1e-14."""
    found = read(tmp_path, FLOATING.format(f'<motor name="m" {actuator}/>'))
    own = [line.partition(":")[2].strip() for line in found.text.splitlines() if "  m_" in line]
    assert own == loads
    assert equations(system(found.model)).has("dynamics")


def test_servos_at_free_joints_are_refused(tmp_path):
    with pytest.raises(ModelError, match="at the free joint 'f'"):
        read(tmp_path, FLOATING.format('<position name="m" joint="f" kp="3"/>'))
