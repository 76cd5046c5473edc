"""Events: found where closed forms say, by every integrator, in C, ctypes and NumPy; pairs within a
step; stops; the motion between them untouched; and what becomes of bad ones."""

from __future__ import annotations

import functools
import importlib
import subprocess
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.integrators import INTEGRATORS, Tableau
from codegen.integrators.records import centred, collocated
from codegen.passes import program
from derive.formulations.derivatives import derivatives
from hamel.build.module import published
from tests.scenes import derived, equations_of_text

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
# x'' = −x + F; rises and falls of the model's own
SPRING = """model: spring
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
potential: 1 N/m*x^2/2
inputs: {F: {unit: N}}
forces: {x: F}
outputs: {twice: 2*x}
events:
  middle: x
  up: {formula: twice - 1 m, direction: rising}
  late: {formula: t - 19.5 s, stop: true}
"""
NAMES = tuple(x.name for x in INTEGRATORS)
HOW = {"rtol": 1e-11, "atol": 1e-13}
STEPPED = {"rk4": 0.01, "implicit_midpoint": 0.002}
# of the times, which is that of the motion itself
REACHES = {"rk4": 2e-8, "rosenbrock": 1e-9, "implicit_midpoint": 1e-5}


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ModuleType]:
    base = tmp_path_factory.mktemp("events")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        spring = equations_of_text(SPRING)
        wanted = [x.name for x in derivatives(spring.arguments, spring.functions)]
        programs = {
            "spring": program(spring, ("default", *wanted), NAMES),
            "four_bar": program(derived("four_bar")),
        }
        return {
            name: loader.load(published(made, base / name).folder)
            for name, made in programs.items()
        }


@pytest.fixture
def spring(modules: dict[str, ModuleType]) -> ModuleType:
    return modules["spring"]


def by(module: ModuleType, way: str, *given: Any, **how: Any) -> Any:
    """simulate() by ctypes or NumPy."""
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    ways = {
        "numpy": simulate.advance,
        "ctypes": importlib.import_module(f"{module.__name__}._library").advance,
    }
    tolerances = (how.pop("rtol", 1e-9), how.pop("atol", 1e-11))
    u = how.pop("u", None)
    return simulate.run(ways[way], way, *given, u, None, *tolerances, None, 10**6, None, **how)


def stepping(integrator: str) -> dict[str, Any]:
    step = {"step_size": STEPPED[integrator]} if integrator in STEPPED else {}
    return {**HOW, "integrator": integrator, **step}


@pytest.mark.parametrize("integrator", NAMES)
def test_events_are_where_the_closed_form_says(spring: ModuleType, integrator: str) -> None:
    """x = cos t; up at 2 x = 1 rising; the motion ends at t = 19.5 exactly, with a row."""
    motion = spring.simulate((0.0, 30.0), [1.0, 0.0], **stepping(integrator))
    within = REACHES.get(integrator, 1e-9)
    middle, up = motion.events.of("middle"), motion.events.of("up")
    np.testing.assert_allclose(middle.t, np.pi / 2 + np.pi * np.arange(6), atol=within)
    np.testing.assert_allclose(up.t, 2 * np.pi * np.array([1, 2, 3]) - np.pi / 3, atol=within)
    assert np.abs(middle.x[:, 0]).max() < 1e-14 and np.abs(up.x[:, 0] - 0.5).max() < 1e-14
    assert motion.status == spring.Status.EVENT
    assert motion.t.tolist() == [0.0, 19.5] and motion.x.shape == (2, 2)
    assert motion.x[-1, 0] == pytest.approx(np.cos(19.5), abs=10 * within)


IN_C = r"""#include <stdio.h>
#include "spring_simulate.h"
static int top(double t, const double *x, double *out, void *data)
{ (void)t, (void)data; out[0] = x[0] - 0.9999; return 0; }
static void ended(spring_watch watch)
{
    double times[1] = {30.0}, u[1] = {0.0}, row[2];
    spring_simulation motion = {.x = {1.0, 0.0}, .events = &watch};
    int status = spring_simulate(&motion, 1, times, u, NULL, 1e-11, 1e-13, 99999, row, NULL), count[4] = {0};
    for (size_t k = 0; k < watch.n; k++)
        count[watch.which[k]]++;
    printf("%d %.9g %d %d %d %d\n", status, motion.t, count[0], count[1], count[2], count[3]);
}
int main(void)
{
    static double t[300], x[600];
    static int which[300], sign[4];
    printf("%d %d\n", spring_event_direction[1], spring_event_stop[2]);
    ended((spring_watch){.sign = sign});
    ended((spring_watch){.sign = sign, .room = 300, .t = t, .x = x, .which = which});
    ended((spring_watch){.sign = sign, .room = 300, .t = t, .x = x, .which = which, .count = 1, .call = top});
    ended((spring_watch){0});
    ended((spring_watch){.sign = sign, .count = 1});
    ended((spring_watch){.sign = sign, .count = 64, .call = top});
    return 0;
}
"""


def test_without_more_a_watch_in_c_is_what_the_model_says(
    spring: ModuleType, tmp_path: Path
) -> None:
    """Seen: NULL as direction and stop ended the program; they had to be copied from the model."""
    (tmp_path / "main.c").write_text(IN_C)
    command, folder = compiler.find_compiler(), Path(str(spring.__file__)).parent.resolve()
    assert command is not None
    library = folder / compiler.shared_library("spring")
    make = [*command, f"-I{folder}", "main.c", str(library), "-lm", "-o", "main"]
    subprocess.run(make, cwd=tmp_path, check=True)
    run = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines() == [
        "1 1",
        "11 19.5 0 0 0 0",
        "11 19.5 6 3 1 0",
        "11 19.5 6 3 1 7",
        *["10 0 0 0 0 0"] * 3,
    ]


@pytest.mark.parametrize("integrator", NAMES)
def test_pairs_closer_than_a_step_are_seen(spring: ModuleType, integrator: str) -> None:
    """x rises above 0.9999 for 0.028 s a turn: a small part of a step of dop853."""
    how = {**stepping(integrator), "events": {"top": lambda t, x: x[0] - 0.9999}}
    motion = spring.simulate((0.0, 19.0), [1.0, 0.0], **how)
    a = np.arccos(0.9999)
    turns = 2 * np.pi * np.arange(1, 4)
    wanted = np.sort([a, *(turns - a), *(turns + a)])
    top = motion.events.of("top").t
    np.testing.assert_allclose(top, wanted, atol=1e3 * REACHES.get(integrator, 1e-9))


def test_looking_leaves_the_motion_as_it_is(spring: ModuleType) -> None:
    """To the bit, steps and all."""
    for integrator in NAMES:
        how = {**stepping(integrator), "times": np.linspace(0.0, 18.0, 13)}
        seen = spring.simulate((0.0, 18.0), [1.0, 0.0], **how)
        plain = spring.simulate((0.0, 18.0), [1.0, 0.0], events=False, **how)
        np.testing.assert_array_equal(seen.x, plain.x, err_msg=integrator)
        assert (seen.steps, seen.rejected) == (plain.steps, plain.rejected)
        assert plain.events is None


@pytest.mark.parametrize("way", ["ctypes", "numpy"])
@pytest.mark.parametrize("integrator", [x.name for x in INTEGRATORS if isinstance(x, Tableau)])
def test_every_way_finds_the_same(spring: ModuleType, way: str, integrator: str) -> None:
    how = {**HOW, "integrator": integrator, "rtol": 1e-8, "atol": 1e-10}
    how |= {"step_size": 0.1} if integrator == "rk4" else {}
    how |= {"events": {"low": spring.Event(lambda t, x: x[0] + 0.999, -1)}}
    first = spring.simulate((0.0, 30.0), [1.0, 0.0], **how)
    other = by(spring, way, (0.0, 30.0), [1.0, 0.0], **how)
    assert first.events.names == other.events.names == ("middle", "up", "late", "low")
    np.testing.assert_array_equal(first.events.which, other.events.which)
    np.testing.assert_allclose(first.events.t, other.events.t, atol=1e-10)
    np.testing.assert_allclose(first.x[-1], other.x[-1], atol=1e-10)


def test_states_at_events_are_on_the_constraints(modules: dict[str, ModuleType]) -> None:
    module = modules["four_bar"]
    x = np.array(program(derived("four_bar")).nominal)
    for way in ("C", "numpy"):
        events = {"turn": module.Event(lambda t, x: np.sin(x[0]), 1)}
        run = module.simulate if way == "C" else functools.partial(by, module, way)
        motion = run((0.0, 3.0), x, events=events)
        assert len(motion.events.t) > 2
        assert np.abs(module.constraints(0.0, motion.events.x)).max() < 1e-13
        # angles come with their whole turns
        turns = motion.events.x[:, 0] / (2 * np.pi)
        np.testing.assert_allclose(turns, np.arange(1, 1 + len(turns)), atol=1e-12)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_each_of_many_motions_has_its_own(spring: ModuleType, integrator: str) -> None:
    x = np.stack([np.linspace(0.6, 2.0, 40), np.zeros(40)], axis=-1)
    how = {"integrator": integrator}
    many = spring.simulate((0.0, 25.0), x.reshape(4, 10, 2), threads=2, **how)
    assert (many.status == spring.Status.EVENT).all() and many.status.shape == (4, 10)
    for k in (0, 17, 39):
        one = spring.simulate((0.0, 25.0), x[k], **how)
        mine = many.events.row == k
        np.testing.assert_allclose(many.events.t[mine], one.events.t, atol=1e-9)
        np.testing.assert_array_equal(many.events.which[mine], one.events.which)


@pytest.mark.parametrize("way", ["C", "numpy", "sampled", "table"])
def test_a_stopped_one_of_many_ends_as_it_does_alone(spring: ModuleType, way: str) -> None:
    """With its state, work and inputs of the event in all rows that are left; others go on."""
    x, times = np.array([[1.0, 0.0], [0.2, 0.1]]), np.array([0.0, 1.0, 5.0, 9.0])
    table = spring.Table([0.0, 2.0, 9.0], [0.4, 0.2, 0.5])
    u = {"sampled": lambda t, x: 0.3 + 0.1 * x[..., :1], "table": {"F": table}}.get(way, [0.3])
    how = {"times": times, "events": {"low": spring.Event(lambda t, x: x[0] + 0.1, stop=True)}}
    how |= {"sample": 0.3} if way == "sampled" else {}
    if way == "numpy":
        tolerances = (1e-10, 1e-12, times, 10**6, None)

        def run(x: Any) -> Any:
            simulate = importlib.import_module(f"{spring.__name__}._simulate")
            asked = ((0.0, 9.0), x, u, None, *tolerances)
            return simulate.run(simulate.advance, "numpy", *asked, events=how["events"])
    else:
        run = functools.partial(spring.simulate, (0.0, 9.0), u=u, **how)
    many, one, other = run(x=x), run(x=x[0]), run(x=x[1])
    assert many.status.tolist() == [spring.Status.EVENT, spring.Status.OK] and len(one.t) == 3
    assert abs(one.work[-1]) > 0.1
    for name in ("x", "work", "u"):
        rows = getattr(many, name)
        if rows is None:
            continue
        np.testing.assert_allclose(rows[0, [0, 1, 2]], getattr(one, name), atol=1e-8)
        np.testing.assert_array_equal(rows[0, 3], rows[0, 2])
        np.testing.assert_allclose(rows[1], getattr(other, name), atol=1e-8)


@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
@pytest.mark.parametrize("integrator", ["dop853", "verner9", "dopri5"])
def test_what_hardly_happens_is_seen_in_lanes(
    spring: ModuleType, integrator: str, rtol: float
) -> None:
    """Levels that a motion comes just up to, and just beyond for less than a step: the first look
    of lanes, at a rougher polynomial, leaves out no event that one motion has."""
    beyond = np.concatenate([-np.logspace(-9, -1, 9), np.logspace(-9, -1, 23)])
    x = np.stack([np.full(32, 0.1), np.sqrt((0.5 + beyond) ** 2 - 0.01)], axis=-1)
    how = {"integrator": integrator, "rtol": rtol, "atol": rtol / 100}
    many = spring.simulate((0.0, 19.0), x, **how)
    happened = 0
    for k in range(32):
        one, mine = spring.simulate((0.0, 19.0), x[k], **how), many.events.row == k
        np.testing.assert_array_equal(many.events.which[mine], one.events.which)
        happened += int((one.events.which == 1).sum())
    assert 0 < happened < 32 * 3


def test_a_first_look_takes_no_slopes(spring: ModuleType) -> None:
    """Where nothing is near, the stages of the continuous output are not made."""
    x = np.tile([0.1, 0.1], (8, 1))
    many = spring.simulate((0.0, 1.0), x, integrator="verner9", step_size=0.05)
    assert (many.calls <= 1 + 16 * 20).all()


def test_events_between_samples_of_a_controller(spring: ModuleType) -> None:
    """A switching force; sign changes just at a sample are not lost."""

    def push(t: float, x: np.ndarray) -> np.ndarray:
        return np.where(np.sin(3 * t) > 0, 1.0, -1.0) * np.ones_like(x[..., :1])

    one = spring.simulate((0.0, 15.0), [1.0, 0.0], push, sample=0.1)
    fine = spring.simulate(
        (0.0, 15.0), [1.0, 0.0], push, sample=0.1, times=np.linspace(0, 15, 15001)
    )
    changes = np.flatnonzero(np.diff(np.sign(fine.x[:, 0])))
    found = one.events.of("middle").t
    assert len(found) == len(changes)
    np.testing.assert_allclose(found, fine.t[changes], atol=1e-3)
    x = np.tile([1.0, 0.0], (5, 1))
    many = spring.simulate((0.0, 15.0), x, push, sample=0.1)
    np.testing.assert_allclose(
        many.events.of("middle").t[many.events.of("middle").row == 3], found, atol=1e-9
    )


# Edges
# ---------------------------------------------------------------------------------------------------


def test_an_event_at_the_start_counts_when_it_comes_again(spring: ModuleType) -> None:
    motion = spring.simulate((0.0, 7.0), [0.0, 1.0])
    np.testing.assert_allclose(motion.events.of("middle").t, [np.pi, 2 * np.pi], atol=1e-8)
    stop = {"back": spring.Event(lambda t, x: x[0], stop=True)}
    motion = spring.simulate((0.0, 7.0), [0.0, 1.0], events=stop)
    assert motion.t[-1] == pytest.approx(np.pi, abs=1e-8)


@pytest.mark.parametrize("many", [1000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_ten_thousand_events_are_all_there(spring: ModuleType, many: int) -> None:
    events = {"often": lambda t, x: np.sin(np.pi * (t - 0.0005) * 1e3)}
    motion = spring.simulate(
        (0.0, many / 1000), [1.0, 0.0], events=events, integrator="rk4", step_size=5e-4
    )
    often = motion.events.of("often").t
    np.testing.assert_allclose(often, 0.0005 + 1e-3 * np.arange(len(often)), atol=1e-12)
    assert len(often) == many


def test_too_many_are_a_status_and_nothing_is_lost(
    spring: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = importlib.import_module(f"{spring.__name__}._events")
    monkeypatch.setattr(events, "MOST_EVENTS", 100)
    events = {"often": lambda t, x: np.sin(1e3 * t)}
    how = {"events": events, "integrator": "rk4", "step_size": 1e-3}
    with pytest.raises(
        spring.Stopped, match=r"too many events.*'often' happened \d+ times"
    ) as caught:
        spring.simulate((0.0, 10.0), [1.0, 0.0], **how)
    part = caught.value.partial
    assert part.status == spring.Status.FULL and len(part.events.t) >= 100
    assert (np.diff(part.events.t) > 0).all()


@pytest.mark.parametrize("way", ["C", "numpy"])
def test_functions_that_fail_are_a_status(spring: ModuleType, way: str) -> None:
    def raises(t: float, x: np.ndarray) -> float:
        if t > 2.0:
            raise KeyError("gone")
        return float(x[0])

    run = spring.simulate if way == "C" else functools.partial(by, spring, way)
    for function in (raises, lambda t, x: np.nan if t > 2.0 else x[0]):
        with pytest.raises(spring.Stopped, match="an event could not be looked for") as caught:
            run((0.0, 9.0), [1.0, 0.0], events={"bad": function})
        part = caught.value.partial
        assert part.status == spring.Status.NO_EVENT
        np.testing.assert_allclose(part.events.of("bad").t, [np.pi / 2], atol=1e-8)
    with pytest.warns(RuntimeWarning, match="3 of 3 motions ended early.*event.*gone"):
        spring.simulate((0.0, 9.0), np.tile([1.0, 0.0], (3, 1)), events={"bad": raises})


@pytest.mark.parametrize(
    ("events", "said"),
    [
        ({"a": 1.0}, "a function"),
        ({"middle": lambda t, x: x[0]}, "has an event 'middle' already"),
        ({str(k): (lambda t, x: x[0]) for k in range(70)}, "64 events at most"),
    ],
)
def test_what_makes_no_sense_is_refused(spring: ModuleType, events: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        spring.simulate((0.0, 1.0), [1.0, 0.0], events=events)
    with pytest.raises(ValueError, match="-1, 0 or 1"):
        spring.simulate((0.0, 1.0), [1.0, 0.0], events={"a": spring.Event(lambda t, x: 1.0, 2)})


# Continuous output
# ---------------------------------------------------------------------------------------------------


@functools.cache
def trees(nodes: int) -> list[tuple]:
    """Rooted trees of so many nodes, each a tuple of its branches."""
    if nodes == 1:
        return [()]

    def branches(left: int, most: int) -> list[list[tuple]]:
        if left == 0:
            return [[]]
        return [
            [tree, *rest]
            for size in range(1, min(left, most) + 1)
            for tree in trees(size)
            for rest in branches(left - size, size)
        ]

    return sorted({tuple(sorted(found)) for found in branches(nodes - 1, nodes - 1)})


def nodes(tree: tuple) -> int:
    return 1 + sum(map(nodes, tree))


def density(tree: tuple) -> int:
    return nodes(tree) * int(np.prod([density(branch) for branch in tree], initial=1))


@pytest.mark.parametrize("method", [x for x in INTEGRATORS if isinstance(x, Tableau) and x.dense])
def test_continuous_output_has_its_order(method: Tableau) -> None:
    """Σ b_i(θ) φ_i = θ^n / γ for every rooted tree of n ≤ order nodes, and order ≥ that of the step − 1."""
    dense = method.dense
    assert dense is not None and dense.order >= method.order - 1
    rows = [*method.a, *dense.a]
    size = len(rows)
    A = np.array([[float(x) for x in (*row, *[0] * (size - len(row)))] for row in rows])
    powers = np.array([[float(x) for x in row] for row in dense.powers])

    @functools.cache
    def weights(tree: tuple) -> Any:
        return np.prod([np.ones(size), *(A @ weights(branch) for branch in tree)], axis=0)

    for n in range(1, dense.order + 1):
        for tree in trees(n):
            wanted = np.zeros(len(powers))
            wanted[n - 1] = 1 / density(tree)
            np.testing.assert_allclose(powers @ weights(tree), wanted, atol=1e-11)


def test_the_same_polynomials_about_the_middle() -> None:
    rows = tuple((Fraction(k + 1), Fraction(1, k + 1)) for k in range(5))
    for theta in (Fraction(0), Fraction(1, 3), Fraction(1)):
        sigma = 2 * theta - 1
        for i in range(2):
            plain = sum(row[i] * theta**k for k, row in enumerate(rows))
            assert plain == sum(row[i] * sigma**k for k, row in enumerate(centred(rows)))
    c = (Fraction(1, 4), Fraction(1))
    through = collocated(c)
    values = [
        [sum(row[i] * x**k for k, row in enumerate(through)) for i in range(2)] for x in (0, *c)
    ]
    assert values == [[0, 0], [1, 0], [0, 1]]


@pytest.mark.parametrize("way", ["", "ctypes", "numpy"])
def test_all_that_happens_at_the_instant_of_a_stop_is_told(spring: ModuleType, way: str) -> None:
    """What stood behind the stop in the list was told neither there nor by the motion that goes on
    from there, which begins at zero."""

    def crossing(_: float, x: np.ndarray) -> float:
        return float(x[0]) - 0.3

    events = {
        "first": crossing,
        "ends": spring.Event(crossing, stop=True),
        "then": crossing,
        "later": lambda t, x: float(x[0]) - 0.2,
    }
    given = ([0.0, 5.0], [1.0, 0.0])
    call = functools.partial(by, spring, way) if way else spring.simulate
    result = call(*given, u=[0.0], events=events, **HOW)
    found = {name: result.events.of(name).t.tolist() for name in events}
    time = float(np.arccos(0.3))
    for name in ("first", "ends", "then"):
        assert found[name] == [pytest.approx(time, abs=1e-9)], name
    assert found["later"] == []
