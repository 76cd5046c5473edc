"""Ropes are drawn as long as they are.

Of hamel.draw.mechanism: ropes.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.expressions.tree import ZERO
from derive.model import load, load_text
from derive.states import system
from hamel.draw.mechanism import figure
from hamel.draw.mechanism.figure import framed
from hamel.draw.mechanism.ropes import rope_shapes
from hamel.draw.mechanism.state import configuration
from tests.scenes import MODELS

PLANE = """
model: plane
plane: PLANE
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: planar, parent: ground, child: A, coordinates: [u, w, a]}}
paths:
  p:
    - {body: ground, at: [1, -0.3]}
    - {body: ground, at: [0, 0], pulley: {radius: 0.4, side: SIDE}}
    - {body: A, at: [0.1, 0]}
loads: {k: {type: tension, path: p, tension: 3 N}}
initial: {u: -1 m, w: 0.2 m, a: 0.7 rad}
outputs: {o: length(p)}
"""
SPACE = """
model: space
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: free, parent: ground, child: A, position: [x, y, z]}}
paths:
  p:
    - {body: ground, at: [1, -0.3, 0.1]}
    - {body: ground, at: [0.1, 0, 0], pulley: {radius: 0.4, side: left, axis: [0.2, 0, 1]}}
    - {body: A, at: [0, 0.1, 0]}
    - {body: ground, at: [-1, 2, 0]}
loads: {k: {type: tension, path: p, tension: 3 N}}
initial: {x: -1 m, y: 0.2 m, z: 0.6 m}
outputs: {o: length(p)}
"""


def ends_of(scene, path):
    """In the ground."""
    ways = [way for way in path.points if way.radius == ZERO]
    return [scene.pose(scene.index(x.body)).point(scene.numbers.vector(x.point)) for x in ways]


@pytest.mark.parametrize(
    "text",
    [
        *(
            PLANE.replace("SIDE", s).replace("PLANE", p)
            for s in ("left", "right")
            for p in ("xy", "xz")
        ),
        SPACE,
    ],
    ids=["left", "left, xz", "right", "right, xz", "space"],
)
def test_what_is_drawn_is_as_long_as_the_path(text):
    mechanics = system(load_text(text))
    state = configuration(mechanics)
    scene = framed(mechanics, state)
    drawn = [
        np.array([scene.place(x) for x in shape.spots])
        for shape in rope_shapes(scene)
        if shape.style == "rope"
    ]
    corners = np.array([points[k] for points in drawn for k in (0, -1)])
    for end in ends_of(scene, mechanics.model.paths[0]):
        assert np.linalg.norm(corners - end, axis=1).min() < 1e-12
    length = sum(np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in drawn)
    (_, value, _), *_ = mechanics.outputs
    wanted = float(ca.Function("length", [mechanics.q, mechanics.p], [value])(state.q, state.p))
    assert length == pytest.approx(wanted, rel=2e-3)  # arcs are drawn as chords
    assert length < wanted + 1e-12


def ropes(mechanics):
    return [mark for mark in figure(mechanics).marks if mark.style == "rope"]


@pytest.mark.parametrize(
    ("name", "count"), [("cable_robot", 4), ("crane_over_boom", 3), ("bungee", 1)]
)
def test_ropes_of_tensions_and_of_constraints_are_drawn(name, count):
    assert len(ropes(system(load(MODELS / "gallery" / f"{name}.yaml")))) == count


def test_an_end_within_its_pulley_is_drawn_straight():
    text = PLANE.replace("SIDE", "left").replace("PLANE", "xy").replace("-1 m", "-0.1 m")
    marks = ropes(system(load_text(text)))
    assert len(marks) == 2 and np.isfinite([mark.points for mark in marks]).all()
