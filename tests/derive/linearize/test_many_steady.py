"""Steady motions found all at once are those found one after the other.

Of derive.linearize: many, together.
"""

from __future__ import annotations

import numpy as np

from derive.formulations import equations
from derive.formulations.frames import based
from derive.linearize.many import steady_motions
from derive.linearize.minimal import with_linearization
from derive.linearize.steady import motion_of
from derive.linearize.study import study
from derive.model import load_text
from derive.states import system

GOVERNOR = """
model: governor
gravity: [0, 0, -9.81 m/s^2]
parameters: {l: 1 m, m: 1 kg, J: 0.1 kg*m^2, k: 1 N*m/rad}
bodies:
  shaft: {mass: 1 kg, inertia: [J, J, J]}
  arm: {mass: m, com: [0, 0, -l], inertia: [1e-3, 1e-3, 1e-3]}
joints:
  drive: {type: revolute, parent: ground, child: shaft, axis: z, coordinate: a}
  hinge: {type: revolute, parent: shaft, child: arm, axis: y, coordinate: q, spring: {stiffness: k, rest: 0.5 rad}, damper: 0.1}
steady_motion:
  turning: {der(a): rate, der(q): 0, guess: {q: 0.3}, sweep: {rate: [0.5, 2]}}
initial: {a: 0 rad, q: 0.3 rad, der(a): 1 rad/s}
"""


def test_all_at_once_is_one_after_the_other() -> None:
    """The arm's angle is a curved function of rate and stiffness, so that Newton has to work; and
    what comes of a row does not depend on the others."""
    formed = with_linearization(equations(system(load_text(GOVERNOR)), None, charts=True))
    formed = based(formed)
    found = study(formed, motion_of(formed, None), {"rate": 1.0})
    rng = np.random.default_rng(0)
    values = {"rate": rng.uniform(0.5, 2.0, 40), "k": rng.uniform(0.5, 3.0, 40)}
    motions, steady = steady_motions(found, values)
    assert steady.all() and np.ptp(motions.x[:, 1]) > 0.05
    for k in range(0, 40, 8):
        one = found.motions({name: column[k : k + 1] for name, column in values.items()})
        assert np.abs(one.x[0] - motions.x[k]).max() < 1e-9
    part, _ = steady_motions(found, {name: column[7:12] for name, column in values.items()})
    assert (part.x == motions.x[7:12]).all()
