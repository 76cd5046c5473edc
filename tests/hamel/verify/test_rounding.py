"""No check divides rounding by rounding: random mechanisms of every closure pass at the very
tolerances, and what is planted in them is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model.records import Model
from derive.states import system
from hamel.verify import verification
from hamel.verify.mutation.errors import wrong_systems
from hamel.verify.mutation.mutations import mutations
from tests.mechanisms import LOADS, LOOPS, MEETINGS, TREE, mechanism

MANY = 300
EVERY_JOINT = tuple(kind for kind in TREE if kind != "fixed")


def any_mechanism(k: int) -> Model:
    """Number k: two to five bodies, a closure of every kind in turn, sometimes another one, a
    constraint, and loads. Trees on which the closure finds no room are drawn again."""
    rng = np.random.default_rng(k)
    for _ in range(20):
        model = _drawn(rng, list(LOOPS)[k % len(LOOPS)], k)
        if model.closures:
            return model
    raise AssertionError(f"mechanism {k} has no closure")


def _drawn(rng: np.random.Generator, closure: str, seed: int) -> Model:
    def ends() -> tuple[int, int]:
        first, second = rng.integers(0, 6, 2)
        return int(first), int(second)

    count = int(rng.integers(2, 6))
    tree = [(str(rng.choice(EVERY_JOINT)), int(rng.integers(0, 6))) for _ in range(count)]
    loops = [(closure, ends())]
    if rng.random() < 0.3:
        loops.append((str(rng.choice(list(LOOPS))), ends()))
    meetings = [(str(rng.choice(list(MEETINGS))), ends())] if rng.random() < 0.3 else []
    loads = [(str(rng.choice(LOADS)), ends()) for _ in range(int(rng.integers(0, 3)))]
    return mechanism(tree, loops, meetings, loads, seed=seed)


def derived(k: int, model: Model) -> Equations | None:
    """None where the random configuration is singular: nothing is claimed of it. Every fifth in
    quasi-velocities, which takes ten times as long; the terms are the same."""
    formulation = "augmented" if k % 5 else "quasi_velocities"
    try:
        return equations(system(model), None, formulation)
    except AssumptionError:
        return None


def refused(k: int) -> dict[str, float]:
    """The checks that fail, with their errors over their tolerances."""
    model = any_mechanism(k)
    chosen = derived(k, model)
    if chosen is None:
        return {}
    # the model as it was derived: where rows repeat, points may meet along other axes
    own = chosen.system.model
    failed = verification(own, chosen, states=3, seed=k).failed
    return {check.name: check.value / max(check.tolerance, 1e-300) for check in failed}


def unseen(k: int) -> list[str]:
    """Planted errors that turn no check red."""
    model = any_mechanism(k)
    chosen = derived(k, model)
    if chosen is None:
        return []
    own = chosen.system.model
    if not verification(own, chosen, states=3, seed=k).passed:
        return []
    missed = []
    for what, wrong in wrong_systems(chosen.system):
        if verification(own, replace(chosen, system=wrong), states=3, seed=k).passed:
            missed.append(what)
    found = mutations(own, chosen, seed=k, most=40)
    return missed + [f"{x.where}: {x.what}" for x in found.list if not x.caught_by]


@pytest.mark.parametrize("k", range(8))
def test_a_closure_of_every_kind_passes(k):
    assert refused(k) == {}


@pytest.mark.slow
@pytest.mark.parametrize("k", range(8, MANY))
def test_no_mechanism_is_refused(k):
    assert refused(k) == {}


@pytest.mark.slow
@pytest.mark.parametrize("k", range(0, MANY, 13))
def test_no_planted_error_is_lost(k):
    assert unseen(k) == []
