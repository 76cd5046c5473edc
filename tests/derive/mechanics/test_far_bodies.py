"""Bodies many joints away: what forces on them do and how fast they move goes from link to link,
and what is between two of them leaves out what carries both.

Of derive.mechanics: scene.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.mechanics import scene
from derive.mechanics.records import System
from derive.mechanics.scene import Scene
from derive.model import load_text
from derive.states import system

LINKS = 6
CHAIN = f"""
model: chain
repeat: {{i: 1..{LINKS - 1}}}
bodies:
  b0: {{mass: 1, com: [0.2, 0.1, 0], inertia: [0.1, 0.2, 0.25]}}
  "b{{i}}": {{mass: 1, com: [0.2, 0.1, 0], inertia: [0.1, 0.2, 0.25]}}
joints:
  j0: {{type: ball, parent: ground, child: b0}}
  "j{{i}}": {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", axis: [0.6, 0, 0.8], at: [0.3, 0.1, 0.2]}}
paths: {{rope: [{{body: b1, at: [0.1, 0.2, 0]}}, {{body: b3, at: [0, 0.1, 0.2]}}, {{body: b5, at: [0.2, 0, 0.1]}}]}}
loads:
LOADS
"""
FORCES = """
  own: {type: force, body: b5, at: [0.1, 0.2, 0.3], components: [1 N, 2 N, -3 N]}
  turned: {type: force, body: b5, at: [0.3, 0, 0.1], components: [3 N, -2 N, 1 N], frame: b2}
  drag: {type: force, body: b4, components: ["-(2 N*s/m)*velocity(b4, [0, 0.1, 0]).x", 0 N, 1 N], frame: ground}
  twist: {type: torque, body: b3, components: [1, 2, 3], frame: ground}
"""
TIES = """
  spring: {type: spring, between: [b1, b4], at: [[0, 0.1, 0.2], [0.2, 0, 0.1]], stiffness: 30, length: 0.1 m, damping: 2}
  weld: {type: bushing, between: [b2, b4], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: [5, 6, 7], torsion: 1, damping: 2}
  pull: {type: tension, path: rope, tension: 3 N}
  seen: {type: expression, joint: j3, expression: "-(3 N)*position(b5, [0.1, 0, 0], b2).z"}
"""


def forces(made: System) -> np.ndarray:
    """Q at three states."""
    rng = np.random.default_rng(5)
    at = ca.Function("Q", [made.t, made.q, made.v, made.p], [made.Q])
    q = rng.normal(size=(3, made.q.numel()))
    q[:, :4] /= np.linalg.norm(q[:, :4], axis=1)[:, None]
    v = rng.normal(size=(3, made.v.numel()))
    p = np.array(made.parameters, dtype=float)
    return np.array([at(0.3, a, b, p).full().ravel() for a, b in zip(q, v)])


def derived(loads: str) -> System:
    return system(load_text(CHAIN.replace("LOADS", loads)))


@pytest.mark.parametrize("line", FORCES.strip().splitlines(), ids=lambda x: x.split(":")[0].strip())
def test_forces_go_from_link_to_link(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Jᵀ f with the Jacobian of the point in the ground."""
    found = forces(derived(f"  {line.strip()}\n"))
    monkeypatch.setattr(scene, "DEEP", 99)
    expected = forces(derived(f"  {line.strip()}\n"))
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("line", TIES.strip().splitlines(), ids=lambda x: x.split(":")[0].strip())
def test_ties_leave_out_what_carries_both(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with all points in the ground; the ball joint below feels nothing of it."""
    found = forces(derived(f"  {line.strip()}\n"))
    monkeypatch.setattr(Scene, "near", lambda self, *tips: self)
    expected = forces(derived(f"  {line.strip()}\n"))
    assert not found[:, :3].any()
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-12)
