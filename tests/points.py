"""Points of the product formulation × enforcement × integrator as compiled modules that several
tests share."""

from __future__ import annotations

import functools
import re
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.integrators import INTEGRATORS
from codegen.passes import program
from derive.diagnostics import AssumptionError
from derive.enforcement import ENFORCEMENTS, Enforcement, Options, kept_equations
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.initial import Initial, initial_state
from hamel.build.module import published
from hamel.simulate.exact import state_of
from tests.compilation import unoptimised
from tests.scenes import MODELS

# A particle on an ellipsoid, held to one side by a spring: two degrees of freedom behind one
# holonomic row, written by hand.
ELLIPSOID = """
model: ellipsoid
coordinates: {x: m, y: m, z: m}
parameters: {m: 1.5 kg, k: 4 N/m, g: 9.81 m/s^2}
kinetic: m*(der(x)**2 + der(y)**2 + der(z)**2)/2
potential: m*g*z + k*(x - 0.3 m)**2/2
constraints: {shell: {holonomic: x**2 + 1.2*y**2 + 0.9*z**2 - 1 m^2}}
quasi_velocities: {sideways: [der(x), der(y)]}
initial: {x: 0.5 m, y: 0.1 m, der(x): 0.2 m/s, der(y): 1.5 m/s, guess: {z: -0.9 m}}
"""

# A cart on a slope, a pole on it: a tree with a prismatic joint.
CART = """
model: cart
plane: xy
gravity: [3 m/s^2, -9 m/s^2]
bodies: {cart: {mass: 2 kg}, pole: {mass: 0.5 kg, com: [0.1 m, 0.4 m], inertia: 0.02}}
joints:
  track: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: s}
  hinge: {type: revolute, parent: cart, child: pole, coordinate: th}
initial: {s: 0.2 m, th: 40 deg, der(s): -0.5 m/s, der(th): 2 rad/s}
"""

# Models without losses, so that the energy can be held.
LOOPS = ("four_bar", "rolling_disk", "ellipsoid", "tractor_trailers")
TREES = ("cart", "double_pendulum", "planar_3r")
WRITTEN_HERE = {"ellipsoid": ELLIPSOID, "cart": CART}
LOSSES = re.compile(r"(type: damper.*coefficient: )\S+")
ALPHA = 10.0
NAMED = {enforcement.name: enforcement for enforcement in ENFORCEMENTS}
FOLDERS = tempfile.TemporaryDirectory(prefix="hamel-methods-")  # until the process ends
ALONE = ("invariants_euclidean",)  # has no place beside another metric in one module


@functools.cache
def mechanics(model: str) -> System:
    text = WRITTEN_HERE.get(model) or (MODELS / f"{model}.yaml").read_text()
    return system(load_text(LOSSES.sub(r"\g<1>0", text)))


@functools.cache
def plain(model: str, formulation: str) -> Equations | str:
    """The equations, or why the formulation does not fit."""
    try:
        return equations(mechanics(model), None, formulation)
    except AssumptionError as error:
        return str(error)


def fitting(model: str, formulation: str) -> Equations:
    found = plain(model, formulation)
    assert not isinstance(found, str)
    return found


@functools.cache
def refusal(model: str, formulation: str, enforcement: Enforcement) -> str:
    found = plain(model, formulation)
    return found if isinstance(found, str) else enforcement.refusal(found, Options(ALPHA))


def made(model: str, formulation: str, enforcement: str) -> ModuleType:
    """A module with every integrator and this enforcement, shared with other enforcements where
    these can be in one."""
    own = NAMED[enforcement].level == "rates" or enforcement in ALONE
    return module(model, formulation, enforcement) if own else module(model, formulation)


@functools.cache
def module(model: str, formulation: str, own: str = "") -> ModuleType:
    """With the enforcement `own`, or with all that can be in one module."""
    if own:
        names, functions = (own,), ["dynamics", "velocity"]
        found = kept_equations(mechanics(model), None, formulation, NAMED[own], Options(ALPHA))
    else:
        fit = [
            enforcement
            for enforcement in ENFORCEMENTS
            if not refusal(model, formulation, enforcement)
        ]
        shared = [
            enforcement
            for enforcement in fit
            if enforcement.level != "rates" and enforcement.name not in ALONE
        ]
        names, found = (
            tuple(enforcement.name for enforcement in shared),
            fitting(model, formulation),
        )
        for enforcement in shared:
            found = enforcement.equations(found, Options())
        wanted = ("dynamics", "velocity", "power", "constraints", "project")
        functions = [f.name for f in found.functions if f.name in wanted]
        functions += ["reactions"] * (formulation == "augmented" and bool(found.system.rows))
    integrators = tuple(integrator.name for integrator in INTEGRATORS)
    folder = Path(tempfile.mkdtemp(dir=FOLDERS.name))
    return quickly_built(found, functions, integrators, names, folder)


def quickly_built(
    found: Equations,
    functions: list[str],
    integrators: tuple[str, ...],
    enforcements: tuple[str, ...],
    folder: Path,
) -> ModuleType:
    """Compiled in a hurry: these motions are short, and few calls go through Python."""
    with pytest.MonkeyPatch.context() as patch, unoptimised():
        patch.setattr(
            "codegen.passes.rewriting.improve.LONGEST_FUNCTION", 0
        )  # operations above which a function is improved once only
        patch.setattr(compiler, "headers", list)
        return loader.load(
            published(
                program(found, functions, integrators, enforcements),
                folder / found.system.model.name,
            ).folder
        )


def start(
    model: str, formulation: str, given: dict[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, u, p of the initial state of the file, some of it changed."""
    mechanical = mechanics(model)
    p = np.array(mechanical.parameters)
    initial: Initial = initial_state(mechanical, given or {}, p)
    return (
        state_of(fitting(model, formulation), initial, p),
        np.zeros(len(mechanical.model.inputs)),
        p,
    )


def common(
    model: str, module: ModuleType, t: np.ndarray, x: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """q and v, which mean the same in every formulation, one row per time."""
    nq = mechanics(model).q.numel()
    return np.hstack([x[:, :nq], module.velocity(t, x, np.zeros(module.nu), p)])
