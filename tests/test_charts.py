"""Choices of quasi-velocities that take over from each other where one is singular."""

import json
from contextlib import ExitStack

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.mechanics import system
from derive.mechanics.initial import initial_state
from derive.model import load_text
from hamel import charts
from hamel.motion import Stepping
from hamel.pipeline import temporary_module
from tests.scenes import MODELS

SLIDER_CRANK = MODELS / "slider_crank.yaml"
TIMES = np.linspace(0.0, 3.0, 3001)
BY = Stepping("dop853", "projection", None, 1e-11, 1e-13)


@pytest.fixture(scope="module")
def motions():
    """The slider's speed fails at the dead centres, the rod's turning rate half way between: neither can go on alone."""
    text = SLIDER_CRANK.read_text().replace("  slider: [der(s)]", "  slider: [der(s)]\n  rod: [der(q1) + der(q2)]")
    mechanics = system(load_text(text))
    start = initial_state(mechanics)
    u, p = np.zeros(mechanics.u.numel()), np.array(mechanics.parameters)
    with ExitStack() as stack:

        def chart(name):
            found = equations(mechanics, name)
            return charts.chart(found, stack.enter_context(temporary_module(found, (BY.integrator,), (BY.keeping,))))

        def followed(*names):
            return charts.followed([chart(name) for name in names], TIMES, start.q, start.v, u, p, BY, None)

        yield followed


def test_two_charts_go_where_neither_goes_alone(motions):
    found, whole = motions("slider", "rod"), motions("crank")
    assert not whole.switches
    assert len(found.switches) >= 4 and {switch.entered for switch in found.switches} == {"slider", "rod"}
    np.testing.assert_array_equal(found.t, TIMES)
    for name, values in whole.q.items():
        np.testing.assert_allclose(found.q[name], values, atol=1e-8)
    for name, values in whole.v.items():
        np.testing.assert_allclose(found.v[name], values, atol=1e-6)
    np.testing.assert_allclose(found.work, whole.work, atol=1e-8)
    assert found.energy_balance < 1e-8 and max(found.slip) < 1e-11


def test_quasi_velocities_are_those_of_the_first_chart(motions):
    found = motions("slider", "rod")
    np.testing.assert_allclose(found.w["s_dot"], found.v["der(s)"], atol=1e-9)


def test_one_chart_alone_says_that_it_is_lost(motions):
    with pytest.raises(AssumptionError, match="no choice of quasi-velocities goes on"):
        motions("slider")


def test_simulate_goes_through_and_says_so(tmp_path):
    found = hamel.simulate(SLIDER_CRANK, choice="slider", time=1.0)
    same = hamel.simulate(SLIDER_CRANK, choice="crank", time=1.0)
    assert found.switches and not same.switches and found.choice == "slider"
    for name in ("q1", "q2", "s"):
        assert found.final[name] == pytest.approx(same.final[name], abs=1e-8)
    assert json.dumps(hamel.records.as_json(found))
