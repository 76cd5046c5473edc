"""Constraint rows about the axes of a link, where these are not the ground's."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from derive.choices.resolution import ranked_partitions
from derive.choices.survey import survey_of
from derive.formulations import equations
from derive.model import load_text
from derive.robots.reading import imported
from derive.states import system
from derive.states.initial import initial_state
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

SLIDER = """
model: slider
plane: {plane}
bodies: {{a: {{mass: 1 kg, inertia: 0.1}}, b: {{mass: 1 kg, inertia: 0.1}}, c: {{mass: 1 kg}}}}
joints:
  A: {{type: revolute, parent: ground, child: a, coordinate: q}}
  B: {{type: revolute, parent: a, child: b, at: [0.3, 0], coordinate: r}}
  S: {{type: prismatic, parent: ground, child: c, axis: [0.6, 0.8], coordinate: s}}
closures: {{C: {{type: revolute, between: [b, c], at: [[0.9, 0], [0, 0]]}}}}
initial: {{guess: {{q: 0.5, r: -0.7, s: 1}}}}
"""
WELDED = """
model: welded
plane: xy
bodies: {a: {mass: 1 kg, inertia: 0.1}, b: {mass: 1 kg, inertia: 0.1}}
joints:
  A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: q}
  B: {type: prismatic, parent: ground, child: b, axis: [0.6, 0.8], coordinate: r}
closures: {C: {type: fixed, between: [b, ground], at: [[0.1, 0.2], [0.4, 0.6]]}}
initial: {guess: {r: 0.5 m}}
"""
MODELS = {plane: SLIDER.format(plane=plane) for plane in ("xy", "xz", "yz")} | {"welded": WELDED}


@pytest.mark.parametrize("name", MODELS)
def test_a_slide_across_the_axes_of_the_plane_closes_a_loop(name: str) -> None:
    """The slide is the third axis of its link, and the normal of the plane another one."""
    mechanics = system(load_text(MODELS[name]))
    seen = evidence(reference(mechanics.model), equations(mechanics), None, 4)
    assert [check.name for check in results(seen, QUICK) if not check.passed] == []


# a loop of four in a plane, on an arm that turns it about another axis
ON_AN_ARM = """model: gripper
bodies:
  arm: {{mass: 1, com: [0.3, 0, 0], inertia: [0.1, 0.1, 0.1]}}
  a: {{mass: 1, com: [0.1, 0, 0], inertia: [0.1, 0.1, 0.1]}}
  b: {{mass: 1, com: [0.1, 0, 0], inertia: [0.1, 0.1, 0.1]}}
  c: {{mass: 1, com: [0.1, 0, 0], inertia: [0.1, 0.1, 0.1]}}
joints:
  J: {{type: revolute, parent: ground, child: arm, axis: y, coordinate: j}}
  A: {{type: revolute, parent: arm, child: a, axis: z, coordinate: qa, at: [0.5, 0, 0]}}
  B: {{type: revolute, parent: a, child: b, axis: z, coordinate: qb, at: [0.3, 0, 0]}}
  C: {{type: revolute, parent: arm, child: c, axis: z, coordinate: qc, at: [0.5, 0.2, 0]}}
closures: {{X: {{type: {}, between: [b, c], at: [[0.3, 0, 0], [0.4, 0, 0]]}}}}
initial: {{guess: {{qa: 0.5, qb: 0.3, qc: 0.2}}}}
"""


@pytest.mark.parametrize("kind", ["ball", "revolute, axis: z", "cylindrical, axis: z"])
def test_how_a_loop_is_carried_is_no_part_of_its_closure(kind: str) -> None:
    """Entries for the arm cancelled, to rounding, and the dynamics took twice as many operations;
    a row that says nothing is one of zeros."""
    found = system(load_text(ON_AN_ARM.format(kind)))
    assert not any(found.A.sparsity().has_nz(i, 0) for i in range(found.A.size1()))
    for row in (k for k, row in enumerate(found.rows) if row.name in ("X.z", "X.shift3")):
        assert found.A[row, :].is_zero()


# the same in MJCF, turned by quaternions of six digits: what cancels is rounding, and no zeros
GRIPPER = """<mujoco model="g"><compiler angle="radian"/><default><geom type="sphere" size="0.05" mass="1"/></default><worldbody>
<body name="l1" pos="0 0 0.333"><joint axis="0 0 1"/><geom/>
<body name="l2" quat="0.707107 -0.707107 0 0"><joint axis="0 0 1"/><geom pos="0 -0.1 0"/>
<body name="l3" pos="0 -0.316 0" quat="0.707107 0.707107 0 0"><joint axis="0 0 1"/><geom/>
<body name="l4" pos="0.0825 0 0" quat="0.707107 0.707107 0 0"><joint axis="0 0 1"/><geom/>
<body name="base" pos="0 0 0.107" quat="0.707107 0 0 -0.707107">
 <body name="drive" pos="0 0.0306 0.0549" quat="0 0 0 1"><joint name="d1" axis="1 0 0"/><geom mass="0.1"/>
  <body name="coupler" pos="0 0.0315 -0.0041"><joint axis="1 0 0"/><geom mass="0.1"/></body></body>
 <body name="spring" pos="0 0.0132 0.0609" quat="0 0 0 1"><joint axis="1 0 0"/><geom mass="0.1"/>
  <body name="follower" pos="0 0.055 0.0375"><joint axis="1 0 0" pos="0 -0.018 0.0065"/><geom mass="0.1"/></body></body>
 <body name="drive2" pos="0 -0.0306 0.0549"><joint name="d2" axis="1 0 0"/><geom mass="0.1"/>
  <body name="coupler2" pos="0 0.0315 -0.0041"><joint axis="1 0 0"/><geom mass="0.1"/></body></body>
 <body name="spring2" pos="0 -0.0132 0.0609"><joint axis="1 0 0"/><geom mass="0.1"/>
  <body name="follower2" pos="0 0.055 0.0375"><joint axis="1 0 0" pos="0 -0.018 0.0065"/><geom mass="0.1"/></body></body>
</body></body></body></body></body></worldbody>
<equality><connect anchor="0 0 0" body1="follower" body2="coupler"/>
<connect anchor="0 0 0" body1="follower2" body2="coupler2"/><joint joint1="d1" joint2="d2"/></equality></mujoco>
"""


def test_what_rounding_left_of_a_row_is_no_pivot(tmp_path: Path) -> None:
    """Neither is it a unit, nor what an initial state has to meet better than it can be told:
    gripper and arm were refused."""
    file = tmp_path / "gripper.xml"
    file.write_text(GRIPPER, encoding="utf-8")
    found = system(imported(file).model)
    assert initial_state(found).q.shape == (12,)
    survey = survey_of(found)
    assert survey.rank == 5
    assert ranked_partitions(survey)


TUMBLING = """model: tumbling
gravity: [0, 0, 0]
bodies:
  base: {mass: 3, inertia: [0.1, 0.12, 0.15]}
  a: {mass: 1, com: [0, 0, 0.1], inertia: [0.02, 0.03, 0.04]}
  b: {mass: 1, com: [0, 0.15, 0], inertia: [0.02, 0.03, 0.04]}
  c: {mass: 1, com: [0, 0, 0.1], inertia: [0.02, 0.03, 0.04]}
joints:
  root: {type: free, parent: ground, child: base}
  ja: {type: revolute, parent: base, child: a, axis: x, coordinate: qa}
  jb: {type: revolute, parent: a, child: b, at: [[0, 0, 0.2], [0, 0, 0]], axis: x, coordinate: qb}
  jc: {type: revolute, parent: base, child: c, at: [0, 0.3, 0], axis: x, coordinate: qc}
closures: {C: {type: ball, between: [b, c], at: [[0, 0.3, 0], [0, 0, 0.25]]}}
initial: {root.wz: 2, root.wx: 0.5, der(qa): 1.5, guess: {qa: 0.2}}
"""


def test_rows_that_repeat_others_to_rounding_are_turned_with_the_bodies() -> None:
    """What the loop was closed by left 1e-12, which counted as independence: along the ground's
    axes no row can be left out for good, and the motion ended where the loop's plane had turned."""
    found = system(load_text(TUMBLING))
    assert [closure.along for closure in found.model.closures] != [-1]


APART = """model: apart
gravity: [0, 0, 0]
bodies: {{a: {{mass: 1, inertia: [1, 1, 1]}}, b: {{mass: 1, inertia: [1, 1, 1]}}}}
joints:
  A: {{type: free, parent: ground, child: a, orientation: quaternion}}
  B: {{type: free, parent: ground, child: b, orientation: quaternion}}
closures: {{C: {{type: {}, between: [a, b], at: [[0, 0, 0], [0, 0, 0]]}}}}
"""


@pytest.mark.parametrize("kind", ["fixed", "revolute", "prismatic", "cylindrical"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_turns_and_shifts_are_about_the_axes_that_the_reference_names(kind: str, axis: str) -> None:
    found = system(load_text(APART.format(kind if kind == "fixed" else f"{kind}, axis: {axis}")))
    A = ca.Function("A", [found.t, found.q, found.p], [found.A])
    rates = A(0, [0, 0, 0, 1, 0, 0, 0] * 2, []).full()[:, 6:]  # of the second body: v, ω
    e3 = np.eye(3)["xyz".index("z" if kind == "fixed" else axis)]
    e1 = np.cross(e3, np.eye(3)[int(np.argmin(np.abs(e3)))])
    e2 = np.cross(e3, e1)
    along = {"shift1": e1, "shift2": e2}
    about = {"turn1": e2, "turn2": -e1, "turn3": e3}
    for row, rate in zip(found.rows, rates):
        part = row.name.partition(".")[2]
        if part in along:
            assert np.abs(rate[:3] - along[part]).max() < 1e-12
        elif part in about:
            assert np.abs(rate[3:] - about[part]).max() < 1e-12
