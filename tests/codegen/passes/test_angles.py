"""Sines and cosines of sums of angles, from those of their parts."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest

from codegen.emit import emit
from codegen.passes import angles, program
from codegen.passes.angles import Turn, spelled, spelled_sums, turns
from tests.scenes import derived

GIVEN = ("q1", "q2", "q3")
VALUES = {"z1": ("add", "q2", "q1"), "z2": ("sub", "z1", "q3")}


def test_a_sum_stands_behind_its_parts() -> None:
    found = turns(["z2", "q2", "z1", "q1", "q3"], VALUES, GIVEN)
    assert found == [
        Turn("q2"),
        Turn("q1"),
        Turn("z1", ("q2", "q1"), 1),
        Turn("q3"),
        Turn("z2", ("z1", "q3"), -1),
    ]


def test_a_sum_without_its_parts_has_its_own() -> None:
    assert turns(["z1", "q1"], VALUES, GIVEN) == [Turn("q1"), Turn("z1")]


def test_a_part_may_come_from_the_sum() -> None:
    """q3 is no difference of the others; q1 with two terms after it is."""
    values = {"z1": ("add", "q2", "q1"), "z3": ("sub", ("add", "z1", "q3"), "q2")}
    assert turns(["z1", "z3", "q3"], values, GIVEN)[-1] == Turn("z3")
    assert turns(["q1", "q3", "z3"], values, GIVEN)[-1] == Turn("z3", ("q1", "q3"), 1)


def test_other_angles_are_left_as_they_are() -> None:
    values = {"z1": ("mul", 2.0, "q1"), "z2": ("add", "z1", "q2")}
    assert turns(["z1", "z2", ("sin", "q1"), "q1"], values, GIVEN) == [Turn("q1")]


def test_formulas_are_not_written_out() -> None:
    """Each of them takes the one before twice, so that the last stands for 2⁶⁰ of the first; only
    sums are spelled, and these are looked through once."""
    values = {f"z{n + 1}": ("mul", f"z{n}", f"z{n}") for n in range(60)} | {"z0": ("sin", "q1")}
    sums = {f"s{n + 1}": ("sub", f"s{n}", f"s{n}") for n in range(60)} | {"s0": "z60"}
    given = {**values, **sums, "z61": ("add", "q1", "q2")}
    assert spelled_sums(["z60", "s60", "z61"], given, GIVEN) == [("add", "q1", "q2")]
    assert turns(["z60", "s60", "z61"], given, GIVEN) == [Turn("z61")]


def test_what_was_made_before_is_made_again() -> None:
    """So that a compiler finds it: z2 as it would be where z1 is an angle, too."""
    before = [spelled(angle, VALUES) for angle in ("q2", "z1", "q1", "q3", "z2")]
    found = {turn.angle: turn for turn in turns(["z2"], VALUES, GIVEN, before)}
    assert found["z2"].of == (("add", "q2", "q1"), "q3")


def test_steps_of_a_four_bar_take_three_sines() -> None:
    """Of its five angles two are sums of the others, in dynamics and in the power."""
    text = emit(program(derived("four_bar"), None, ("dop853",)))["four_bar_batch.c"]
    body = re.search(r"^void four_bar_slope_lanes.*?^}\n", text, re.MULTILINE | re.DOTALL)
    assert body
    _, of_rates, of_power = body[0].split("        {\n")
    angles = [re.findall(r"_sincos_short\((\w+),", half) for half in (of_rates, of_power)]
    assert [sorted(half) for half in angles] == [["q1", "q2", "q3"]] * 2


def test_a_row_of_loops_looks_at_each_pair_of_angles_some_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ninety angles, sums of two each: with the fourth power thirty four-bars took a minute."""
    looks = 0

    def added(a: angles.Parts, b: angles.Parts, sign: int) -> angles.Parts:
        nonlocal looks
        looks += 1
        return plain(a, b, sign)

    plain = angles._added  # type: ignore[reportPrivateUsage]
    monkeypatch.setattr(angles, "_added", added)
    names = [f"q{i}" for i in range(45)]
    sums = [("add", a, b) for a, b in pairwise(names)]
    found = angles.turns([*names, *sums], {}, names)
    assert [turn.angle for turn in found if turn.of] == sums
    assert looks < 8 * len(found) ** 2
