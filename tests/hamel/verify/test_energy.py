"""Kinetic energies with terms linear in the rates, free of them or explicit in time: what is in
balance is Jacobi's integral T₂ − T₀ + V, and each part of it that is wrong is seen."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import pytest

from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from hamel.verify.checks import agreement, identities
from hamel.verify.checks.check import Check
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

HOOP = """
model: hoop
coordinates: {th: rad}
parameters: {m: 1 kg, R: 0.5 m, om: 6 rad/s, g: 9.81 m/s^2}
kinetic: m/2*R^2*(der(th)^2 + om^2*sin(th)^2)
potential: -m*g*R*cos(th)
initial: {th: 0.3 rad}
"""
MAGNET = """
model: magnet
coordinates: {x: m, y: m}
parameters: {m: 1 kg, qB: 2 kg/s}
kinetic: m/2*(der(x)^2 + der(y)^2) + qB*x*der(y)
initial: {x: 0.1 m, der(x): 1 m/s}
"""
SHAKEN = """
model: shaken
coordinates: {r: m, th: rad}
parameters: {m: 1 kg, k: 20 N/m, om: 2 rad/s, a: 0.1 m}
kinetic: m/2*((der(r) + a*om*cos(om*t))^2 + (r + 0.5 m)^2*(der(th) + om)^2)
potential: k/2*r^2 + m*(2 m/s^2)*r*sin(th)
initial: {r: 0.1 m, der(th): 1 rad/s}
"""
GROWING = """
model: growing
coordinates: {x: m}
parameters: {m: 1 kg, k: 3 N/m}
kinetic: m/2*(1 + t/(4 s))*der(x)^2
potential: k/2*x^2
initial: {x: 0.1 m}
"""
MODELS = {"hoop": HOOP, "magnet": MAGNET, "shaken": SHAKEN, "growing": GROWING}
BALANCE = next(c for c in identities.CHECKS if c.name == "d(T₂ − T₀ + V)/dt")
ENERGIES = tuple(c for c in agreement.CHECKS if c.name in ("T, V", "energy", "power"))


def failed(mechanics, checks: tuple[Check, ...] = (*ENERGIES, BALANCE)) -> set[str]:
    """The checks that go red for a system, judged by the reference of its model."""
    seen = evidence(reference(mechanics.model), equations(mechanics), None, 4)
    return {check.name for check in results(seen, checks) if not check.passed}


@pytest.mark.parametrize("name", MODELS)
def test_the_balance_holds(name):
    assert failed(system(load_text(MODELS[name]))) == set()


@pytest.mark.parametrize(("name", "integral"), [("hoop", 1), ("magnet", 1), ("growing", 0)])
def test_the_function_gives_the_integral_where_it_is_another_sum(name, integral):
    found = equations(system(load_text(MODELS[name]))).function("energy").result
    assert found.labels == ("T", "V", *["jacobi"] * integral)


def test_a_wrong_integral_is_seen():
    """T + V for it, as it once was, and each of its terms off by a thousandth."""
    mechanics = system(load_text(SHAKEN))
    for wrong in (mechanics.T + mechanics.V, 1.001 * mechanics.energy):
        assert "T, V" in failed(replace(mechanics, energy=wrong))
    once = replace(mechanics, homogeneous=True, energy=mechanics.T + mechanics.V)
    assert {"T, V", "energy"} <= failed(once)


def test_power_without_the_explicit_part_is_seen():
    """∂T/∂t left out, as it once was."""
    mechanics = system(load_text(GROWING))
    wrong = replace(mechanics, power=mechanics.power + ca.jtimes(mechanics.T, mechanics.t, 1))
    assert failed(wrong) == {"power", BALANCE.name}
