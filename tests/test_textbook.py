"""What the textbook prints is evaluated, formula by formula, and must equal what is compiled."""

import functools
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import casadi as ca
import numpy as np
import pytest
import sympy

from derive.formulations import equations
from derive.mechanics import system
from derive.mechanics.sampling import states
from derive.model import load
from derive.textbook import html, latex, laws, printed
from tests.scenes import MODELS, ROOT

TOLERANCE = 1e-9
CHOICES = [(path.stem, choice.name) for path in sorted(MODELS.glob("*.yaml")) for choice in load(path).choices]
EXPECTED_TO_FAIL = {("snake3", "world")}  # x and y rates depend on each other through the wheel of link 1


@functools.cache
def derived(model, choice, constants=(), formulation="quasi_velocities"):
    return equations(system(load(MODELS / f"{model}.yaml"), constants), choice, formulation)


@functools.cache
def pages(model, choice, constants=(), formulation="quasi_velocities"):
    found = derived(model, choice, constants, formulation)
    return html(found), latex(found)


def cases():
    for model, choice in CHOICES:
        if (model, choice) not in EXPECTED_TO_FAIL:
            yield pytest.param(model, choice, (), "quasi_velocities", id=f"{model}-{choice}")
            yield pytest.param(model, choice, "all", "quasi_velocities", id=f"{model}-{choice}-numbers")
    for model in dict.fromkeys(model for model, _ in CHOICES):
        yield pytest.param(model, None, (), "augmented", id=f"{model}-augmented")


class State:
    """A random consistent state and every basic symbol's value there."""

    def __init__(self, found, k):
        s = found.system
        sample = states(s, k + 1, seed=7, parameters=0.1)
        self.t, self.q, self.u, self.p = sample.t[k], sample.q[k], sample.u[k], sample.p[k]
        self.found, self.v = found, sample.v[k]
        self.w = self.v if found.formulation == "augmented" else self._speeds()
        if found.formulation != "augmented":
            self.v = self._evaluated(named(found, "v")).ravel()

    def _speeds(self):
        s = self.found.system
        B = ca.Function("B", [s.t, s.q, s.p], [ca.densify(named(self.found, "B"))])
        return np.asarray(B(self.t, self.q, self.p)) @ self.v

    @property
    def arguments(self):
        s = self.found.system
        x = next(a for a in self.found.arguments if a.name == "x").symbols[s.q.numel() :]
        w = [] if self.found.formulation == "augmented" else [x]
        return [s.t, s.q, s.v, *w, s.u, s.p]

    def _evaluated(self, term):
        w = [] if self.found.formulation == "augmented" else [self.w]
        function = ca.Function("term", self.arguments, [ca.densify(ca.SX(term))])
        return np.asarray(function(self.t, self.q, self.v, *w, self.u, self.p))

    def many(self, terms):
        w = [] if self.found.formulation == "augmented" else [self.w]
        function = ca.Function("terms", self.arguments, [ca.densify(ca.SX(x)) for x in terms])
        result = function(self.t, self.q, self.v, *w, self.u, self.p)
        return [np.asarray(x) for x in (result if len(terms) > 1 else [result])]

    def basic(self):
        """Name → value of what a model declares."""
        s = self.found.system
        values = dict(zip([v.name for v in s.model.velocities], self.v)) | dict(
            zip([c.name for c in s.model.coordinates], self.q)
        )
        values |= dict(zip([i.name for i in s.model.inputs], self.u)) | {"t": self.t}
        free = [x.name for x in s.model.parameters if x.name not in s.constants]
        return values | dict(zip(free, self.p))


def named(found, name):
    return next(x.value for x in found.named if x.name == name)


def speeds_apart(found, values, state):
    """Quasi-velocities' own names, primed where a parameter or coordinate has the same one."""
    result = {}
    for name, value in zip(found.w, state.w):
        while name in values or name in result:
            name += "'"
        result[name] = value
    return result


def evaluate(found, k):
    """Every printed formula in order, each over the values that the earlier ones gave: (name, printed, compiled)."""
    state = State(found, k)
    values = state.basic()
    values |= speeds_apart(found, values, state)
    formulas = printed(found)
    for formula, exact in zip(formulas, state.many([f.value for f in formulas])):
        result = numbers(formula, values)
        values |= {s.name: x for s, x in zip(formula.left, result.ravel()) if s is not None}
        yield formula.name, result, exact


@functools.cache
def compiled(expressions, symbols):
    return sympy.lambdify(symbols, expressions, "numpy", cse=False)


def numbers(formula, values):
    """A display's lines one after the other: a line may use the ones above it."""
    here, result = dict(values), []
    for symbol, x in zip(formula.left, formula.right):
        free = tuple(sorted(x.free_symbols, key=lambda s: s.name))
        undefined = [s.name for s in free if s.name not in here]
        assert not undefined, f"{formula.name} uses {undefined} before they are defined"
        value = float(compiled(x, free)(*[here[s.name] for s in free])) if free else float(x)
        if symbol is not None:
            here[symbol.name] = value
        result.append(value)
    return np.array(result).reshape(formula.right.shape)


@pytest.mark.parametrize("model, choice, constants, formulation", list(cases()))
def test_what_is_printed_is_what_is_compiled(model, choice, constants, formulation):
    found = derived(model, choice, constants, formulation)
    for k in range(2):
        for name, result, exact in evaluate(found, k):
            scale = 1 + np.max(np.abs(exact), initial=0.0)
            assert np.max(np.abs(result - exact), initial=0.0) <= TOLERANCE * scale, name


@pytest.mark.parametrize("model, choice, constants, formulation", list(cases()))
def test_every_printed_law_holds(model, choice, constants, formulation):
    found = derived(model, choice, constants, formulation)
    state, stated = State(found, 0), laws(found)
    for law, residual in zip(stated, state.many([x.residual for x in stated])):
        assert np.max(np.abs(residual), initial=0.0) <= 1e-7, law.name
