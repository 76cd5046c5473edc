"""Roundoff of long chains: what is estimated covers what happens and stays below the bound, which
there says nothing; so one constant that is off by a millionth is seen in a module and in a target.

Of hamel.verify.checks: carried, roundoff.
"""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from codegen import loader
from codegen.reals import FLOAT32
from derive.formulations.evaluate import slots_of
from derive.formulations.records import Equations
from derive.states import sampling
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for, with_emitted
from hamel.build.targets import subject_of
from hamel.verify.checks.roundoff import bound, estimate
from hamel.verify.shipped import FOR_TARGETS, MANY, TOLERANCE, shipped, shipped_checks
from hamel.verify.targets import casadi
from tests import digits

LINKS = 30
OFF = 1.0 + 1e-6  # of one constant


def chain(n: int) -> str:
    """A planar pendulum of n links."""
    lines = ["model: chain", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1.5, com: [0.5, 0], inertia: 0.08}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", 1.0) if i else ("ground", 0.0)
        place = f"parent: {parent}, child: b{i}, at: [{at}, 0]"
        lines.append(f"  j{i}: {{type: revolute, {place}, coordinate: q{i}}}")
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("chain")


@pytest.fixture(scope="module")
def equations(place) -> Equations:
    file = place / "chain.yaml"
    file.write_text(chain(LINKS), "utf-8")
    return equations_of(file)


def written(equations: Equations, name: str) -> tuple[list[ca.SX], ca.SX, np.ndarray]:
    """Arguments and result of a function, and two random states."""
    function, drawn = equations.function(name), sampling.states(equations.system, 2, 0)
    columns = zip(drawn.t, drawn.q, drawn.v, drawn.u, drawn.p)
    states = np.array([np.concatenate([[t], *rest]) for t, *rest in columns])
    return slots_of(equations, function), ca.densify(function.result.value), states


@pytest.mark.parametrize("name", ["dynamics", "energy"])
def test_the_estimate_covers_what_happens_where_the_bound_says_nothing(equations, name):
    slots, value, states = written(equations, name)
    likely, worst = estimate(slots, value, states), bound(slots, value, states)
    assert (likely <= worst).all()
    arguments = ca.vertcat(*slots)
    double = ca.Function("double", [arguments], [value])
    for state, error in zip(states, likely):
        here = np.array(double(state)).ravel()
        exact = np.array(digits.evaluated([arguments], [value], [state])[0], dtype=float)
        assert np.max(np.abs(here - exact)) <= MANY * np.max(error)
        assert MANY * np.max(error) <= 1e-12 * np.max(np.abs(here))
    if name == "dynamics":
        assert np.min(np.max(worst, axis=1)) > 1e20


def test_arguments_count_as_rounded_where_the_precision_rounds_them():
    x = ca.SX.sym("x")
    states = np.array([[0.1], [0.5]])  # the second is a power of two
    assert estimate([x], -x, states).tolist() == [[0.0], [0.0]]
    single = estimate([x], -x, states, FLOAT32)
    assert 0.0 < single[0, 0] <= 0.1 * 2.0**-53
    assert single[1, 0] == 0.0


def test_nothing_at_all_has_no_roundoff():
    x = ca.SX.sym("x")
    assert estimate([x], ca.SX(0, 1), np.zeros((3, 1))).shape == (3, 0)
    assert estimate([x], -x, np.ones((3, 1))).tolist() == [[0.0]] * 3


def compiled(place: Path, equations: Equations, targets: tuple[str, ...] = ()):
    """The program of the chain, a state of it, and the folder of the module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(place / "cache"))
        options = BuildOptions(functions=("dynamics", "energy"), targets=targets)
        program = program_for(equations, options)
        emitted = [kernel.name for kernel in program.kernels]
        rows = shipped(with_emitted(equations, program), emitted, 0, 1, FOR_TARGETS)
        return program, rows, published(program, place / program.name).folder


@pytest.fixture(scope="module")
def built(place, equations):
    return compiled(place, equations)


def test_sizes_are_those_of_the_results(built):
    _, rows, _ = built
    for name in ("dynamics", "energy"):
        largest = np.max(np.abs(rows[name]["expected"][0]))
        assert rows[name]["size"][0] <= 1.1 * largest
        assert largest > 1.0


def test_where_room_is_short_every_function_keeps_a_state(equations):
    all_rows = shipped(equations, ("dynamics", "energy"), 0, 3)
    assert [len(rows["t"]) for rows in all_rows.values()] == [3, 3]
    short = shipped(equations, ("dynamics", "energy"), 0, 3, most=250)
    assert [len(rows["t"]) for rows in short.values()] == [1, 1]
    assert short["energy"]["expected"][0] == all_rows["energy"]["expected"][0]
    assert list(shipped(equations, ("dynamics", "energy"), 0, 3, most=100)) == ["energy"]


def spoiled(file: Path) -> None:
    """A constant in the middle of the recursion of `dynamics` is a millionth too large."""
    text = file.read_text("utf-8")
    constants = re.findall(r" \d+\.25 \* z\d+\n", text.split("def derivatives(")[0])
    chosen = constants[len(constants) // 2]
    assert text.count(chosen) == 1
    number, _, rest = chosen.strip().partition(" ")
    file.write_text(text.replace(chosen, f" {float(number) * OFF!r} {rest}\n"), "utf-8")


def test_a_constant_off_by_a_millionth_is_seen_in_the_shipped_module(built, tmp_path):
    _, rows, folder = built
    for name in ("right", "wrong"):
        place = shutil.copytree(folder, tmp_path / name / folder.name)
        if name == "wrong":
            spoiled(place / "_numpy.py")
        (place / "verification.json").write_text(json.dumps({"functions": rows}), "utf-8")
        checks = {check.name: check for check in shipped_checks(place, loader.load(place))}
        seen = checks["NumPy = shipped values"]
        assert seen.passed == (name == "right")
        assert seen.value > 100 * TOLERANCE or seen.passed


@pytest.mark.slow
def test_a_constant_off_by_a_millionth_is_seen_in_a_target(equations, tmp_path):
    program, rows, folder = compiled(tmp_path, equations, ("casadi",))
    subject = subject_of(program, loader.load(folder), rows)
    assert all(result.passed for result in casadi.check(subject))
    wrong = shutil.copytree(folder, tmp_path / "wrong" / folder.name)
    spoiled(wrong / f"{program.name}_casadi.py")
    failed = [x.name for x in casadi.check(replace(subject, folder=wrong)) if not x.passed]
    assert "symbols: values" in failed


def test_the_bound_covers_sums_in_every_order() -> None:
    """A row wr - turn + spin of a gear, near zero where wr and turn are near each other: the C code
    may add it up another way, and hamel verify once called the difference a failure."""
    a, b, c = (ca.SX.sym(name) for name in "abc")
    rng = np.random.default_rng(0)
    states = np.column_stack([rng.uniform(0.5, 1.0, (500, 1)), 1e-3 * rng.normal(size=(500, 2))])
    states[:, 1] += states[:, 0]
    states[:, 2] = states[:, 1] - states[:, 0] + 1e-17 * rng.normal(size=500)
    orders = ((a - b) + c, (a + c) - b, (c - b) + a)
    symbols = ca.vertcat(a, b, c)
    got = [ca.Function("f", [symbols], [z])(states.T).full().ravel() for z in orders]
    for z in orders:
        allowed = 8.0 * bound([a, b, c], z, states)[:, 0]
        assert all((np.abs(x - y) <= allowed).all() for x in got for y in got)


def test_the_length_of_a_vector_that_is_rounding_is_bounded():
    """√(a² + b²) of a = x − y z and b = 0: where both orders of rounding differ the first order
    says zero."""
    x, y, z = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("z")
    gap = x - y * z
    length = ca.sqrt(gap**2 + (gap * gap) * ca.SX(0.25))
    states = np.array([[0.1 * 0.3, 0.1, 0.3], [0.5, 0.25, 2.0], [1.0, 0.5, 1.0]])
    found = bound([x, y, z], length, states)[:, 0]
    units = 2.0**-53 * states[:, 0]
    assert np.all(found >= units) and np.all(found <= 8.0 * units)
