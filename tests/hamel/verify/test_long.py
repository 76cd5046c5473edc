"""Long trees: nothing of them is written out unless it is asked for, the reference balances their
forces in O(n), and a planted error is seen.

Of hamel.verify: long, long_quaternions, long_trees.
Of hamel.verify.reference: balance.
Of derive.textbook: loops.
Of derive.expressions: deferred.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.expressions.deferred import Deferred, Term, changed, is_deferred, passed_on, size_of
from derive.formulations.records import Equations
from derive.textbook import html
from hamel.build.stages import equations_of, model_of
from hamel.verify.long import FEWEST, _difference, drawn, is_long, long_verification
from hamel.verify.long_trees import BALANCED, SAME, called, relative
from hamel.verify.reference.balance import balance
from hamel.verify.reference.outcome import evaluate, reference
from tests.trees import chain, equal_links, rope, several, tree

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


@pytest.fixture(autouse=True)
def _three_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short trees take the way of long ones."""
    monkeypatch.setattr("derive.mechanics.records.LONG", 3)
    monkeypatch.setattr("derive.mechanics.system.LONG", 3)


def written(base: Path, text: str) -> Path:
    path = base / ("model.urdf" if text.startswith("<") else "model.yaml")
    path.write_text(text)
    return path


FURTHER = ("bias", "inverse_dynamics", "dynamics_forward", "dynamics_adjoint")


def with_function(equations: Equations, name: str, wrong: float) -> ModuleType:
    """A module with one function besides, the last entry of whose result is off by a part."""
    request = {x.name: x for x in equations.requests}.get(name)
    function = request.function if request else equations.function(name)
    t, x, u, p = (argument.symbols for argument in equations.arguments)
    taken = x if function.x is None else function.x.symbols
    f = ca.Function("f", [t, taken, u, p], [function.result.value])

    def call(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        result = np.array(f(t, x, u, p)).ravel()
        result[-1] *= 1.0 + wrong
        return result

    made = module(equations)
    vars(made)[name] = call
    return made


def module(equations: Equations, wrong: float = 0.0) -> ModuleType:
    """What stands for a module: the equations as CasADi evaluates them, v̇ of the last joint off by
    a part."""
    slots = [argument.symbols for argument in equations.arguments]
    f = ca.Function("f", slots, [equations.function("dynamics").result.value])

    def dynamics(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        if np.ndim(t):
            return np.array([dynamics(*row) for row in zip(t, x, u, p)])
        xdot = np.array(f(t, x, u, p)).ravel()
        xdot[-1] *= 1.0 + wrong
        return xdot

    made = ModuleType("nothing")
    vars(made).update(dynamics=dynamics, defaults=np.zeros(len(equations.parameters)))
    return made


@pytest.mark.parametrize("text", [chain(5), tree(), equal_links(4), several()])
def test_the_balance_is_that_of_the_dense_reference(text: str, tmp_path: Path) -> None:
    equations = equations_of(written(tmp_path, text))
    ref = reference(equations.system.model)
    for place in drawn(ref, equations, 2, seed=1):
        dense = evaluate(ref, place.state)
        rng = np.random.default_rng(0)
        vdot = rng.normal(size=len(place.state.v))
        found = balance(ref, place.state, vdot)
        wanted = dense.M @ vdot + dense.h - dense.Q
        assert np.abs((found.left - wanted) / found.size).max() < 1e-13
        assert (np.abs(found.left) <= found.size * (1 + 1e-12)).all()


def test_a_wrong_acceleration_is_seen(tmp_path: Path) -> None:
    path = written(tmp_path, chain(5))
    equations = equations_of(path)
    model = model_of(path)[0]
    found = {}
    for wrong in (0.0, 1e-6):
        made = module(equations, wrong)
        assert is_long(equations, made)
        result = long_verification(model, equations, made, FEWEST)
        found[wrong] = {check.name: check.passed for check in result.checks}
        assert result.passed == (wrong == 0.0)
    assert found[0.0]["balance"] and not found[1e-6]["balance"]
    assert BALANCED < 1e-6


@pytest.mark.parametrize("name", FURTHER)
def test_a_wrong_entry_of_a_function_in_loops_is_seen(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, chain(5))
    equations, model = equations_of(path), model_of(path)[0]
    for wrong in (0.0, 1e-4):
        made = with_function(equations, name, wrong)
        assert is_long(equations, made)
        result = long_verification(model, equations, made, FEWEST)
        assert result.passed == (wrong == 0.0)


QUATERNIONS = ("qdot", "integrate", "difference", "normalise", "constraints", "project")


@pytest.mark.parametrize("name", (*FURTHER, *QUATERNIONS))
def test_a_wrong_entry_on_ball_joints_and_free_bases_is_seen(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, rope(3) if name in QUATERNIONS else several())
    equations, model = equations_of(path), model_of(path)[0]
    for wrong in (0.0, 1e-2):
        made = with_function(equations, name, wrong)
        assert is_long(equations, made)
        result = long_verification(model, equations, made, FEWEST)
        assert result.passed == (wrong == 0.0), [x for x in result.checks if not x.passed]


def test_functions_that_grow_are_left_out_by_name(tmp_path: Path) -> None:
    """The build is verified, what is not a loop is left out, and the page prints the recursion."""
    out = tmp_path / "out"
    made = hamel.build(written(tmp_path, equal_links(4)), out=out, roll="always")
    loops = {"dynamics", "bias", "inverse_dynamics"}
    assert made.verified and set(made.operations) == loops | {"power", "velocity", "state"}
    assert "function energy" in made.left_out
    page = (out / "derivation.html").read_text(encoding="utf-8")
    assert "loops over the links" in page


def test_nothing_is_written_out_on_the_way(tmp_path: Path) -> None:
    equations = equations_of(written(tmp_path, equal_links(4)))
    html(equations)
    system = equations.system
    assert all(is_deferred(system, name) for name in ("h", "T", "V", "energy", "inertias"))
    assert not equations.function("dynamics").result.written
    assert equations.function("dynamics").result.size == 8


def test_a_term_is_formed_once_and_when_it_is_read() -> None:
    @dataclass(frozen=True)
    class Holder:
        name: str
        value: Term[float] = Term()

    count: list[int] = []

    def make() -> float:
        count.append(1)
        return 2.0

    late = Holder("a", Deferred(make, 3))
    other = changed(late, name="b")
    assert is_deferred(other, "value") and size_of(other, "value") == 3 and not count
    assert isinstance(passed_on(other, "value"), Deferred)
    assert (other.value, other.value, late.value) == (2.0, 2.0, 2.0) and len(count) == 1
    assert passed_on(late, "value") == 2.0 and replace(late, name="c").value == 2.0
    with pytest.raises(TypeError):
        Holder("without")  # type: ignore[call-arg]


def test_roundings_that_hundreds_of_links_enlarge_are_no_difference(tmp_path: Path) -> None:
    """Another library's sines change v̇ of a long chain by more than SAME; what stands for it here
    gets the same state off by a rounding. A wrong digit above that is seen."""
    path = written(tmp_path, chain(40))
    equations = equations_of(path)
    ref, made = reference(model_of(path)[0]), module(equations)
    place = drawn(ref, equations, 1, seed=0)[0]
    rounded = np.random.default_rng(0).uniform(-1.0, 1.0, len(place.x)) * 2.0**-52

    def other(wrong: float) -> Any:
        return lambda t, x, u, p: made.dynamics(t, x * (1.0 + rounded), u, p) * (1.0 + wrong)

    assert relative(called(other(0.0), *place.row), called(made.dynamics, *place.row)) > 0.0
    assert _difference(made, other(0.0), place, 1.0) <= SAME
    assert _difference(made, other(1e-9), place, 1.0) > SAME
