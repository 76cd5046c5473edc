"""Components of forces, torques and wrenches along the axes of any body, joint or frame.

Of derive.mechanics.loads: force, torque, wrench, records.
"""

import math

import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.evaluate import Evaluator, evaluator
from derive.model import load_text
from derive.states import system

ARM = """
model: arm
bodies:
  a: {mass: 1 kg, com: [0.1, 0.2, 0], inertia: [0.02, 0.03, 0.04]}
  b: {mass: 2 kg, com: [0, 0.2, 0.1], inertia: [0.05, 0.03, 0.04]}
  c: {mass: 0}
joints:
  p: {type: ball, parent: ground, child: a}
  q: {type: ball, parent: a, child: b, at: [[0.3, 0, 0], [0, 0, 0.1]]}
  w: {type: fixed, parent: ground, child: c, rpy: [0, 40 deg, 0]}
frames: {tool: {body: b, position: [0.1, 0, 0], rpy: [0, 30 deg, 0]}}
loads: {f: LOAD}
"""
C, S = math.cos(math.radians(40)), math.sin(math.radians(40))
c, s = math.cos(math.radians(30)), math.sin(math.radians(30))


def rates(load: str) -> np.ndarray:
    mechanics: Evaluator = evaluator(equations(system(load_text(ARM.replace("LOAD", load)))))
    x = np.random.default_rng(2).normal(size=len(mechanics.equations.argument("x").labels))
    for start in mechanics.equations.system.quaternions:
        x[start : start + 4] /= np.linalg.norm(x[start : start + 4])
    return np.ravel(np.array(mechanics("dynamics", 0.0, x, [], [])))


@pytest.mark.parametrize(
    ("along", "same"),
    [
        (  # what is fixed to the ground
            "{type: force, body: a, at: [1, 2, 3], components: [1, 2, 3], frame: c}",
            f"{{type: force, body: a, at: [1, 2, 3], components: [{C + 3 * S}, 2, {3 * C - S}]}}",
        ),
        (  # what is fixed to the body
            "{type: torque, body: b, components: [1, 2, 3], frame: tool}",
            f"{{type: torque, body: b, components: [{c + 3 * s}, 2, {3 * c - s}], frame: body}}",
        ),
        (
            "{type: torque, body: b, components: [1, 2, 3], frame: q}",
            "{type: torque, body: b, components: [1, 2, 3], frame: body}",
        ),
        (
            "{type: wrench, frame: tool, force: [1, 2, 3], moment: [3, 1, 2], axes: tool}",
            "{type: wrench, frame: tool, force: [1, 2, 3], moment: [3, 1, 2], axes: frame}",
        ),
        (  # another body's
            "{type: wrench, frame: b, force: [1, 2, 3], axes: a}",
            "{type: force, body: b, components: [1, 2, 3], frame: a}",
        ),
        (
            "{type: force, body: b, components: [1, 2, 3], frame: a}",
            "{type: force, body: b, components: ["
            + ", ".join(
                f'"(direction(a, x).{k} + 2*direction(a, y).{k} + 3*direction(a, z).{k})*(1 N)"'
                for k in "xyz"
            )
            + "]}",
        ),
    ],
)
def test_components_are_along_the_axes_that_are_named(along: str, same: str) -> None:
    np.testing.assert_allclose(rates(along), rates(same), rtol=1e-11, atol=1e-11)
    assert np.abs(rates(along) - rates("{type: force, body: a, components: [0, 0, 0]}")).max() > 0.1
