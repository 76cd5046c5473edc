"""Bodies many joints away: what forces on them do and how fast they move goes from link to link,
and what is between two of them leaves out what carries both.

Of derive.mechanics: scene.
Of derive.mechanics.loads: points.
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
  "b{{i}}": {{mass: 1, com: [0.2, 0.1, 0], inertia: [0.1, 0.2, 0.25]}}BODIES
joints:
  j0: {{type: ball, parent: ground, child: b0}}
  "j{{i}}": {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", axis: [0.6, 0, 0.8], at: [0.3, 0.1, 0.2]}}JOINTS
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


BRANCH = """
  hand: {mass: 1, com: [0.1, 0, 0.2], inertia: 0.1}
  arm: {mass: 1, com: [0.1, 0, 0.2], inertia: 0.1}
"""
OTHER_JOINTS = """
  A: {type: revolute, parent: ground, child: arm, axis: y, at: [0.5, 0, 0]}
  H: {type: revolute, parent: arm, child: hand, axis: x, at: [0.2, 0.1, 0]}
"""
FAR = """
  spring: {type: spring, between: [ground, b4], at: [[0, 0.1, 0.2], [0.2, 0, 0.1]], stiffness: 30, length: 0.1 m}
  damper: {type: spring, between: [b3, hand], at: [[0, 0.1, 0.2], [0.2, 0, 0.1]], stiffness: 30, length: 0.1 m, damping: 2}
  weld: {type: bushing, between: [ground, b4], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: [5, 6, 7], torsion: [1, 2, 3], damping: 2, torsion_damping: [3, 4, 5]}
  strut: {type: bushing, between: [hand, b4], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: [5, 6, 7], torsion: [1, 2, 3], damping: [2, 1, 3], torsion_damping: 3}
  ball: {type: contact, body: b5, at: [0.1, 0, 0.2], shape: {sphere: {radius: 3 m}}, plane: {normal: [0.6, 0, 0.8]}, stiffness: 30, damping: 0.2, friction: 0.5, smoothing: 1}
  wheel: {type: contact, body: b4, at: [0.1, 0, 0.2], shape: {wheel: {radius: 3 m, axis: y}}, plane: {normal: z}, stiffness: 30, damping: 0.2, tyre: {longitudinal: {linear: 10}, lateral: {linear: 5}}, smoothing: 1}
  palm: {type: contact, body: b4, at: [0.1, 0, 0.2], shape: {wheel: {radius: 3 m, axis: y}}, plane: {normal: z, of: hand}, stiffness: 30, damping: 0.2, friction: 0.5, smoothing: 1}
  bowl: {type: contact, body: b5, at: [0.1, 0, 0.2], shape: {sphere: {radius: 3 m}}, surface: "z - 0.1*(x^2 + y^2)/(1 m)", of: hand, stiffness: 30, damping: 0.2, friction: 0.5, smoothing: 1}
"""
TOUCHING = """
  next: {type: contact, body: b4, at: [0.1, 0, 0.2], shape: {sphere: {radius: 3 m}}, plane: {normal: z, of: b3}, stiffness: 30, damping: 0.2, friction: 0.5, smoothing: 1}
  wheel: {type: contact, body: b5, at: [0.1, 0, 0.2], shape: {wheel: {radius: 3 m, axis: y}}, plane: {normal: z, of: b2}, stiffness: 30, damping: 0.2, tyre: {longitudinal: {linear: 10}, lateral: {linear: 5}}, smoothing: 1}
"""


def forces(made: System) -> np.ndarray:
    """Q, V and the power at three states."""
    rng = np.random.default_rng(5)
    values = ca.vertcat(made.Q, made.V, made.power)
    at = ca.Function("Q", [made.t, made.q, made.v, made.p], [values])
    q = rng.normal(size=(3, made.q.numel()))
    q[:, :4] /= np.linalg.norm(q[:, :4], axis=1)[:, None]
    v = rng.normal(size=(3, made.v.numel()))
    p = np.array(made.parameters, dtype=float)
    return np.array([at(0.3, a, b, p).full().ravel() for a, b in zip(q, v)])


def derived(loads: str, bodies: str = "", joints: str = "") -> System:
    text = CHAIN.replace("BODIES", bodies).replace("JOINTS", joints)
    return system(load_text(text.replace("LOADS", loads)))


@pytest.mark.parametrize("line", FORCES.strip().splitlines(), ids=lambda x: x.split(":")[0].strip())
def test_forces_go_from_link_to_link(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Jᵀ f with the Jacobian of the point in the ground."""
    found = forces(derived(f"  {line.strip()}\n"))
    monkeypatch.setattr(scene, "DEEP", 99)
    expected = forces(derived(f"  {line.strip()}\n"))
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    "line", (TIES.rstrip() + TOUCHING).strip().splitlines(), ids=lambda x: x.split(":")[0].strip()
)
def test_ties_leave_out_what_carries_both(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with all points in the ground; the ball joint below feels nothing of it."""
    found = forces(derived(f"  {line.strip()}\n"))
    monkeypatch.setattr(Scene, "near", lambda self, *tips: self)
    expected = forces(derived(f"  {line.strip()}\n"))
    assert not found[:, :3].any()
    assert np.abs(expected[:, :-2]).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-11)


@pytest.mark.parametrize("line", FAR.strip().splitlines(), ids=lambda x: x.split(":")[0].strip())
def test_far_ties_go_from_link_to_link(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the ground and to another branch, as with the rates of what is between the points."""
    found = forces(derived(f"  {line.strip()}\n", BRANCH, OTHER_JOINTS))
    monkeypatch.setattr(scene, "DEEP", 99)
    expected = forces(derived(f"  {line.strip()}\n", BRANCH, OTHER_JOINTS))
    assert np.abs(expected[:, :-2]).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_contacts_of_every_link_cost_the_same_by_link() -> None:
    """Where velocities and forces were sums over the joints, twice the links took four times as
    much."""
    load = FAR.strip().splitlines()[4].replace("b5", '"b{i}"').replace("ball", '"l{i}"')
    few, many = (_operations(load, n) for n in (12, 24))
    assert many < 2.1 * few


def _operations(load: str, links: int) -> int:
    text = CHAIN.replace(f"1..{LINKS - 1}", f"1..{links - 1}").replace("paths:", "# paths:")
    made = system(
        load_text(text.replace("BODIES", "").replace("JOINTS", "").replace("LOADS", f"  {load}"))
    )
    return ca.Function("Q", [made.t, made.q, made.v, made.p], [made.Q]).n_instructions()
