"""MJCF files as users have them: copies, damping by ratios, welds without torques, and what is said
of the rest. Ratios against the mass matrix that is derived of the model they stand in.

Of derive.robots.mjcf: reference, replicas, actuators, ties.
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
    with pytest.raises(ModelError, match="a spring in a ball joint"):
        read(tmp_path, ARM.format(spring="", actuator="").replace('"ball"', BALL))


BALL = '"ball" springdamper="1 1"'
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
        "LEFT OUT: actearly, a step's advance of the force, of 1 actuator",
        "coordinates of own are those of the body's own frame",
    ):
        assert words in found.text


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
