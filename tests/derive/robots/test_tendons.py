"""Spatial tendons of MJCF files: paths through sites, pulleys, springs, actuators and equalities.

Accelerations, gaps and their gradients are MuJoCo's own (4.0.0, `mj_forward`: qacc_smooth, efc_pos,
efc_J).

Of derive.robots.mjcf: tendons, forces, polynomials.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import Evaluator, evaluator
from derive.robots.reading import imported
from derive.states import system

STRINGS = """<mujoco model="strings">
  <compiler angle="radian"/>
  <worldbody>
    <site name="anchor" pos="0.2 0.1 1.5"/>
    <site name="low" pos="-0.5 0.3 -1"/>
    <body name="upper" pos="0 0 1" euler="0.1 0.2 0.3">
      <joint name="turn" axis="1 0.3 0"/>
      <joint name="swing" axis="0 1 0" damping="0.1"/>
      <inertial pos="0.1 0.02 -0.2" mass="1.3" diaginertia="0.02 0.03 0.01"/>
      <site name="a" pos="0.15 0.05 -0.1"/>
      <body name="lower" pos="0 0 -0.4">
        <joint name="elbow" axis="0 1 0.2" stiffness="2" {joint}/>
        <inertial pos="0.05 0 -0.2" mass="0.7" diaginertia="0.01 0.02 0.015"/>
        <site name="b" pos="0.1 -0.05 -0.2"/>
        <site name="c" pos="0 0.1 -0.35"/>
      </body>
    </body>
    <body name="weight" pos="0.6 0.2 0.4">
      <joint name="rail" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
      <site name="w" pos="0.02 0 0"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="band" {band}>
      <site site="anchor"/><site site="a"/><site site="b"/>
    </spatial>
    <spatial name="slack" stiffness="70" springlength="0.4 1.1"><site site="low"/><site site="c"/></spatial>
    <spatial name="bumper" stiffness="20" springlength="2.5 9"><site site="low"/><site site="c"/></spatial>
    <spatial name="rope" damping="0.4" stiffness="30" springlength="0.2">
      <site site="a"/><site site="w"/>
      <pulley divisor="2"/><site site="w"/><site site="anchor"/>
      <pulley divisor="3"/><site site="low"/><site site="b"/>
    </spatial>
    <spatial name="cable"><site site="low"/><site site="b"/><site site="w"/></spatial>
  </tendon>
  <actuator>{actuators}</actuator>
  <equality>{equalities}</equality>
</mujoco>"""
ACTUATORS = """<motor name="winch" tendon="rope" gear="-5"/>
    <position name="servo" tendon="cable" kp="50" kv="2" gear="1.5"/>
    <general name="lag" tendon="band" gainprm="4 2 0.5" gaintype="affine" biastype="affine"
      biasprm="1 -3 -0.2" dyntype="filter" dynprm="0.1"/>
    <velocity name="brake" tendon="band" kv="2"/>'"""
Q, V, U, ACTIVATION = [0.3, -0.5, 0.8, 0.1], [0.4, -1.1, 0.7, 0.6], [0.9, -0.4, 1.2, 0.5], [0.35]


def text(joint: str = "", band: str = "", actuators: str = "", equalities: str = "") -> str:
    return STRINGS.format(joint=joint, band=band, actuators=actuators, equalities=equalities)


def derived(tmp_path, given: str) -> Evaluator:
    file = tmp_path / "strings.xml"
    file.write_text(given)
    return evaluator(equations(system(imported(file).model)))


def accelerations(mechanics: Evaluator) -> np.ndarray:
    rates = np.ravel(mechanics("dynamics", 0.0, [*Q, *V, *ACTIVATION], U, []))
    return rates[4:8]


def test_lines_pull_as_in_mujoco(tmp_path):
    mechanics = derived(tmp_path, text("", 'stiffness="120" damping="3"', ACTUATORS))
    wanted = [-322.60112212, 101.11182651, -856.22320658, 1.97410139]
    np.testing.assert_allclose(accelerations(mechanics), wanted, rtol=1e-8)


def test_damping_by_a_ratio_is_of_what_the_line_moves(tmp_path):
    """At the reference configuration, in which the elbow is at 0.4 rad."""
    actuators = ACTUATORS.replace('kv="2" gear="1.5"', 'dampratio="0.7" gear="1.5"')
    band = 'stiffness="120" springlength="0.9"'
    mechanics = derived(tmp_path, text('ref="0.4"', band, actuators))
    wanted = [-296.50861086, 12.85133786, -274.51087, 2.53221509]
    np.testing.assert_allclose(accelerations(mechanics), wanted, rtol=1e-8)


POLYNOMIAL = """<mujoco><option gravity="0 0 0"/><worldbody><site name="w"/><body pos="1 0 0">
  <joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
  <site name="s"/></body></worldbody>
  <tendon><spatial name="t" {}><site site="w"/><site site="s"/></spatial></tendon></mujoco>"""


@pytest.mark.parametrize(
    ("given", "q", "v", "wanted"),
    [
        ('stiffness="1 2 4" springlength="1"', 0.2, 0.0, -0.312),
        ('stiffness="1 2 4" springlength="1"', -0.2, 0.0, 0.152),
        ('stiffness="1 2 4" springlength="0.9 1.1"', 0.2, 0.0, -0.124),
        ('stiffness="1 2 4" springlength="0.9 1.1"', -0.2, 0.0, 0.084),
        ('stiffness="1 2 4" springlength="0.9 1.1"', 0.05, 0.0, 0.0),
        ('damping="1 2 4"', 0.0, 0.2, -0.312),
        ('damping="1 2 4"', 0.0, -0.2, 0.312),
    ],
)
def test_stiffness_and_damping_are_polynomials_as_in_mujoco(tmp_path, given, q, v, wanted):
    mechanics = derived(tmp_path, POLYNOMIAL.format(given))
    found = np.ravel(mechanics("dynamics", 0.0, [q, v], [], []))
    assert found[1] == pytest.approx(wanted, abs=1e-12)


BENT = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body><joint name="j" {}/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody><tendon><fixed name="t" {}><joint joint="j" coef="2"/></fixed></tendon></mujoco>"""
BENDING, SLOWING = 'stiffness="2 0.5 0.7"', 'damping="0.1 0.02 0.003"'


@pytest.mark.parametrize(
    ("joint", "tendon", "q", "v", "wanted"),
    [
        (f'{BENDING} springref="0.1"', "", 0.5, 0.0, -0.9248),
        (f'{BENDING} springref="0.1"', "", -0.5, 0.0, 1.1712),
        ('stiffness="0 2 3" type="slide"', "", 0.5, 0.0, -0.875),
        (SLOWING, "", 0.0, 0.5, -0.055375),
        (SLOWING, "", 0.0, -0.5, 0.055375),
        ("", f'{BENDING} springlength="0.1"', 0.5, 0.0, -5.4306),
        ("", f'{BENDING} springlength="0.1"', -0.5, 0.0, 5.0534),
        ("", f'{BENDING} springlength="0 0.1"', 0.5, 0.0, -5.4306),
        ("", f'{BENDING} springlength="0 0.1"', 0.02, 0.0, 0.0),
        ("", f'{BENDING} springlength="0 0.1"', -0.5, 0.0, 4.4),
        ("", 'stiffness="2" springlength="-0.2 0.1"', -0.05, 0.0, 0.0),
        ("", 'stiffness="2" springlength="-0.2 0.1"', -0.5, 0.0, 3.2),
        ("", SLOWING, 0.0, 0.5, -0.246),
        ("", SLOWING, 0.0, -0.5, 0.246),
    ],
)
def test_springs_and_dampers_of_joints_are_polynomials_too(tmp_path, joint, tendon, q, v, wanted):
    """Those of a fixed tendon may be slack over a range. Forces are MuJoCo's `qfrc_passive`."""
    mechanics = derived(tmp_path, BENT.format(joint, tendon))
    found = np.ravel(mechanics("dynamics", 0.0, [q, v], [], []))
    assert found[1] == pytest.approx(wanted, abs=1e-12)


def test_dampers_of_ball_joints_are_polynomials_of_each_rate(tmp_path):
    mechanics = derived(
        tmp_path, BENT[: BENT.index("<tendon")].format(SLOWING + ' type="ball"') + "</mujoco>"
    )
    found = np.ravel(mechanics("dynamics", 0.0, [1, 0, 0, 0, 0.5, -0.6, 0.7], [], []))
    np.testing.assert_allclose(found[4:], [-0.055375, 0.067848, -0.080829], atol=1e-12)


@pytest.mark.parametrize(
    ("joint", "why"),
    [
        (f'type="ball" {BENDING}', "stiffness with squares or cubes in a ball joint"),
        (f'type="free" {SLOWING}', "damping with squares or cubes in a free joint"),
    ],
)
def test_what_is_not_read_of_polynomials_is_said(tmp_path, joint, why):
    with pytest.raises(ModelError, match=why):
        derived(tmp_path, BENT[: BENT.index("<tendon")].format(joint) + "</mujoco>")


@pytest.mark.parametrize(
    ("equality", "gap", "row"),
    [
        (
            '<tendon tendon1="band"/>',
            -0.04669576,
            [-0.00316602, 0.16094426, 0.06776485, 0.0],
        ),
        (
            '<tendon tendon1="rope" tendon2="cable" polycoef="0.1 -1.2 0.3"/>',
            -0.25743869,
            [0.38911423, 0.11499831, 0.0464885, -0.99639296],
        ),
    ],
)
def test_lengths_are_tied_as_in_mujoco(tmp_path, equality, gap, row):
    mechanics = derived(tmp_path, text('ref="0.4"', equalities=equality)).equations.system
    at = ca.Function("at", [mechanics.q], [mechanics.phi, mechanics.A])
    phi, A = (np.array(x).ravel() for x in at(Q))
    np.testing.assert_allclose(phi, gap, atol=2e-8)
    np.testing.assert_allclose(A, row, atol=2e-8)


def test_ranges_of_tendon_forces_and_actuators_without_names(tmp_path):
    file = tmp_path / "strings.xml"
    motor = '<motor tendon="cable"/>'
    given = text(actuators=3 * motor).replace(
        'name="cable"', 'name="cable" actuatorfrcrange="-1 1"'
    )
    file.write_text(given)
    found = imported(file)
    assert [u.name for u in found.model.inputs] == ["tau_cable", "tau_cable_2", "tau_cable_3"]
    assert "the ranges of the forces of actuators at cable" in " ".join(found.left_out)


def test_only_what_acts_is_written(tmp_path):
    file = tmp_path / "strings.xml"
    file.write_text(text(equalities='<tendon tendon1="cable"/>'))
    model = imported(file).model
    assert {path.name for path in model.paths} == {
        "slack",
        "bumper",
        "rope",
        "rope_2",
        "rope_3",
        "cable",
    }


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            '<site site="anchor"/><site site="a"/>',
            '<geom geom="g"/><site site="a"/>',
            "a tendon round a geom",
        ),
        ('divisor="2"', 'divisor="0"', "a divisor that is not positive"),
        (
            '<site site="low"/><site site="c"/>',
            '<site site="c"/>',
            "the tendon 'slack' has no two sites",
        ),
        ('<site site="low"/><site site="c"/>', '<site site="law"/>', "did you mean 'low'?"),
        (
            '<spatial name="cable">',
            '<fixed name="f" stiffness="1 2 3 4"><joint joint="rail"/></fixed><spatial name="cable">',
            "4 numbers in 'stiffness'",
        ),
        ('springlength="0.4 1.1"', 'springlength="1.1 0.4"', "the springlength"),
        ('springlength="0.4 1.1"', 'springlength="1 2 3"', "the springlength"),
        ('damping="0.4"', 'damping="1 2 3 4"', "4 numbers in 'damping'"),
        (
            '<site site="low"/><site site="c"/>',
            '<site site="low"/><site site="c"/><pulley/>',
            "a tendon that ends with a pulley",
        ),
        ('kv="2" gear="1.5"', 'kv="2" dampratio="1"', "kv and dampratio of one actuator"),
        ('name="rope"', 'name="rope" armature="1"', "a tendon with armature"),
        ('tendon="cable"', 'tendon="cables"', "unknown tendon 'cables'"),
        (
            'springlength="0.4 1.1"',
            'springlength="-1"',
            "the length at rest of a tendon where joints rest elsewhere (elbow)",
        ),
    ],
)
def test_what_is_no_row_of_lines_is_told(tmp_path, old, new, said):
    given = text('ref="0.4"', 'stiffness="1" springlength="1"', ACTUATORS)
    assert old in given
    with pytest.raises(ModelError) as caught:
        derived(tmp_path, given.replace(old, new))
    assert said in str(caught.value)


def test_a_class_has_the_rest_of_a_shorter_list(tmp_path):
    """As MuJoCo compiles it: 0.7 and 1 of the damping, 0.4, 0.2 and 0.3 of the size."""
    given = POLYNOMIAL.format('class="B"').replace(
        "<worldbody>",
        '<default><default class="A"><tendon damping="2 1"/><geom size="0.1 0.2 0.3"/>'
        '<default class="B"><tendon damping="0.7"/></default></default></default><worldbody>',
    )
    found = derived(tmp_path, given)("dynamics", 0.0, [0.0, 2.0], [], [])
    assert np.ravel(found)[1] == pytest.approx(-0.7 * 2 - 1 * 4)
    box = (
        '<mujoco><default><default class="A"><geom size="0.1 0.2 0.3"/></default></default>'
        '<worldbody><body><joint/><geom class="A" type="box" size="0.4" mass="3"/></body></worldbody></mujoco>'
    )
    file = tmp_path / "box.xml"
    file.write_text(box)
    (body,) = imported(file).model.bodies
    assert body.inertia[0].value == pytest.approx(0.2**2 + 0.3**2)
    assert body.inertia[1].value == pytest.approx(0.4**2 + 0.3**2)
