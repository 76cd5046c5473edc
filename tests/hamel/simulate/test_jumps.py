"""Constraints that jump: the motion ends there and is not carried to another branch."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError

# a rope over a pulley to a drum; the load swings up until the rope would leave the pulley by a
# quarter of a turn, where its length as it is counted jumps by a whole one
ROPE = """model: rope
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {load: {mass: 1 kg}, drum: {mass: 1 kg, inertia: 0.01}}
joints:
  hang: {type: point, parent: ground, child: load, coordinates: [x, y]}
  shaft: {type: revolute, parent: ground, child: drum, at: [-1 m, 0], coordinate: wound}
paths:
  rope:
    - {body: ground, at: [-1 m, 0]}
    - {body: ground, at: [0, 0.2 m], pulley: {radius: 0.1 m, side: right}}
    - {body: load}
constraints: {inext: {holonomic: length(rope) - 2 m + (0.1 m)*wound}}
initial: {x: 1 m, y: 0 m, der(x): 0.5 m/s, der(y): 6 m/s, guess: {wound: 0 rad}}
"""


@pytest.fixture(scope="module")
def rope(tmp_path_factory):
    path = tmp_path_factory.mktemp("rope") / "rope.yaml"
    path.write_text(ROPE, "utf-8")
    return path


@pytest.mark.parametrize("rtol", [1e-5, 1e-12])
def test_a_motion_ends_where_a_constraint_jumps(rope, rtol):
    with pytest.raises(AssumptionError, match=r"at t = 1\.0123.*: a constraint jumps here"):
        hamel.simulate(rope, time=1.2, rtol=rtol)


@pytest.mark.parametrize("numpy", [False, True])
def test_so_do_many_motions(rope, tmp_path, monkeypatch, numpy):
    if numpy:
        monkeypatch.setenv("CC", "/nonexistent/cc")
    with warnings.catch_warnings():  # that there is no compiler
        warnings.simplefilter("ignore", RuntimeWarning)
        made = hamel.build(rope, out=tmp_path / "rope", numpy=numpy)
        module = hamel.load(made.folder)
    start = module.project(0.0, np.array([1.0, 0.0, 0.0, 0.5, 6.0]))
    slow = module.project(0.0, np.array([1.0, 0.0, 0.0, 0.5, 1.0]))
    with pytest.warns(RuntimeWarning, match="2 of 3 motions ended early"):
        found = module.simulate((0.0, 1.2), np.array([start, slow, start]))
    assert [int(x) for x in found.status] == [13, 0, 13]
    # at rest and beside the constraints: projection takes it there, and that is no jump
    beside = module.project(0.0, np.array([1.0, 0.0, 0.0, 0.0, 0.0]))
    beside[2] += 0.1
    for x in (beside, np.stack([beside, beside])):
        assert not np.any(module.simulate((0.0, 0.1), x).status)
    with pytest.raises(module.Stopped, match=r"at t = 0\.9549.*: a constraint jumps here"):
        module.simulate((0.0, 1.2), start)


INWARDS = """
model: inwards
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: planar, parent: ground, child: A, coordinates: [x, y, a]}}
paths:
  rope:
    - {body: ground, at: [1, -0.3]}
    - {body: ground, at: [0, 0], pulley: {radius: 0.4, side: left}}
    - {body: A}
loads: {k: {type: tension, path: rope, tension: 3 N}}
initial: {x: -1 m, ja.vx: 5 m/s}
"""


def test_an_end_that_comes_within_its_pulley_is_told(tmp_path):
    path = tmp_path / "inwards.yaml"
    path.write_text(INWARDS)
    with pytest.raises(AssumptionError, match="rope may have an end within a pulley"):
        hamel.simulate(path, time=2.0)


STUCK = """model: stuck_while_pulled
plane: xy
bodies: {a: {mass: 1 kg}}
joints: {A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: x}}
loads: {f: {type: expression, joint: A, expression: "-(3 N)*sign(der(x)) + (1 N)*sin((2 rad/s)*t)"}}
initial: {der(x): 1}
"""


@pytest.mark.slow
def test_what_sticks_while_forces_change_ends(tmp_path):
    """Its steps end at the jump and none is rejected: it had no end."""
    path = tmp_path / "stuck.yaml"
    path.write_text(STUCK, "utf-8")
    with pytest.raises(AssumptionError, match="forces jump here and hold the motion"):
        hamel.simulate(path, time=3.0)
