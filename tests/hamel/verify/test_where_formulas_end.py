"""Checks where formulas have no value, or bend within a length that differences step across.

Of hamel.verify.checks: quasi, linear, steps, kinks, identities.
Of hamel.verify.reference: outcome, loads.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load_text
from derive.states import system
from hamel.verify.checks import identities, linear, quasi
from hamel.verify.checks.check import Check
from hamel.verify.checks.evidence import Evidence
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

# at rest the slip of the tyre is 0/0, in a load and in a definition
TYRE = """
model: tyre
plane: xy
gravity: [2 m/s^2, -9.81 m/s^2]
parameters: {C: 60 N}
bodies: {cart: {mass: 3 kg, com: [0.1 m, 0], inertia: 0.4}, rod: {mass: 1 kg, com: [0.3 m, 0], inertia: 0.1}}
joints:
  base: {type: planar, parent: ground, child: cart, coordinates: [x, y, yaw]}
  pin: {type: revolute, parent: cart, child: rod, at: [0.2 m, 0], coordinate: bend}
where:
  ahead: "dot(velocity(rod), direction(rod, x))"
  slip: "atan(dot(velocity(rod), direction(rod, y))/ahead)"
  weightless: bend/der(bend)
loads: {side: {type: force, body: rod, components: [0, -C*slip], frame: body}}
initial: {base.vx: 1 m/s}
"""
# a rope that slackens over 50 micrometres
ROPE = """
model: rope
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {k: 2e4 N/m}
bodies: {slide: {mass: 1 kg}, load: {mass: 5 kg}}
joints:
  along: {type: prismatic, parent: ground, child: slide, axis: x, coordinate: x}
  up: {type: prismatic, parent: slide, child: load, axis: z, coordinate: z}
where: {length: "sqrt(x^2 + z^2)", pull: "ramp(k*(length - 1 m), 1 N)/length"}
inputs: {push: {joint: along}}
loads:
  aside: {type: expression, joint: along, expression: -pull*x}
  hold: {type: expression, joint: up, expression: -pull*z}
initial: {x: 0.3 m, z: -0.95 m}
"""
# contacts after Hertz, which carry nothing most of the time, and a stream that runs dry
CONTACT = """
model: contact
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {k: 1e5 N/m^1.5, c: 1 kN, l: 1 m}
bodies: {ball: {mass: 1 kg, inertia: 0.01}}
joints: {fall: {type: prismatic, parent: ground, child: ball, axis: z, coordinate: z}}
where: {deep: "max(0.1 m - z, 0 m)"}
loads:
  floor: {type: expression, joint: fall, expression: "k*deep^1.5 + c*(deep/l)^1.3"}
  pull: {type: expression, joint: fall, expression: "-c*((1 + (z/l)^2)^-2.5)"}
  stream: {type: expression, joint: fall, expression: "c*sqrt(max(z - 2 m, 0 m)/l)"}
initial: {z: 0.3 m}
"""

BENT = """
model: bent
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {{l: 1 m}}
bodies: {{a: {{mass: 1 kg, inertia: 0.1}}, b: {{mass: 2 kg, com: [0.1 m, 0], inertia: 0.1}}}}
joints:
  P: {{type: prismatic, parent: ground, child: a, axis: x, coordinate: x}}
  R: {{type: revolute, parent: ground, child: b, coordinate: q}}
constraints: {{c: {{{row}}}}}
initial: {{q: 0.3, guess: {{x: 0.2 m}}}}
"""


def seen(text: str, *names: str) -> Evidence:
    model = load_text(text)
    found = equations(system(model))
    asked = tuple(found.request(name).function for name in names)
    full = replace(found, functions=(*found.functions, *asked))
    return evidence(reference(model), full, None, 10)


def verdicts(e: Evidence, checks: tuple[Check, ...]) -> dict[str, bool]:
    return {result.name: result.passed for result in results(e, checks)}


def test_forces_at_rest_do_not_need_what_has_no_value_at_rest() -> None:
    found = verdicts(seen(TYRE, "gravity_w", "coriolis_w"), quasi.CHECKS)
    assert found == {"gravity over w": True, "C w": True, "Ṁ_w = C + Cᵀ": True}


def test_rounding_of_a_sharp_bend_is_no_error() -> None:
    """… and an entry that is wrong by a thousandth still is one."""
    name, check = "jacobian_forward", "slopes of a product"
    e = seen(ROPE.replace("2e4", "2e6"), name)
    assert verdicts(e, linear.CHECKS)[check]
    known = e.graph.equations
    function = known.function(name)
    value = ca.SX(function.result.value)
    moving = [k for k in range(value.numel()) if not value[k].is_constant()]
    assert moving
    for k in moving:
        wrong = ca.SX(value)
        wrong[k] *= 1.001
        spoiled = replace(function, result=replace(function.result, value=wrong))
        functions = tuple(spoiled if f.name == name else f for f in known.functions)
        graph = evaluator(replace(known, functions=functions))
        assert not verdicts(replace(e, graph=graph), linear.CHECKS)[check]


@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
def test_steps_are_compared_over_a_length_that_does_not_cross_a_bend(tmp_path: Path) -> None:
    (tmp_path / "rope.yaml").write_text(ROPE)
    functions = ("default", "step", "step_sensitivity")
    assert hamel.build(tmp_path / "rope.yaml", out=tmp_path / "rope", functions=functions)


@pytest.mark.parametrize(
    "row",
    [
        'holonomic: "x/l - q*abs(q)"',
        'holonomic: "x/l - max(q, 0.1)"',
        'nonholonomic: "der(x)/l - sign(q)*der(q)"',
    ],
)
def test_constraints_with_a_bend(row: str) -> None:
    """Beside it the slope of a step is zero, in the equations and in the reference."""
    e = seen(BENT.format(row=row))
    found = [result for result in results(e) if not result.passed]
    assert found == []


def test_powers_of_nothing_are_no_doubt(tmp_path: Path) -> None:
    """Of what is exactly zero nothing is passed on, however steep the root is there."""
    file = tmp_path / "contact.yaml"
    file.write_text(CONTACT, "utf-8")
    built = hamel.build(file, out=tmp_path / "contact")
    module = hamel.load(built.folder)
    z = np.linspace(-0.3, 0.3, 64)
    rows = module.dynamics(0.0, np.stack([z, 0.0 * z], axis=-1))
    deep = np.maximum(0.1 - z, 0.0)
    wanted = 1e5 * deep**1.5 + 1e3 * deep**1.3 - 1e3 * (1.0 + z**2) ** -2.5 - 9.81
    np.testing.assert_allclose(rows[:, 1], wanted, rtol=1e-13)
    alone = [module.dynamics(0.0, [place, 0.0])[1] for place in z]
    np.testing.assert_allclose(rows[:, 1], alone, rtol=1e-14)
    text = (built.folder / "contact.c").read_text()
    assert "pow(" in text and "1.5)" not in text and "-2.5" not in text  # half powers are products


# a rope whose end is within its pulley, a constraint and an output that end beside the start
WRAPPED = """
model: wrapped
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: planar, parent: ground, child: A, coordinates: [x, y, a]}}
paths:
  p:
    - {body: ground, at: [1, -0.3]}
    - {body: ground, at: [0, 0], pulley: {radius: 0.4, side: left}}
    - {body: A}
loads: {k: {type: tension, path: p, tension: 3 N}}
initial: {x: -1 m, y: 0.2 m}
"""
LOGARITHM = """
model: logarithm
plane: xy
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: planar, parent: ground, child: A, coordinates: [x, y, a]}}
loads: {k: {type: expression, velocity: ja.vx, expression: "-(1 N)*acos(x/(1 m))*(x/(1 m))^1.5"}}
constraints: {c: {holonomic: "y - (1 m)*log(x/(0.1 m))"}}
initial: {x: 0.3 m, y: 1 m}
outputs: {o: "sqrt(x - 0.2 m)"}
"""


@pytest.mark.parametrize("text", [WRAPPED, LOGARITHM], ids=["wrapped", "logarithm"])
def test_states_where_nothing_has_a_value_are_no_motion_s(text: str) -> None:
    found = seen(text)
    assert len(found.samples) == 10
    assert all(np.isfinite(s.outcome.vdot).all() for s in found.samples)
    assert [check.name for check in results(found) if not check.passed] == []


def test_a_state_where_the_reference_alone_has_a_value_is_kept() -> None:
    found = seen(LOGARITHM)
    ours = found.graph.equations
    wrong = replace(
        ours.function("outputs"),
        result=replace(
            ours.function("outputs").result, value=ca.sqrt(ca.SX(ours.system.q[0]) - 0.5)
        ),
    )
    functions = tuple(wrong if f.name == "outputs" else f for f in ours.functions)
    spoiled = evidence(found.reference, replace(ours, functions=functions), states=20)
    failed = [check.name for check in results(spoiled) if not check.passed]
    assert "outputs" in failed


STEPPING = """
model: stepping
plane: xy
bodies: {a: {mass: 1 kg, inertia: 0.1}}
joints: {j: {type: revolute, parent: ground, child: a, coordinate: q}}
constraints: {m: {type: prescribed, joint: j, motion: "MOTION"}}
tables: {profile: {points: [[0, 0], [0.3, 0], [0.8, 0.5], [1.5, 2], [2, 2]], units: [s, rad], smooth: C1}}
"""


@pytest.mark.parametrize(
    "motion, seed",
    [
        ("(2 rad/s^2)*ramp(t - 0.3 s)^2", 2),
        pytest.param("(1 rad/s^2)*(t - 1 s)*abs(t - 1 s)", 0, marks=pytest.mark.slow),
        pytest.param("(2 rad/s^2)*max(t - 0.6 s, 0 s)^2", 0, marks=pytest.mark.slow),
        pytest.param("(3 rad/s^2)*(t - 0.7 s)^2*step(t - 0.7 s)", 4, marks=pytest.mark.slow),
        ("piecewise(t, 0, 0.5 s, (2 rad/s^2)*(t - 0.5 s)^2)", 10),
        ("profile(t)", 2),
    ],
)
def test_no_difference_reaches_across_a_step_in_the_acceleration(motion, seed):
    """Of 100 random times some are so near that two step sizes agree on what is wrong; what is
    wrong elsewhere is seen as before."""
    model = load_text(STEPPING.replace("MOTION", motion))
    seen = evidence(reference(model), equations(system(model)), None, 100, seed)
    rates = (identities.rows_rate, identities.beta_rate, identities.positions_rate)
    assert all(rate(seen) < 1e-10 for rate in rates)

    def wrong(*place):
        right = seen.terms_at(*place)
        return replace(right, beta=right.beta + 1e-6, c=right.c + 1e-6 * np.sin(place[0]))

    planted = replace(seen, terms_at=wrong)
    assert all(rate(planted) > 1e-7 for rate in rates)
