"""The Python side of `simulate` over an oscillator that is written by hand: no module is generated.

Of codegen.runtime: many_motions, model_facts, numpy_changes, numpy_guards, numpy_loop, numpy_motion,
one_motion, runge_kutta, simulate_face.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from codegen.integrators import INTEGRATORS
from codegen.integrators import Tableau as Coefficients
from codegen.runtime import numpy_changes
from codegen.runtime.events import Event
from codegen.runtime.inputs import Table
from codegen.runtime.model_facts import Facts, Limits, Method
from codegen.runtime.numpy_loop import advance
from codegen.runtime.numpy_motion import Failed, Motion
from codegen.runtime.one_motion import Backend
from codegen.runtime.runge_kutta import Dense, Step, Tableau
from codegen.runtime.simulate_face import Request, run
from codegen.runtime.simulation import Simulation, Status, Stopped
from codegen.targets import simulate

LETTERS = {"int": "i", "long": "l", "double": ""}
LIMITS = Limits(1e-6, 1e-4, 1e-7, 1e-9, 16, 0.02, 1e-6, 0.9, 1e-7, 0.0)
START, HALF = [1.0, 0.0], np.pi


def table(name: str) -> Tableau:
    """The coefficients of an integrator as numbers."""
    found = next(x for x in INTEGRATORS if x.name == name)
    assert isinstance(found, Coefficients)
    rows = lambda given: [[float(value) for value in row] for row in given]  # noqa: E731
    grow = 1 / found.estimate - 0.75 * found.damping
    dense = found.dense and Dense(
        [float(c) for c in found.dense.c], rows(found.dense.a), rows(found.dense.powers)
    )
    numbers = (float(grow), float(found.damping), float(found.safety))
    return Tableau(*numbers, [float(c) for c in found.c], rows(found.a), rows(found.errors), dense)


METHODS = (
    Method("dop853", 8, tableau=table("dop853")),
    Method("rk4", 4, stepped=True, tableau=table("rk4")),
    Method("radau", 5, exact=True),
)


def dynamics(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray, out: np.ndarray) -> int:
    """x'' = −p x + u."""
    out[0], out[1] = x[1], u[0] - p[0] * x[0]
    return 0 if np.isfinite(out).all() else 3


def power(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray, out: np.ndarray) -> int:
    out[0] = u[0] * x[1]
    return 0


def position(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray, out: np.ndarray) -> int:
    """A guard that vanishes with x."""
    out[0] = x[0]
    return 0


class Shared:
    """Arguments as _shared.py of a module takes them."""

    FUNCTIONS: ClassVar = {
        "dynamics": ((2,), 2, "xup", "singular: of the oscillator", "not converged")
    }

    def real(self, name: str, letter: str, value: Any) -> np.ndarray:
        return np.asarray(value, float)

    DEFAULTS = np.array([1.0])

    def prepare(self, name: str, t: Any, x: Any, u: Any, p: Any, asked: str | None = None) -> Any:
        given = [np.asarray(v, float) for v in (t, x, u, [1.0] if p is None else p)]
        leads = [given[0].shape, *(value.shape[:-1] for value in given[1:])]
        return given, np.broadcast_shapes(*leads)


def fields(guards: int, *more: tuple[str, str, int]) -> tuple[tuple[str, str, int], ...]:
    entries = (*simulate.ENTRIES, *simulate.OF_INPUTS, *simulate.OF_EVENTS, *simulate.OF_CHARTS)
    head = [(name, LETTERS.get(kind, "P"), 0) for kind, name, _ in entries]
    names = ("guard", "guard_size", "guard_rate") if guards else ()
    return (*head, ("x", "", 3), ("slope", "", 3), *((name, "", guards) for name in names), *more)


def facts(**changes: Any) -> Facts:
    binding = SimpleNamespace(_dynamics=dynamics, _power=power, _guards=position)
    usual = Facts(
        name="oscillator",
        real=float,
        nx=2,
        nq=1,
        nz=0,
        inputs=("F",),
        parameters=(),
        methods=METHODS,
        enforcements=("none", "partitioning"),
        staged=("partitioning",),
        events=(),
        fields=fields(0),
        lengths={"velocity": 1, "constraints": 0, "power": 1, "kinks": 0, "project": 0},
        positions=0,
        guards=(0,),
        limits=LIMITS,
        shared=Shared(),
        numpy=lambda: binding,
    )
    return replace(usual, **changes)


def simulated(of: Facts, span: Any = (0.0, HALF), x: Any = START, **ways: Any) -> Simulation:
    def loop(
        state: Any, times: Any, u: Any, p: Any, rtol: float, atol: float, budget: int, *out: Any,
        fed: Any = None, buffers: Any = None,
    ) -> int:  # fmt: skip
        motion = Motion(of, state[0], u, p, rtol, atol, *(fed or (None, None)), buffers)
        return advance(motion, times, budget, out)

    usual: dict[str, Any] = {"u": None, "p": None, "times": None, "progress": None}
    usual |= {"rtol": 1e-10, "atol": 1e-12, "max_steps": 10_000}
    return run(of, Backend("numpy", loop, None, True), Request(span, x, **{**usual, **ways}))


@pytest.mark.parametrize(("name", "order"), [("rk4", 4), ("dop853", 8)])
def test_a_step_has_its_order(name: str, order: int) -> None:
    def missed(tableau: Tableau, h: float) -> float:
        start = np.array(START)
        slope = lambda t, y: np.array([y[1], -y[0]])  # noqa: E731
        step = Step(0.0, h, start, [slope(0.0, start)])
        z = step.arrival(tableau, slope)
        return float(np.abs(z - [np.cos(h), -np.sin(h)]).max())

    def rate(tableau: Tableau) -> float:
        return np.log2(missed(tableau, 0.5) / missed(tableau, 0.25))

    right = table(name)
    assert rate(right) > order + 0.5
    wrong = [*right.a[:-1], [weight * (1 + 1e-3) for weight in right.a[-1]]]
    assert rate(replace(right, a=wrong)) < 1.5


def test_a_motion_is_that_of_the_closed_form() -> None:
    t = np.linspace(0.0, 20.0, 21)
    found = simulated(facts(), (0.0, 20.0), times=t)
    np.testing.assert_allclose(found.x, np.stack([np.cos(t), -np.sin(t)], axis=1), atol=1e-8)
    assert found.status == Status.OK and found.integrator == "dop853"
    pushed = simulated(facts(), (0.0, 20.0), times=t, u=[0.5])
    np.testing.assert_allclose(pushed.work, 0.5 * (pushed.x[:, 0] - 1.0), atol=1e-8)


def test_inputs_that_change() -> None:
    """A force F = t, by a table and by a function, and at sample times."""
    exact = np.cos(HALF) + HALF - np.sin(HALF)
    for u in (Table([0.0, 9.0], [[0.0], [9.0]]), lambda t, x: np.array([t])):
        assert simulated(facts(), u=u).x[-1, 0] == pytest.approx(exact, abs=1e-8)
    held = simulated(facts(), u=lambda t, x: np.array([t]), sample=1e-2, max_steps=10**6)
    assert held.x[-1, 0] == pytest.approx(exact, abs=2e-2)


def test_events_are_where_the_closed_form_says() -> None:
    events = {"down": Event(lambda t, x: x[0], -1), "end": Event(lambda t, x: x[0] + 0.5, 0, True)}
    found = simulated(facts(), (0.0, 9.0), events=events)
    assert found.status == Status.EVENT and found.events is not None
    np.testing.assert_allclose(found.events.t, [HALF / 2, 2 * HALF / 3], atol=1e-9)
    assert found.t[-1] == pytest.approx(2 * HALF / 3, abs=1e-9)


def test_guards_are_crossed_and_counted() -> None:
    guarded = facts(fields=fields(1), guards=(1,))
    found = simulated(guarded, (0.0, 10.0))
    assert found.crossings == 3
    np.testing.assert_allclose(found.x[-1], [np.cos(10.0), -np.sin(10.0)], atol=1e-8)


def test_whole_turns_are_taken_out_and_put_back() -> None:
    turning = facts(
        fields=fields(0, ("turns", "", 1)), turning=(0,), turn=(2 * np.pi, 2.4492935982947064e-16)
    )
    found = simulated(turning, (0.0, 10.0), [0.0, 3.0], p=[0.0])
    assert found.x[-1, 0] == pytest.approx(30.0, abs=1e-8)
    assert found.reduced is not None and abs(found.reduced[-1, 0]) < 2 * np.pi


class Mirror:
    """Chart 1 has the opposite rate; it is the better one from x = 0 on."""

    SUFFIXES = ("", "_chart1")
    BETTER = 2.0

    def margin(self, binding: Any, which: int, /, *state: Any) -> float:
        return 1.0

    def chart(self, binding: Any, /, *state: Any) -> int:
        return int(state[1][0] < 0)

    def transform(self, binding: Any, old: int, new: int, /, *state: Any) -> np.ndarray:
        x = np.array(state[1])
        return x if old == new else x * [1.0, -1.0]


def test_charts_take_over() -> None:
    def mirrored(t: Any, x: np.ndarray, u: Any, p: Any, out: np.ndarray) -> int:
        status = dynamics(t, x * [1.0, -1.0], u, p, out)
        out[1] *= -1.0
        return status

    binding = SimpleNamespace(_dynamics=dynamics, _dynamics_chart1=mirrored)
    binding.velocity = lambda t, x, u, p: x[1:]
    binding.velocity_chart1 = lambda t, x, u, p: -x[1:]
    lengths = {"velocity": 1, "constraints": 0, "power": 0, "kinks": 0, "project": 0}
    of = facts(numpy=lambda: binding, charts=Mirror(), guards=(0, 0), lengths=lengths)
    t = np.linspace(0.0, 9.0, 10)
    found = simulated(of, (0.0, 9.0), times=t)
    assert found.switches == 3 and found.chart is not None and set(found.chart) == {0, 1}
    np.testing.assert_allclose(found.x, np.stack([np.cos(t), -np.sin(t)], axis=1), atol=1e-8)


def test_many_are_those_alone_and_one_that_fails_fails_alone() -> None:
    x = np.array([[1.0, 0.0], [np.nan, 0.0], [0.0, 2.0]])
    with pytest.warns(RuntimeWarning, match="1 of 3 motions ended early, .* motion 1: not finite"):
        found = simulated(facts(), x=x)
    for row in (0, 2):
        np.testing.assert_array_equal(found.x[row], simulated(facts(), x=x[row]).x)
    assert np.isnan(found.x[1, 1]).all() and found.status.tolist() == [0, 3, 0]


def test_an_interrupt_gives_what_is_there() -> None:
    def stop(done: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.warns(RuntimeWarning, match="interrupted after 2 of 3 motions"):
        found = simulated(facts(), x=np.ones((3, 2)), progress=stop)
    assert found.status.tolist() == [0, 0, 5]


def test_the_companion_says_how_far_it_may_be() -> None:
    t = np.linspace(0.0, 20.0, 9)
    found = simulated(facts(), (0.0, 20.0), times=t, rtol=1e-7, atol=1e-9, error=True)
    apart = np.abs(found.x - np.stack([np.cos(t), -np.sin(t)], axis=1))
    assert found.error is not None and (apart <= found.error + 1e-15).all()


@pytest.mark.parametrize(
    ("ways", "message"),
    [
        ({"times": [2.0, 1.0]}, "finite times that do not decrease"),
        ({"times": [0.0, 40.0]}, r"times up to the end of t_span, \S+, got 40.0"),
        ({"rtol": 0.0}, "tolerances above zero"),
        ({"integrator": "euler"}, "has no integrator 'euler' here; it has dop853, rk4, radau"),
        ({"integrator": "rk4"}, "needs a step_size for rk4"),
        ({"integrator": "radau", "enforcement": "partitioning"}, "acts at every stage"),
        ({"integrator": "radau", "u": lambda t, x: 0.0}, "needs sample times for a function"),
        ({"sample": 0.1}, "no function as u that is to be asked"),
    ],
)
def test_what_cannot_be_is_refused(ways: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulated(facts(), **ways)


def test_a_stop_says_what_else_may_be_singular_under_its_enforcement() -> None:
    of = facts(stops={"partitioning": "its coordinates may be"})
    assert of.cause(Status.SINGULAR_CHOICE, 1).endswith("goes on; or its coordinates may be")
    assert of.cause(Status.SINGULAR_CHOICE, 0).endswith("goes on")
    assert of.cause(Status.SINGULAR, 1) == "singular: of the oscillator"


def test_what_needs_a_compiler_says_so() -> None:
    with pytest.raises(Stopped, match=r"oscillator.simulate stopped at t = 0\.0: .* code"):
        simulated(facts(), integrator="radau")


def test_a_change_of_coordinates_keeps_the_velocities() -> None:
    """To a millionth of the largest: where constraints depend on each other it would not."""
    motion: Any = SimpleNamespace(facts=facts())
    v = np.array([1.0, -2.0, 0.0])
    numpy_changes._check_same(motion, v, v * (1.0 + 1e-9))
    numpy_changes._check_same(motion, 0.0 * v, 0.0 * v)
    with pytest.raises(Failed):
        numpy_changes._check_same(motion, v, np.array([1.0, -2.0, 1e-3]))
