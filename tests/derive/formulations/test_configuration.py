"""qdot, integrate, difference and normalise: the identities that define them, for every joint there
is.

Of derive.joints: ball, cylindrical, euler, fixed, free, planar, prismatic, revolute, screw, universal.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.configuration import configuration
from derive.model import load
from derive.states import system
from tests.scenes import MODELS

NAMES = ("free_body", "rolling_sphere", "universal_shaft", "snake3", "four_bar", "screw_press")


def functions(mechanics):
    p = np.array(mechanics.parameters)
    made = {request.name: request.function for request in configuration(mechanics)}

    def call(name, *parts):
        function = made[name]
        f = ca.Function(name, [function.x.symbols, mechanics.p], [function.result.value])
        return np.array(f(np.concatenate(parts), p)).ravel()

    return call


@pytest.fixture(params=NAMES)
def mechanics(request):
    return system(load(MODELS / f"{request.param}.yaml"))


def random_q(mechanics, rng):
    q = rng.normal(size=mechanics.q.numel())
    for i in mechanics.quaternions:
        q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
    return q


def test_difference_undoes_integrate(mechanics):
    call, rng = functions(mechanics), np.random.default_rng(1)
    for _ in range(10):
        q, d = random_q(mechanics, rng), rng.uniform(-1.5, 1.5, mechanics.v.numel())
        there = call("integrate", q, d)
        np.testing.assert_allclose(
            call("difference", q, there), d, atol=1e-12 * max(1.0, np.linalg.norm(there))
        )
        other = random_q(mechanics, rng)
        again = call("integrate", q, call("difference", q, other))
        for i in mechanics.quaternions:
            again[i : i + 4] *= np.sign(again[i : i + 4] @ other[i : i + 4])
        np.testing.assert_allclose(again, other, atol=1e-11)
    np.testing.assert_allclose(call("difference", q, q), 0.0, atol=1e-15)
    np.testing.assert_array_equal(call("integrate", q, 0 * d), q)


def test_integrate_starts_along_qdot(mechanics):
    call, rng = functions(mechanics), np.random.default_rng(2)
    q, v, h = random_q(mechanics, rng), rng.normal(size=mechanics.v.numel()), 1e-5
    slope = (call("integrate", q, h * v) - call("integrate", q, -h * v)) / (2 * h)
    np.testing.assert_allclose(slope, call("qdot", q, v), atol=1e-8)


def test_integrate_composes_turns_about_one_axis():
    mechanics = system(load(MODELS / "free_body.yaml"))
    call, rng = functions(mechanics), np.random.default_rng(3)
    (i,) = mechanics.quaternions
    q, d = random_q(mechanics, rng), rng.normal(size=mechanics.v.numel())
    twice = call("integrate", call("integrate", q, d), d)
    np.testing.assert_allclose(twice[i : i + 4], call("integrate", q, 2 * d)[i : i + 4], atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(twice[i : i + 4]), 1.0, atol=1e-15)


def test_normalise_keeps_directions():
    mechanics = system(load(MODELS / "free_body.yaml"))
    call, rng = functions(mechanics), np.random.default_rng(4)
    (i,) = mechanics.quaternions
    q = random_q(mechanics, rng)
    long = q.copy()
    long[i : i + 4] *= 3.0
    np.testing.assert_allclose(call("normalise", long), q, atol=1e-15)


def test_modules_have_them_where_coordinates_are_no_integrals_of_v():
    def default(name):
        return {
            function.name for function in equations(system(load(MODELS / f"{name}.yaml"))).functions
        }

    assert {"qdot", "integrate", "difference", "normalise"} <= default("free_body")
    assert not {"qdot", "integrate", "difference", "normalise"} & default("four_bar")
    requests = {
        request.name for request in equations(system(load(MODELS / "four_bar.yaml"))).requests
    }
    assert {"qdot", "integrate", "difference"} <= requests
