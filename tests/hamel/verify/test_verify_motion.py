"""The checks that run a module: sound ones are green, and each goes red for what it is there
for."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hamel
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load, load_text
from derive.states import system
from hamel.build.module import temporary_module
from hamel.verify.checks import CHECKS, momenta
from hamel.verify.mutation.errors import wrong_functions
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence
from tests.scenes import MODELS

TOLERANCES = {check.name: check.tolerance for check in CHECKS}
MOTION = ("simulate", "order of the integrator", "work = Δ(T₂ − T₀ + V)", "there and back")
DAMPED = """
model: damped
gravity: [0, 0, -9.81 m/s^2]
bodies: {bob: {mass: 1 kg, com: [0, 0, -0.5 m], inertia: [0.1, 0.1, 0.1]}}
joints: {pin: {type: revolute, parent: ground, child: bob, axis: x, coordinate: q, damper: 0.1 N*m*s/rad}}
"""
PERIODIC = """
loads: {motor: {type: expression, joint: pin, expression: "(2 N*m)*sin(2*pi*(1 Hz)*t)"}}
"""


def value(seen, name):
    return next(check for check in CHECKS if check.name == name).error(seen)


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
    """The same evidence, the end of every motion changed: `change` is given x, the work and the
    step asked for."""

    def simulate(times, x, u, p, **by):
        found = seen.module.simulate(times, x, u, p, **by)
        end, work = change(np.array(found.x), np.array(found.work), by["step_size"] or 0.0)
        return SimpleNamespace(x=end, work=work)

    module = SimpleNamespace(
        simulate=simulate, integrators=seen.module.integrators, defaults=seen.module.defaults
    )
    return replace(seen, module=module)


def test_sound_motions_are_green(seen):
    found = {name: value(seen, name) for name in MOTION}
    assert all(error is None or error <= TOLERANCES[name] for name, error in found.items()), found
    assert found["simulate"] is not None and found["work = Δ(T₂ − T₀ + V)"] is not None


def test_an_end_that_is_off_is_caught(seen):
    assert is_red(with_simulate(seen, lambda x, work, h: (x * (1 + 1e-6), work, h)[:2]), "simulate")


@pytest.mark.parametrize(
    "name, kept",
    [("free_body", 6), ("extremes/heavy_top", 1), ("extremes/tumbling", 3), ("four_bar", 0)],
)
def test_momenta_that_nothing_changes_are_found_and_their_change_is_caught(name, kept):
    """All six of a free body; about the vertical of a top; about its centre of a body without
    gravity; none of a linkage."""
    model = load(MODELS / f"{name}.yaml")
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        whole = evidence(reference(model), chosen, module, 8)
        assert len(momenta.kept_screws(whole)) == kept
        assert (value(whole, "momenta") is None) == (kept == 0)
        if kept:
            assert not is_red(whole, "momenta")
            assert is_red(
                with_simulate(whole, lambda x, work, h: (x * (1 + 1e-5), work)), "momenta"
            )


def test_work_that_is_off_is_caught(seen):
    assert is_red(with_simulate(seen, lambda x, work, h: (x, work + 1e-6)), "work = Δ(T₂ − T₀ + V)")


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


def test_a_load_whose_period_is_the_unit_of_time_is_not_asked_to_come_back():
    """Unlike the same bar without it."""
    driven = DAMPED.replace("0.1 N*m*s/rad", "0") + PERIODIC
    for text, asked in ((driven, False), (DAMPED.replace("0.1 N*m*s/rad", "0"), True)):
        model = load_text(text)
        chosen = equations(system(model))
        with temporary_module(chosen) as module:
            error = value(evidence(reference(model), chosen, module, 4), "there and back")
        assert (error is not None) == asked


def test_code_that_is_wrong_without_optimisation_is_caught(free):
    assert not is_red(free, "-O0 = graph")
    _, wrong = next(iter(wrong_functions(free.graph.equations, "dynamics")))
    assert is_red(replace(free, graph=evaluator(wrong)), "-O0 = graph")


def test_numbers_that_come_of_none_are_caught(free):
    name = "no number from none"
    assert value(free, name) == 0

    def hidden(*place):
        return np.nan_to_num(free.graph("dynamics", *place))

    def shown(*place):
        return free.graph("dynamics", *place)

    for wrong in (hidden, shown):
        module = SimpleNamespace(
            __name__="made_for_test_of_numbers", dynamics=wrong, defaults=free.module.defaults
        )
        assert value(replace(free, module=module), name) > 0


CANCELS = """
model: cancels
coordinates: {x: m, y: m}
parameters: {mass: 2 kg}
kinetic: mass/2*(der(x)^2 + der(y)^2)
potential: 0 J
constraints: {curve: {holonomic: "x - 0.3 m*sin((2 rad/s)*t) + y^2/(2 m)"}}
"""


def test_what_cancels_may_be_no_number():
    """mass/mass is one in the code and not a number in the graph; a parameter that matters must not
    be passed over like that."""
    model = load_text(CANCELS)
    chosen = equations(system(model), "orthonormal")
    name = "no number from none"
    with temporary_module(chosen) as module:
        whole = evidence(reference(model), chosen, module, 2)
        assert value(whole, name) == 0

        def heedless(t, x, u, p):
            return module.energy(t, x, u, np.nan_to_num(p, nan=2.0, posinf=2.0, neginf=2.0))

        wrong = SimpleNamespace(
            __name__="made_for_test_of_masses", energy=heedless, defaults=module.defaults
        )
        assert value(replace(whole, module=wrong), name) > 0


CRANE = """
model: crane
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {l: 2 m}
bodies:
  trolley: {mass: 50 kg}
  rod: {mass: 1 kg, com: [0, -l/2], inertia: 1 kg*m^2}
  hook: {mass: 8 kg}
joints:
  rail: {type: prismatic, parent: ground, child: trolley, axis: x, coordinate: s}
  top: {type: revolute, parent: trolley, child: rod, coordinate: th}
  fall: {type: point, parent: ground, child: hook, coordinates: [hx, hz]}
closures: {pin: {type: revolute, between: [rod, hook], at: [[0, -l], [0, 0]]}}
constraints:
  drive:
    type: prescribed
    joint: rail
    motion: "(1 m)*sin((1.5 rad/s)*t)^2*step(t - 0.5 s, 0.1 s)"
states: {meas: {rate: "(length(str) - meas)/(0.2 s)", initial: 2 m}}
paths: {str: [{body: ground, at: [1, -1]}, {body: hook}]}
loads:
  band: {type: tension, path: str, tension: "(30 N/m)*(length(str) - 0.5*meas)"}
  rub:
    type: friction
    joint: top
    viscous: 0.1
    coulomb: "0.02 m*abs(reaction.pin.z)"
    smoothing: 0.05 rad/s
initial: {th: 10 deg, guess: {hz: -2 m, hx: 0.3 m}}
"""


def test_a_reaction_that_turns_in_abs_is_another_piece():
    """No end is compared along such motions, and three say too little about the order."""
    model = load_text(CRANE)
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        found = evidence(reference(model), chosen, module, 5, 0)
        for name in ("simulate", "order of the integrator"):
            error = value(found, name)
            assert error is None or error <= TOLERANCES[name], name


THIN = """
model: thin
plane: xy
tables:
  motor: {points: [[0, 2], [5, 1.8], [10, 1], [20, 0]], units: [m/s, N], smooth: C1}
  spring: {points: [[-1, -3], [-0.3, -0.5], [0, 0], [0.4, 1], [1, 4]], units: [m, N], smooth: C2}
bodies: {slider: {mass: 1 kg}}
joints: {rail: {type: prismatic, parent: ground, child: slider, axis: x, coordinate: x}}
inputs: {F: {joint: rail}}
loads:
  drive: {type: expression, joint: rail, expression: motor(der(x))}
  sp: {type: expression, joint: rail, expression: -spring(x)}
  fr: {type: friction, joint: rail, viscous: 0.1 N*s/m, coulomb: 0.3 N, smoothing: 1 cm/s}
initial: {der(x): 1 m/s}
"""


@pytest.mark.slow
def test_the_reference_does_not_go_over_thin_layers(tmp_path: Path) -> None:
    """One extrapolated step ended where dry friction begins to turn, 8.6e-8 off and sure of
    3e-13."""
    path = tmp_path / "thin.yaml"
    path.write_text(THIN)
    assert hamel.verify(path, states=7, seed=3).passed
