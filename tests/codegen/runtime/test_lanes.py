"""Motions side by side: rows are those of the loop for one motion, whatever goes beside them."""

from __future__ import annotations

import importlib
import re
import warnings
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.integrators import INTEGRATORS, Tableau
from codegen.passes import program
from codegen.passes.lanes import is_batched, side_by_side
from codegen.passes.taylor import SERIES, series_in_lanes
from derive.formulations import equations
from derive.model import load
from derive.states import system
from hamel.build.module import published
from tests.scenes import MODELS, derived, equations_of_text
from tests.toy import circle

pytestmark = [
    pytest.mark.optimised,
    pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler"),
]
EXPLICIT = (*(x.name for x in INTEGRATORS if isinstance(x, Tableau)), SERIES)
STEPS = {"rk4": 0.01}
# The weights of verner9's error estimate are large: in short steps it is rounding, and moves the
# sizes of the steps after it, so that two loops agree to the tolerance only.
AGREES = {"verner9": (1e-6, 1e-8)}
WOUND = """model: wound
coordinates: {q: rad}
kinetic: 1 kg*m^2*der(q)^2/2
potential: 1 J*cos(q) + 1e-9 J*q^2/2
"""
# One coordinate, and its acceleration, for each function of the C library.
LIBRARIES = """model: libraries
coordinates: {a: rad, b: rad, c: rad}
kinetic: 1 kg*m^2*(der(a)^2 + der(b)^2 + der(c)^2)/2
loads:
  first: {type: expression, coordinate: a, expression: "min(1e9, max(cosh(a), 5))*1 N*m"}
  second: {type: expression, coordinate: b, expression: "atan2(a, b)*1 N*m"}
  third: {type: expression, coordinate: c, expression: "min(1e9, max(-1e9, sinh(b)))*1 N*m"}
"""
PAIRS = [
    pytest.param(name, enforcement, marks=[pytest.mark.slow] if name == "snake3" else [])
    for name, enforcements in {
        "circle": ("projection", "none"),
        "four_bar": ("projection", "none"),
        "pendulum": ("none",),
        "snake3": ("none",),
    }.items()
    for enforcement in enforcements
]


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ModuleType]:
    """By name, each built when it is first asked for."""
    base = tmp_path_factory.mktemp("lanes")

    class Modules(dict[str, ModuleType]):
        def __missing__(self, name: str) -> ModuleType:
            made = program(circle() if name == "circle" else derived(name), None, (*EXPLICIT,))
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
                return self.setdefault(name, loader.load(published(made, base / name).folder))

    return Modules()


def starts(name: str, count: int) -> np.ndarray:
    """Consistent states with velocities spread out."""
    random = np.random.default_rng(3)
    if name == "circle":
        angle = random.uniform(0.0, 6.0, count)
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    made = program(derived(name))
    x = np.tile(made.nominal, (count, 1))
    x[:, -len(made.quasi_velocities) :] += random.normal(
        scale=3.0, size=(count, len(made.quasi_velocities))
    )
    return x


def tolerances(integrator: str) -> dict[str, Any]:
    step = {"step_size": STEPS[integrator]} if integrator in STEPS else {}
    return {"integrator": integrator, "rtol": 1e-8, "atol": 1e-10, **step}


@pytest.mark.parametrize(("name", "enforcement"), PAIRS)
@pytest.mark.parametrize("integrator", EXPLICIT)
def test_rows_are_those_of_one_motion(
    modules: dict[str, ModuleType], name: str, enforcement: str, integrator: str
) -> None:
    module, x = modules[name], starts(name, 21)
    how = {**tolerances(integrator), "enforcement": enforcement, "times": [0.2, 0.2, 1.7]}
    many = module.simulate((0.0, 1.7), x, **how)
    assert many.x.shape == (21, 3, module.nx) and many.work.shape == (21, 3)
    assert not many.status.any()
    for k in range(21):
        one = module.simulate((0.0, 1.7), x[k], **how)
        rtol, atol = AGREES.get(integrator, (1e-9, 1e-10))
        np.testing.assert_allclose(many.x[k], one.x, rtol=rtol, atol=atol)
        np.testing.assert_allclose(many.work[k], one.work, rtol=rtol, atol=10 * atol)
        assert abs(many.steps[k] - one.steps) <= 2 and abs(many.rejected[k] - one.rejected) <= 2
        # an error estimate of the size of rounding moves the step sizes a little, and with them
        # what the motion drifts: by no more than a hundredth of its tolerance
        for violation in ("position_violation", "velocity_violation"):
            wanted = pytest.approx(getattr(one, violation), rel=0.3, abs=0.01 * how["rtol"])
            assert getattr(many, violation)[k] == wanted


def test_these_go_side_by_side() -> None:
    """Else the tests above compare a loop with itself."""
    for e in (*map(derived, ("four_bar", "pendulum", "snake3")), circle()):
        assert side_by_side(program(e)) and series_in_lanes(program(e))


def test_reflections_go_side_by_side() -> None:
    """Blocks of pivots of the waveboard are solved by them: copysign and fmin are instructions."""
    assert is_batched(program(derived("waveboard"), ("dynamics",)).kernel("dynamics"))


@pytest.mark.parametrize("integrator", ["dop853", SERIES])
def test_neighbours_do_not_matter(modules: dict[str, ModuleType], integrator: str) -> None:
    """To the bit, in another order, on threads, and through ctypes."""
    module, x = modules["four_bar"], starts("four_bar", 50)
    order = np.random.default_rng(1).permutation(50)
    how = {"integrator": integrator}
    first = module.simulate((0.0, 1.0), x, **how)
    np.testing.assert_array_equal(module.simulate((0.0, 1.0), x[order], **how).x, first.x[order])
    np.testing.assert_array_equal(module.simulate((0.0, 1.0), x, threads=3, **how).x, first.x)
    simulate, library = (
        importlib.import_module(f"{module.__name__}.{name}") for name in ("_simulate", "_library")
    )
    given = ((0.0, 1.0), x, [0.0], None, 1e-9, 1e-11, None, 10**6, None)
    other = simulate.run(library.advance, "ctypes", *given, batch=library, **how)
    np.testing.assert_array_equal(other.x, first.x)


def test_numpy_gives_the_same(modules: dict[str, ModuleType]) -> None:
    module, x = modules["four_bar"], starts("four_bar", 3)
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    given = ((0.0, 1.0), x, [0.0], None, 1e-9, 1e-11, None, 10**6, None)
    slow = simulate.run(simulate.advance, "numpy", *given)
    np.testing.assert_allclose(slow.x, module.simulate((0.0, 1.0), x).x, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("integrator", ["dop853", SERIES])
def test_a_motion_that_fails_fails_alone(modules: dict[str, ModuleType], integrator: str) -> None:
    module, x = modules["four_bar"], starts("four_bar", 11)
    good = module.simulate((0.0, 0.5), x, integrator=integrator)
    x[4, 1] = np.nan
    ended = "1 of 11 motions ended early, .*; motion 4: "
    with pytest.warns(RuntimeWarning, match=ended) as seen:
        found = module.simulate((0.0, 0.5), x, integrator=integrator)
    assert seen[0].filename == __file__
    assert found.status[4] == module.Status.NOT_FINITE or found.status[4] in (1, 7)
    assert np.isnan(found.x[4]).sum() >= module.nx
    others = np.arange(11) != 4
    np.testing.assert_array_equal(found.x[others], good.x[others])
    assert not found.status[others].any()


def test_functions_of_the_library_are_right_for_all_states(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Near overflow too: a comparison would swallow what is no number."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = program(equations_of_text(LIBRARIES), ("dynamics",))
    assert is_batched(made.kernel("dynamics"))
    module = loader.load(published(made, tmp_path / "libraries").folder)
    ends = [0.0, -0.0, 1.0, -3.0, 709.5, 710.2, -710.4, 712.0, 1e300, -1.5e308, 1.7e308, 1e-310]
    x = np.zeros((len(ends) ** 2, 6))
    x[:, 0], x[:, 1] = np.repeat(ends, len(ends)), np.tile(ends, len(ends))
    with np.errstate(over="ignore"):
        first, third = np.clip(np.cosh(x[:, 0]), 5.0, 1e9), np.clip(np.sinh(x[:, 1]), -1e9, 1e9)
    wanted = np.stack([first, np.arctan2(x[:, 0], x[:, 1]), third], axis=-1)
    np.testing.assert_allclose(module.dynamics(0.0, x)[:, 3:], wanted, rtol=1e-15, atol=0.0)


def test_angles_that_are_too_large_go_alone(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A spring sees the turns of this angle: nothing takes them out. Shorter sines are right up to
    1e5 rad; beyond, a lane is done by the loop for one motion."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = program(equations_of_text(WOUND), None, ("dop853",))
    module = loader.load(published(made, tmp_path / "wound").folder)
    x = np.array([[angle, 0.3] for angle in (0.5, 9.9e4, 1.1e5, 3e15)])
    found = module.simulate((0.0, 0.5), x, rtol=1e-9, atol=1e-9)
    for k in range(4):
        one = module.simulate((0.0, 0.5), x[k], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.x[k, :, 1], one.x[:, 1], rtol=1e-12, atol=1e-13)


def test_a_projected_step_takes_its_last_slope_once(modules: dict[str, ModuleType]) -> None:
    """Behind the projection: twelve slopes a step of DOP853, where one motion takes thirteen."""
    module, x = modules["four_bar"], starts("four_bar", 8)
    how = {"integrator": "dop853", "step_size": 0.01, "enforcement": "projection"}
    many, one = module.simulate((0.0, 0.2), x, **how), module.simulate((0.0, 0.2), x[0], **how)
    assert many.steps[0] == one.steps == 20
    assert many.calls[0] == 1 + 12 * 20 and one.calls == 1 + 13 * 20
    np.testing.assert_allclose(many.x[0], one.x, rtol=1e-13, atol=1e-13)
    assert np.abs(module.constraints(0.2, many.x[:, -1])).max() < 1e-14


@pytest.mark.parametrize("integrator", ["dop853", SERIES])
def test_each_has_its_own_end(modules: dict[str, ModuleType], integrator: str) -> None:
    """Start and end by row, and states, inputs and parameters that broadcast."""
    module = modules["circle"]
    x, p = starts("circle", 3)[:, None, :], np.array([[1.0], [2.0]])
    ends = np.array([[0.0, 0.5], [0.25, 2.0], [1.0, 1.0]])[:, None, :]
    found = module.simulate(ends, x, [0.3], p, integrator=integrator)
    assert found.x.shape == (3, 2, 2, 2) and found.t.shape == (3, 1, 2)
    for i, k in np.ndindex(3, 2):
        one = module.simulate(ends[i, 0], x[i, 0], [0.3], p[k], integrator=integrator)
        np.testing.assert_allclose(found.x[i, k], one.x, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(found.work[i, k], one.work, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("integrator", ["dop853", SERIES])
def test_each_has_its_own_status(modules: dict[str, ModuleType], integrator: str) -> None:
    """A wall in time that only some come to; a budget of steps."""
    module, x = modules["circle"], starts("circle", 5)
    ends = np.array([[0.0, end] for end in (1.0, 20.0, 2.0, 8.0, 30.0)])
    with pytest.warns(RuntimeWarning, match="2 of 5 motions ended early"):
        found = module.simulate(ends, x, integrator=integrator)
    assert (found.status != 0).tolist() == [False, True, False, False, True]
    for k in (1, 4):
        with pytest.raises(module.Stopped) as stopped:
            module.simulate(ends[k], x[k], integrator=integrator)
        assert found.status[k] == stopped.value.partial.status
    with pytest.warns(RuntimeWarning, match="too many steps"):
        few = module.simulate((0.0, 5.0), x, max_steps=3, integrator=integrator)
    assert (few.status == module.Status.MORE).all() and (few.steps + few.rejected == 3).all()


@pytest.mark.parametrize("integrator", ["dop853", SERIES])
def test_events_between_rejected_steps_are_found(
    modules: dict[str, ModuleType], integrator: str
) -> None:
    """On the way to the wall, which no step may come too close to."""
    module, times = modules["circle"], 9.0 - 10.0 ** -np.arange(1.0, 6.0)
    events = {f"e{k}": _passes(t) for k, t in enumerate(times)}
    x = np.tile([1.0, 0.0], (11, 1))
    with pytest.warns(RuntimeWarning, match="11 of 11 motions ended early"):
        found = module.simulate((0.0, 20.0), x, None, [1.0], events=events, integrator=integrator)
    assert found.rejected.min() > 1
    for k, t in enumerate(times):
        met = found.events.of(f"e{k}").t
        np.testing.assert_allclose(met[np.abs(met - t) < 1.0], np.full(11, t), atol=1e-7)


def _passes(angle: float) -> Any:
    return lambda t, x: np.cos(angle) * x[1] - np.sin(angle) * x[0]


def test_bad_arguments(modules: dict[str, ModuleType]) -> None:
    module, x = modules["circle"], starts("circle", 4)
    for given in (
        {"t_span": [[0.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]},
        {"t_span": np.zeros((3, 2))},
        {"t_span": (0.0, np.nan)},
        {"t_span": np.zeros((4, 0))},
        {"t_span": (0.0, 1.0), "times": np.full((4, 2), -1.0)},
        {"t_span": (0.0, 1.0), "u": np.zeros((5, 1))},
    ):
        with pytest.raises(ValueError, match=r"needs|broadcast"):
            module.simulate(**{"x": x, **given})
    with pytest.raises(ValueError, match=r"broadcast together, got x \(4,\), u \(5,\)"):
        module.simulate((0.0, 1.0), x, np.zeros((5, 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert module.simulate((0.0, 1.0), x[:0]).x.shape == (0, 2, 2)


@pytest.mark.parametrize("threads", [1, 3])
def test_progress_and_interrupts(modules: dict[str, ModuleType], threads: int) -> None:
    module, x = modules["circle"], starts("circle", 3_000)
    seen: list[int] = []
    found = module.simulate((0.0, 0.1), x, progress=seen.append, threads=threads)
    assert len(seen) > 1 and seen == sorted(seen) and seen[-1] == 3_000
    np.testing.assert_array_equal(found.x, module.simulate((0.0, 0.1), x).x)

    def stop(done: int) -> None:
        raise KeyboardInterrupt

    with pytest.warns(RuntimeWarning, match="interrupted after") as warned:
        part = module.simulate((0.0, 0.1), x, step_size=1e-4, progress=stop, threads=threads)
    done = part.status == 0
    said = [str(warning.message) for warning in warned]
    assert len(said) == 1 and f"after {done.sum()} of 3000" in said[0]  # not that others failed
    assert (
        0 < done.sum() < 3_000 and np.isfinite(part.x[done]).all() and np.isnan(part.x[~done]).all()
    )


def test_what_is_wrong_on_one_thread_ends_the_others(
    modules: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    module, x = modules["circle"], starts("circle", 20_000)
    queue = importlib.import_module(f"{module.__name__}._many_motions").Queue
    compiled, begun = queue.compiled, list[int]()

    def failing(self: Any, room: np.ndarray, first: int, last: int) -> None:
        begun.append(last - first)
        if first == 0:
            raise MemoryError
        compiled(self, room, first, last)

    monkeypatch.setattr(queue, "compiled", failing)
    with pytest.raises(MemoryError):
        module.simulate((0.0, 0.1), x, step_size=1e-4, threads=2)
    assert sum(begun) < 10_000


@pytest.mark.slow
def test_what_goes_one_by_one_is_the_same(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Implicit methods behind the same call: to the bit."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = program(derived("four_bar"), None, ("radau",))
    module, x = loader.load(published(made, tmp_path / "four_bar").folder), starts("four_bar", 5)
    found = module.simulate((0.0, 0.4), x, rtol=1e-7, integrator="radau")
    rows = [module.simulate((0.0, 0.4), row, rtol=1e-7, integrator="radau").x for row in x]
    np.testing.assert_array_equal(found.x, rows)


@pytest.mark.parametrize("width", [2, 8])
def test_other_widths_give_the_same_rows(
    modules: dict[str, ModuleType], tmp_path: Any, width: int
) -> None:
    """As on processors with longer and shorter vectors: the compiler makes several of one."""
    for name, text in emit(
        program(derived("four_bar"), None, ("dop853", "dopri5", SERIES))
    ).items():
        if name.endswith("_lanes.h"):
            text = re.sub(r"LANES = \d+", f"LANES = {width}", text)
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = compiler.find_compiler()
    assert command
    compiler.compile_folder(tmp_path, "four_bar", command)
    module, x = loader.load(tmp_path), starts("four_bar", 13)
    for how in ({}, {"enforcement": "none", "integrator": "dopri5"}, {"integrator": SERIES}):
        wide, usual = (m.simulate((0.0, 1.0), x, **how) for m in (module, modules["four_bar"]))
        assert module.backend == "extension" and not wide.status.any()
        np.testing.assert_allclose(wide.x, usual.x, rtol=1e-9, atol=1e-10)


def test_work_is_summed_up_where_a_force_does_any() -> None:
    """A disk that rolls without losses has a power, which is zero whatever it does."""
    flags = {
        name: dict(re.findall(r"#define (HAS_\w+) (\d)", _simulate_of(name)))
        for name in ("rolling_disk", "snake3")
    }
    assert [flags[name]["HAS_POWER"] for name in flags] == ["0", "1"]
    assert [flags[name]["HAS_LANES_SLOPE"] for name in flags] == ["0", "1"]
    assert [flags[name]["HAS_LANES_RATES"] for name in flags] == ["1", "1"]


def _simulate_of(name: str) -> str:
    return emit(program(derived(name), None, EXPLICIT))[f"{name}_simulate.c"]


def test_comparisons_in_lanes_are_defined_where_they_are_called() -> None:
    """Also where dynamics alone compare: wishbones."""
    found = equations(system(load(MODELS / "gallery" / "wishbones.yaml")))
    texts = emit(program(found, ("dynamics",)))
    batch = next(text for name, text in texts.items() if name.endswith("_batch.c"))
    called = set(re.findall(r"(LARGER|SMALLER)\(", batch))
    assert called
    for name in called:
        assert f"INLINE double {name}(double a, double b)" in batch


def test_what_is_not_a_number_is_called_so_in_a_loop_too(modules: dict[str, ModuleType]) -> None:
    """And not a singular position, which every position that is none looks like."""
    module, x = modules["four_bar"], starts("four_bar", 3)
    x[1, 0] = np.nan
    with pytest.warns(RuntimeWarning, match="not finite"):
        many = module.simulate((0.0, 0.1), x)
    assert many.status.tolist() == [0, 3, 0]
    with pytest.raises(FloatingPointError, match="not finite"):
        module.simulate((0.0, 0.1), x[1])


def test_no_thread_is_refused(modules: dict[str, ModuleType]) -> None:
    with pytest.raises(ValueError, match="one thread or more, got threads=0"):
        modules["four_bar"].simulate((0.0, 0.1), starts("four_bar", 2), threads=0)
