"""Many initial states at once are those of one at a time.

Of derive.states: many.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.mechanics.records import System
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.many import least_many, least_of_bodies, starter

PENDULUM = """
model: rod
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 1 kg, l: 1 m}
bodies: {rod: {mass: m, com: [0, -l/2], inertia: m*l**2/12}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
initial: {q: 30 deg, der(q): 0.1 rad/s}
"""


def varied(s: System, names: tuple[str, ...], count: int) -> tuple[dict, np.ndarray]:
    rng = np.random.default_rng(1)
    p = np.tile(s.parameters, (count, 1)) * (1 + 0.03 * rng.standard_normal((count, s.p.numel())))
    return {name: 0.3 + 0.2 * rng.standard_normal(count) for name in names}, p


@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("four_bar", ("q1", "der(q1)")),
        ("snake3", ("phi1", "base.vx")),
        ("cart_pole", ("th",)),
        ("extremes/scale_micrometre", ()),
        ("bicycle", ("lean", "der(rear_spin)")),
        ("snake3", ("phi1", "head.v", "om")),
    ],
)
def test_many_starts_are_those_of_one_at_a_time(model: str, names: tuple[str, ...]) -> None:
    s = system(load(f"models/{model}.yaml"))
    values, p = varied(s, names, 6)
    found = pickle.loads(pickle.dumps(starter(s, names)))(values, p)
    for k in range(len(p)):
        one = initial_state(s, {name: x[k] for name, x in values.items()}, p[k])
        size = 1 + max(np.abs(one.q).max(), np.abs(one.v).max())
        assert found.closed[k] and found.moved[k] == bool(one.moved)
        assert np.abs(one.q - found.q[k]).max() <= 1e-9 * size
        assert np.abs(one.v - found.v[k]).max() <= 1e-9 * size


CRANK_ROCKER = """
model: crank_rocker
plane: xy
bodies:
  crank: {mass: 1 kg, com: [0.05, 0], inertia: 0.002}
  coupler: {mass: 2 kg, com: [0.2, 0], inertia: 0.03}
  rocker: {mass: 1.5 kg, com: [0.15, 0], inertia: 0.03}
joints:
  A: {type: revolute, parent: ground, child: crank}
  B: {type: revolute, parent: crank, child: coupler, at: [0.1, 0]}
  D: {type: revolute, parent: ground, child: rocker, at: [0.4, 0]}
closures:
  C: {type: revolute, between: [coupler, rocker], at: [[0.4, 0], [0.3, 0]]}
initial: {A: 264 deg, guess: {B: -30 deg, D: 80 deg}}
"""


def test_a_crank_is_held_at_every_angle_from_one_guess() -> None:
    """At 14 of 45 angles it was given up, or others went round several times."""
    s = system(load_text(CRANK_ROCKER))
    cranks = np.radians(np.arange(0.0, 360.0, 8.0))
    found = starter(s, ("A",))({"A": cranks}, np.zeros((len(cranks), 0)))
    assert found.closed.all() and not found.moved.any()
    for k, crank in enumerate(cranks):
        one = initial_state(s, {"A": crank})
        assert not one.moved and one.q[0] == pytest.approx(crank)
        assert np.abs(one.q[1:] - np.radians([-30.0, 80.0])).max() < 2.0 * np.pi
        assert np.abs(one.q - found.q[k]).max() < 1e-9


def test_what_cannot_be_assembled_is_told_and_harms_no_other() -> None:
    s = system(load("models/four_bar.yaml"))
    p = np.tile(s.parameters, (3, 1))
    p[1, [x.name for x in s.model.parameters].index("l4")] = 5.0
    found = starter(s, ())({}, p)
    assert found.closed.tolist() == [True, False, True]
    assert (found.q[0] == found.q[2]).all()


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ModelError, match="'nothing' is no initial value"):
        starter(system(load_text(PENDULUM)), ["nothing"])


def test_masses_and_inertias_of_parameters() -> None:
    s = system(load_text(PENDULUM))
    bodies = least_of_bodies(s)(np.array([[1.0, -1.0], [1.0, 1.0]])).full()
    assert bodies[:, 0].min() >= 0 > bodies[:, 1].min()


def test_least_squares_with_rows_that_repeat() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 3, 5))
    A[2, 2] = A[2, 0]
    b = np.einsum("kij,kj->ki", A, rng.standard_normal((4, 5)))
    wanted = [np.linalg.lstsq(A[k], b[k], rcond=1e-10)[0] for k in range(4)]
    found = least_many(A.transpose(1, 2, 0), b.T).T
    assert np.abs(found - wanted).max() < 1e-11


@pytest.mark.parametrize("rows", [1, 7, 24])
def test_what_comes_of_a_motion_does_not_depend_on_its_neighbours(rows: int) -> None:
    """To the last bit, alone or among others; and squares that lost too many digits are not
    trusted."""
    rng = np.random.default_rng(3)
    A, b = rng.standard_normal((rows, 30, 40)), rng.standard_normal((rows, 40))
    A[-1, :, 7] = A[0, :, 7] + 1e-9 * A[-1, :, 7] * (rows > 1)
    found = least_many(A, b)
    for k in (0, 7, 39):
        assert (least_many(A[..., k : k + 1], b[:, k : k + 1])[:, 0] == found[:, k]).all()
        wanted = np.linalg.lstsq(A[..., k], b[:, k], rcond=1e-10)[0]
        off = np.abs(found[:, k] - wanted).max() / np.abs(wanted).max()
        assert off < (1e-6 if k == 7 else 1e-12)
