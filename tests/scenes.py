"""Models that several tests share."""

import functools
from pathlib import Path

from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model import load, load_text
from derive.model.records import Model
from derive.states import system

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"

# The forward speed follows from the turning rates except where the handlebar is straight, a = 0,
# which it swings through once a second.
RACER = """
model: racer
plane: xy
parameters: {l1: 0.4 m, l2: 0.15 m}
bodies:
  seat: {mass: 10 kg, com: [0.05, 0], inertia: 0.5}
  bar: {mass: 0.3 kg, com: [-0.05, 0.0], inertia: 0.01}
joints:
  base: {type: planar, parent: ground, child: seat, coordinates: [x, y, th]}
  pivot: {type: revolute, parent: seat, child: bar, at: [[l1, 0], [l2, 0]], coordinate: a}
constraints:
  back: {type: no_slip, body: seat, direction: y}
  front: {type: no_slip, body: bar, direction: y}
loads:
  wiggle: {type: expression, joint: pivot, expression: (2 N*m)*sin((5 rad/s)*t) - (3 N*m)*a}
initial: {a: 10 deg, base.vx: 0.3 m/s}
"""
SPATIAL_CHAIN = """
model: spatial_chain
gravity: [0.5, -1 m/s^2, -9.81 m/s^2]
parameters: {l: 0.4 m, m: 1.3 kg, d: 0.2 m}
bodies:
  a: {mass: m, com: [0.1 m, l/3, -0.05 m], inertia: [0.02, 0.03, 0.04, 0.002, -0.003, 0.001]}
  b: {mass: 2*m, com: [0, 0.07 m, 0.2 m], inertia: [0.05, 0.03, 0.06, 0.001, 0.002, -0.004]}
  c: {mass: 0.7 kg, com: [d, 0, 0.03 m], inertia: [0.01, 0.012, 0.013, 0, 0.001, 0]}
joints:
  A: {type: revolute, parent: ground, child: a, at: [0.1 m, 0, 0.2 m], axis: [1, 2, 2], coordinate: q1}
  B: {type: prismatic, parent: a, child: b, at: [[0, l, 0], [0.1 m, 0, 0]], axis: [0.6, 0, 0.8], coordinate: s}
  C: {type: revolute, parent: b, child: c, at: [[0, l, 0], [0.05 m, 0.02 m, 0]], axis: y, coordinate: q3}
"""


@functools.cache
def mechanics(name: str) -> System:
    """Of a model in models/."""
    return system(load(MODELS / f"{name}.yaml"))


@functools.cache
def derived(
    name: str, choice: str | None = None, formulation: str = "quasi_velocities"
) -> Equations:
    """Equations that several tests look at, derived once."""
    return equations(mechanics(name), choice, formulation)


def equations_of_text(text: str) -> Equations:
    """Of a model that stands in a test."""
    return equations(system(load_text(text)), None, "quasi_velocities")


def is_tree(model: Model) -> bool:
    """Joints alone: neither loops nor constraints, and no coordinates of the analytic form."""
    return not (model.closures or model.constraints or model.kinetic)
