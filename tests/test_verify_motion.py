"""The rungs that run a module: sound ones are green, and each goes red for what it is there for."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from derive.formulations import equations
from derive.mechanics import system
from derive.model import load, load_text
from hamel.pipeline import temporary_module
from hamel.verify.checks import RUNGS
from hamel.verify.evidence import graph
from hamel.verify.ladder import evidence
from hamel.verify.planted import wrong_functions
from hamel.verify.reference import reference

MODELS = Path(__file__).parent.parent / "models"
TOLERANCES = {rung.name: rung.tolerance for rung in RUNGS}
MOTION = ("simulate", "order of the integrator", "work = Δ(T + V)", "there and back")
DAMPED = """
model: damped
gravity: [0, 0, -9.81 m/s^2]
bodies: {bob: {mass: 1 kg, com: [0, 0, -0.5 m], inertia: [0.1, 0.1, 0.1]}}
joints: {pin: {type: revolute, parent: ground, child: bob, axis: x, coordinate: q, damper: 0.1 N*m*s/rad}}
"""


def value(seen, name):
    return next(rung for rung in RUNGS if rung.name == name).error(seen)


def is_red(seen, name):
    return not value(seen, name) <= TOLERANCES[name]


@pytest.fixture(scope="module", params=["free_body", "four_bar"])
def seen(request):
    model = load(MODELS / f"{request.param}.yaml")
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        yield evidence(reference(model), chosen, module, 6)


@pytest.fixture(scope="module")
def free():
    """Motions that can be turned round."""
    model = load(MODELS / "free_body.yaml")
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        yield evidence(reference(model), chosen, module, 6)


def with_simulate(seen, change):
    """The same evidence, the end of every motion changed: `change` is given x, the work and the step asked for."""

    def simulate(times, x, u, p, **by):
        found = seen.module.simulate(times, x, u, p, **by)
        end, work = change(np.array(found.x), np.array(found.work), by["step_size"] or 0.0)
        return SimpleNamespace(x=end, work=work)

    module = SimpleNamespace(simulate=simulate, integrators=seen.module.integrators, defaults=seen.module.defaults)
    return replace(seen, module=module)


def test_sound_motions_are_green(seen):
    found = {name: value(seen, name) for name in MOTION}
    assert all(error is None or error <= TOLERANCES[name] for name, error in found.items()), found
    assert found["simulate"] is not None and found["work = Δ(T + V)"] is not None


def test_an_end_that_is_off_is_caught(seen):
    assert is_red(with_simulate(seen, lambda x, work, h: (x * (1 + 1e-6), work, h)[:2]), "simulate")


def test_work_that_is_off_is_caught(seen):
    assert is_red(with_simulate(seen, lambda x, work, h: (x, work + 1e-6)), "work = Δ(T + V)")


def test_an_integrator_of_lower_order_is_caught(free):
    assert not is_red(free, "order of the integrator")
    for power in (1, 3, 5):
        wrong = with_simulate(free, lambda x, work, h, k=power: (x * (1 + 1e-2 * h**k), work))
        assert is_red(wrong, "order of the integrator"), power


def test_a_motion_that_does_not_come_back_is_caught(free):
    assert not is_red(free, "there and back")

    def slowed(x, work, h):
        x[-1, -6:] *= 1 - 1e-6
        return x, work

    assert is_red(with_simulate(free, slowed), "there and back")


def test_a_motion_that_cannot_come_back_is_not_asked_to():
    model = load_text(DAMPED)
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        assert value(evidence(reference(model), chosen, module, 4), "there and back") is None


def test_code_that_is_wrong_without_optimisation_is_caught(free):
    assert not is_red(free, "-O0 = graph")
    _, wrong = next(iter(wrong_functions(free.graph.equations, "dynamics")))
    assert is_red(replace(free, graph=graph(wrong)), "-O0 = graph")


def test_numbers_that_come_of_none_are_caught(free):
    name = "no number from none"
    assert value(free, name) == 0

    def hidden(*place):
        return np.nan_to_num(free.graph("dynamics", *place))

    def shown(*place):
        return free.graph("dynamics", *place)

    for wrong in (hidden, shown):
        module = SimpleNamespace(__name__="made_for_test_of_numbers", dynamics=wrong, defaults=free.module.defaults)
        assert value(replace(free, module=module), name) > 0
