"""Scales of nodes: trials that are left out would have changed nothing, rounding is recognised."""

from __future__ import annotations

import math
import random
from functools import cache

import pytest

from codegen.limits import CLOSE
from codegen.passes.pipeline import _roots
from codegen.passes.rewriting.graph import Work, snapped
from codegen.passes.rewriting.rescale import Balance
from codegen.passes.rewriting.scales import scales, starts
from codegen.passes.rewriting.trace import record, trace
from derive.formulations import equations
from derive.model import load
from derive.states import system
from tests.scenes import MODELS


@cache
def works(name: str) -> tuple[Work, ...]:
    """The graphs of the functions of a model."""
    made = equations(system(load(MODELS / f"{name}.yaml")))
    slots = [(slot.name, slot.symbols) for slot in made.arguments]
    usual = [function for function in made.functions if function.x is None]
    return tuple(trace(record(slots, _roots(function))) for function in usual)


@pytest.mark.parametrize("name", ["four_bar", "rolling_sphere"])
def test_trials_that_are_left_out_would_have_changed_nothing(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every candidate tried, and those with more votes than the present scale alone."""
    few = [scales(starts(work, set())) for work in works(name)]
    trials: list[float] = []
    monkeypatch.setattr(Balance, "_promising", lambda *_: [(0.0, math.inf)])
    counted = Balance._cost
    monkeypatch.setattr(
        Balance, "_cost", lambda self, *rest: trials.append(rest[1]) or counted(self, *rest)
    )
    assert [scales(starts(work, set())) for work in works(name)] == few
    assert trials


def test_multiples_are_counted_as_when_counted_anew() -> None:
    """What is kept up to date from rescaling to rescaling is what a new count gives."""
    settled: list[Balance] = []
    for work in works("four_bar"):
        settle = Balance.settle

        def kept(self: Balance, settle=settle) -> None:
            settle(self)
            settled.append(self)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Balance, "settle", kept)
            scales(starts(work, set()))
    assert settled
    for balance in settled:
        anew = Balance(balance.structure, balance.scales)
        assert balance.total() == anew.total() and balance.needed == anew.needed


def test_rounding_is_taken_off_short_decimals_and_fractions_alone() -> None:
    draw = random.Random(1)
    for _ in range(2000):
        digits = draw.randint(1, 12)
        short = float(f"{draw.uniform(1, 10) * 10.0 ** draw.randint(-150, 150):.{digits - 1}e}")
        assert snapped(math.nextafter(short, math.inf)) == short
        assert snapped(-math.nextafter(short, 0.0)) == -short
        third = draw.randint(1, 300) / draw.choice([3, 7, 9, 11, 15])
        assert snapped(math.nextafter(third, math.inf)) == third
        long = draw.random()
        assert abs(snapped(long) - long) <= CLOSE * long
