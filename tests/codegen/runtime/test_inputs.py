"""Inputs that change: tables exact at their knots, functions at sample times or at every stage, the
same in C, ctypes and NumPy, one by one and in lanes; and what becomes of bad ones."""

from __future__ import annotations

import ctypes
import importlib
import itertools
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from codegen import compiler, loader
from codegen.integrators import INTEGRATORS, Tableau, Taylor
from codegen.passes import program
from codegen.runtime.inputs import Table, pieces, sample_times, source
from derive.formulations.derivatives import derivatives
from hamel.build.module import published
from tests.scenes import equations_of_text

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
# m x'' = F, and a second input that damps
CART = """model: cart
coordinates: {x: m}
parameters: {mass: 1 kg}
kinetic: mass*der(x)^2/2
inputs: {F: {unit: N}, brake: {unit: N*s/m}}
forces: {x: F - brake*der(x)}
"""
KNOTS = np.array([0.0, 0.3, 0.5, 1.1, 1.2, 2.0])
VALUES = np.array([1.0, -2.0, 0.5, 3.0, 3.0, -1.0])
NAMES = tuple(x.name for x in INTEGRATORS)
STEPPED = {"rk4": 0.01, "implicit_midpoint": 0.001}
# What the step or the tolerance allows; rk4 integrates cubics exactly.
REACHES = {"rk4": 1e-12, "implicit_midpoint": 1e-5, "rosenbrock": 1e-6}


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("inputs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        equations = equations_of_text(CART)
        wanted = derivatives(equations.arguments, equations.functions)
        made = program(equations, ("default", *(x.name for x in wanted)), NAMES)
        return loader.load(published(made, base / "cart").folder)


def ways(module: ModuleType) -> dict[str, Any]:
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    library = importlib.import_module(f"{module.__name__}._library")
    return {"numpy": simulate.advance, "ctypes": library.advance}


def by(module: ModuleType, way: str, t: Any, x: Any, u: Any, **how: Any) -> Any:
    """simulate() by another way than the extension."""
    run = importlib.import_module(f"{module.__name__}._simulate").run
    return run(ways(module)[way], way, t, x, u, None, 1e-9, 1e-11, None, 10**6, None, **how)


def reference(kind: str) -> Any:
    """The table by another library, or in closed form."""
    if kind == "cubic":
        return CubicSpline(KNOTS, VALUES)
    if kind == "linear":
        return lambda t: np.interp(t, KNOTS, VALUES)
    return lambda t: VALUES[np.clip(np.searchsorted(KNOTS, t, "right") - 1, 0, None)]


def exact(kind: str, at: float) -> tuple[float, float]:
    """x and der(x) of a mass of 1 kg that starts at rest: integrals by Gauss from knot to knot."""
    f, (s, weights) = reference(kind), np.polynomial.legendre.leggauss(8)
    edges = [*KNOTS[at > KNOTS], at]
    position = speed = 0.0
    for a, b in itertools.pairwise(edges):
        t, w = a + (b - a) * (s + 1) / 2, weights * (b - a) / 2
        position += w @ (f(t) * (at - t))
        speed += w @ f(t)
    return position, speed


@pytest.mark.parametrize("kind", ["hold", "linear", "cubic"])
@pytest.mark.parametrize("integrator", NAMES)
def test_tables_drive_as_their_integrals_say(cart: ModuleType, kind: str, integrator: str) -> None:
    """Jumps and bends are met exactly, for every integrator, from a start other than 0 too."""
    how = {"step_size": STEPPED[integrator]} if integrator in STEPPED else {}
    table = cart.Table(KNOTS, VALUES, kind)
    motion = cart.simulate(
        (0.0, 2.0), [0.0, 0.0], {"F": table}, times=[0.2, 0.7, 2.0], integrator=integrator, **how
    )
    wanted = np.array([exact(kind, t) for t in motion.t])
    np.testing.assert_allclose(motion.x, wanted, atol=REACHES.get(integrator, 1e-8))
    np.testing.assert_allclose(motion.u[:, 0], reference(kind)(motion.t), rtol=1e-14)
    late = cart.simulate((0.7, 2.0), motion.x[1], {"F": table}, integrator=integrator, **how)
    np.testing.assert_allclose(late.x[-1], wanted[-1], atol=REACHES.get(integrator, 1e-8))


def test_without_knots_as_ends_of_steps_a_jump_is_smeared(cart: ModuleType) -> None:
    """The same table behind a function: the test above can fail."""
    f = reference("hold")
    how = {"integrator": "rk4", "step_size": 0.04}
    through = cart.simulate((0.0, 2.0), [0.0, 0.0], lambda t, x: [f(t), 0.0], **how)
    tabled = cart.simulate((0.0, 2.0), [0.0, 0.0], {"F": cart.Table(KNOTS, VALUES, "hold")}, **how)
    wanted = exact("hold", 2.0)
    assert np.abs(tabled.x[-1] - wanted).max() < 1e-12
    assert np.abs(through.x[-1] - wanted).max() > 1e-3


@pytest.mark.parametrize("kind", ["hold", "linear", "cubic"])
@pytest.mark.parametrize("way", ["numpy", "ctypes"])
def test_every_way_gives_the_same(cart: ModuleType, way: str, kind: str) -> None:
    u = {"F": cart.Table(KNOTS, VALUES, kind), "brake": 0.3}
    first = cart.simulate((0.0, 2.0), [0.0, 0.0], u)
    other = by(cart, way, (0.0, 2.0), [0.0, 0.0], u)
    np.testing.assert_allclose(other.x, first.x, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(other.u, first.u)


@pytest.mark.parametrize(
    "integrator", [x.name for x in INTEGRATORS if isinstance(x, (Tableau, Taylor))]
)
def test_lanes_take_tables_shared_and_of_each(cart: ModuleType, integrator: str) -> None:
    how = {"step_size": 0.01} if integrator == "rk4" else {}
    how |= {"integrator": integrator, "times": [0.4, 2.0]}
    x = np.zeros((11, 2)) + np.linspace(0.0, 1.0, 11)[:, np.newaxis]
    scale = np.linspace(0.5, 1.5, 11)[:, np.newaxis]
    shift = np.linspace(0.0, 0.1, 11)[:, np.newaxis] * np.linspace(0.0, 1.0, 6)
    forms = {
        "shared": cart.Table(KNOTS, VALUES),
        "values": cart.Table(KNOTS, scale * VALUES, "cubic"),
        "knots": cart.Table(KNOTS + shift, scale * VALUES, "hold"),
    }
    for name, table in forms.items():
        many = cart.simulate((0.0, 2.0), x, {"F": table, "brake": 0.2}, **how)
        for k in (0, 7, 10):
            own = cart.Table(
                table.times if table.times.ndim == 1 else table.times[k],
                table.values if table.values.ndim == 1 else table.values[k],
                table.kind,
            )
            one = cart.simulate((0.0, 2.0), x[k], {"F": own, "brake": 0.2}, **how)
            np.testing.assert_allclose(many.x[k], one.x, rtol=1e-8, atol=1e-10, err_msg=name)


def test_a_spline_is_that_of_another_library() -> None:
    for n in (2, 3, 4, 6):
        made = pieces(source({"a": Table(KNOTS[:n], VALUES[:n], "cubic")}, ("a",), np.asarray))
        t = np.linspace(0.0, KNOTS[n - 1], 23)[:-1]
        assert not isinstance(made, list)
        np.testing.assert_allclose(
            made.at(t)[:, 0], CubicSpline(KNOTS[:n], VALUES[:n])(t), atol=1e-13
        )


# Functions
# ---------------------------------------------------------------------------------------------------


def brake(t: float, x: np.ndarray) -> np.ndarray:
    return np.stack([-2.0 * x[..., 0] - x[..., 1], np.zeros_like(x[..., 0])], axis=-1)


def sampled(x: np.ndarray, period: float, count: int) -> np.ndarray:
    """The controlled mass from sample to sample in closed form."""
    for _ in range(count):
        F = -2.0 * x[0] - x[1]
        x = np.array([x[0] + period * x[1] + period**2 / 2 * F, x[1] + period * F])
    return x


def test_a_controller_holds_its_value_between_samples(cart: ModuleType) -> None:
    x = np.array([1.0, 0.0])
    motion = cart.simulate((1.0, 3.0), x, brake, sample=0.1, times=[1.0, 2.25, 3.0])
    assert motion.x[-1] == pytest.approx(sampled(x, 0.1, 20), abs=1e-12)
    twelve = sampled(x, 0.1, 12)
    assert motion.u[1] == pytest.approx(brake(0, twelve))
    assert motion.x[1] == pytest.approx(sampled(twelve, 0.05, 1), abs=1e-12)
    for way in ("numpy", "ctypes"):
        other = by(cart, way, (1.0, 3.0), x, brake, sample=0.1)
        assert other.x[-1] == pytest.approx(motion.x[-1], abs=1e-13)


def test_a_controller_gets_the_whole_batch(cart: ModuleType) -> None:
    x = np.random.default_rng(1).normal(size=(3, 7, 2))
    shapes = []

    def control(t: float, x: np.ndarray) -> np.ndarray:
        shapes.append(x.shape)
        return brake(t, x)

    many = cart.simulate((0.0, 2.0), x, control, sample=0.1, threads=2)
    assert set(shapes) == {(3, 7, 2)} and len(shapes) == 20
    assert many.u.shape == (3, 7, 2, 2)
    for i, k in ((0, 0), (2, 5)):
        assert many.x[i, k, -1] == pytest.approx(sampled(x[i, k], 0.1, 20), abs=1e-11)


def test_a_function_at_every_stage_is_a_feedback(cart: ModuleType) -> None:
    """x'' = −2 x − x' in closed form."""
    t = np.linspace(0.0, 2.0, 5)
    c = np.sqrt(7.0) / 2
    wanted = np.exp(-t / 2) * (np.cos(c * t) + np.sin(c * t) / (2 * c))
    for integrator in ("dop853", "verner9", "radau"):
        motion = cart.simulate(t, [1.0, 0.0], brake, integrator=integrator)
        np.testing.assert_allclose(motion.x[:, 0], wanted, atol=1e-7)
    many = cart.simulate(t, np.tile([1.0, 0.0], (9, 1)), brake)
    np.testing.assert_allclose(many.x[:, :, 0], np.tile(wanted, (9, 1)), atol=1e-8)
    assert by(cart, "numpy", t, [1.0, 0.0], brake).x[:, 0] == pytest.approx(wanted, abs=1e-8)
    with pytest.raises(ValueError, match="exact Jacobian"):
        cart.simulate(t, [1.0, 0.0], brake, integrator="rosenbrock")


def test_compiled_functions_are_called_as_they_are(cart: ModuleType, tmp_path: Any) -> None:
    code = (
        "int push(double t, const double *x, double *u, void *data)"
        "{ (void)t, (void)data; u[0] = -2.0 * x[0] - x[1]; return x[0] < -9.0; }"
    )
    (tmp_path / "push.c").write_text(code)
    command = compiler.find_compiler()
    assert command is not None
    target = tmp_path / "push.so"
    make = [*command, "-shared", "-fPIC", "push.c", "-o", str(target)]
    subprocess.run(make, cwd=tmp_path, check=True)
    push = ctypes.CDLL(str(target)).push
    t = np.linspace(0.0, 2.0, 5)
    wanted = cart.simulate(t, [1.0, 0.0], brake)
    np.testing.assert_array_equal(cart.simulate(t, [1.0, 0.0], push).x, wanted.x)
    with pytest.raises(cart.Stopped) as caught:
        cart.simulate(t, [-10.0, 0.0], push)
    assert caught.value.partial.status == cart.Status.NO_INPUT


CALLED = """#include "cart_simulate.h"
static int push(double t, const double *x, double *u, void *data)
{ (void)t, (void)x, (void)data; u[0] = 1.0; return 0; }
int main(void)
{
    static double workspace[1 << 20], x[2], u[2], out[2], work[1], t0[1], times[1] = {1.0};
    static cart_end end;
    cart_inputs inputs = {0};
    cart_motions all = {.rows = 1, .n = 1, .t0 = t0, .times = times, .x = x, .u = u, .p = cart_defaults,
        .rtol = 1e-6, .atol = 1e-6, .budget = 99, .x_out = out, .work_out = work, .ends = &end, .inputs = &inputs};
    int by_stages, by_series;
    if (cart_workspace() > sizeof workspace)
        return 9;
    inputs.call = push;
    all.integrator = CART_INTEGRATOR_dop853;
    all.enforcement = CART_ENFORCEMENTS - 1;
    by_stages = cart_simulate_batch(&all, workspace);
    all.integrator = CART_INTEGRATOR_taylor;
    by_series = cart_simulate_batch(&all, workspace);
    return by_stages == CART_OK && end.status == CART_OK ? by_series : 8;
}
"""


def test_what_a_callback_says_is_in_no_series(cart: ModuleType, tmp_path: Any) -> None:
    """In C, where a batch is asked for by number: NO_METHOD."""
    (tmp_path / "called.c").write_text(CALLED)
    command, folder = compiler.find_compiler(), Path(str(cart.__file__)).parent.resolve()
    assert command is not None
    library = folder / compiler.shared_library("cart")
    make = [*command, f"-I{folder}", "called.c", str(library), "-lm", "-o", "called"]
    subprocess.run(make, cwd=tmp_path, check=True)
    assert subprocess.run([str(tmp_path / "called")], check=False).returncode == 6


# Bad input
# ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", [{}, {"sample": 0.1}], ids=["every stage", "sample times"])
def test_what_a_function_cannot_give_is_a_status_and_nothing_is_lost(
    cart: ModuleType, how: dict[str, Any]
) -> None:
    def raises(t: float, x: np.ndarray) -> np.ndarray:
        if t > 1.0:
            raise KeyError("lost")
        return brake(t, x)

    def gaps(t: float, x: np.ndarray) -> np.ndarray:
        return brake(t, x) * (np.nan if t > 1.0 else 1.0)

    t = np.linspace(0.0, 2.0, 21)
    good = cart.simulate(t, [1.0, 0.0], brake, **how)
    for function in (raises, gaps):
        with pytest.raises(cart.Stopped, match="an input could not be had") as caught:
            cart.simulate(t, [1.0, 0.0], function, **how)
        part = caught.value.partial
        assert part.status == cart.Status.NO_INPUT
        np.testing.assert_allclose(part.x[:9], good.x[:9], atol=1e-9)
        assert np.isnan(part.x[-1]).all()
        with pytest.warns(RuntimeWarning, match="5 of 5 motions ended early.*input"):
            many = cart.simulate(t, np.tile([1.0, 0.0], (5, 1)), function, **how)
        assert (many.status == cart.Status.NO_INPUT).all()
        np.testing.assert_allclose(many.x[3, :9], good.x[:9], atol=1e-8)
    assert isinstance(caught.value.__cause__, KeyError | None)


def test_one_row_that_gets_no_number_ends_alone(cart: ModuleType) -> None:
    def control(t: float, x: np.ndarray) -> np.ndarray:
        u = brake(t, x)
        u[2] *= np.nan if t > 1.0 else 1.0
        return u

    x = np.tile([1.0, 0.0], (6, 1))
    with pytest.warns(RuntimeWarning, match="1 of 6 motions"):
        many = cart.simulate((0.0, 2.0), x, control, sample=0.1)
    assert np.flatnonzero(many.status).tolist() == [2]
    assert np.isfinite(many.x[[0, 1, 3, 4, 5]]).all() and np.isnan(many.x[2, -1]).all()


@pytest.mark.parametrize(
    ("u", "how", "said"),
    [
        ({"F": Table([0, 1], [1, 2])}, {}, "table of 'F' ends at t = 1, the motion at t = 2"),
        ({"F": Table([0.5, 3], [1, 2])}, {}, "table of 'F' begins at t = 0.5"),
        ({"f": 1.0}, {}, "no input 'f', perhaps 'F'; it has F, brake"),
        ([1.0, 2.0], {"sample": 0.1}, "no function as u"),
        ([1.0], {}, r"simulate\(\) needs 2 values along the last axis of 'u'"),
        (None, {"p": [1.0] * 9}, r"simulate\(\) needs \d values along the last axis of 'p'"),
        (None, {"p": {"masss": 1.0}}, "no parameter 'masss', perhaps 'mass'; it has mass"),
        (brake, {"sample": -1.0}, "a sample time above zero"),
        (brake, {"sample": [0.0, 0.0]}, "sample times that increase"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_makes_no_sense_is_refused(
    cart: ModuleType, u: Any, how: dict[str, Any], said: str
) -> None:
    if isinstance(u, dict):
        u = {
            k: cart.Table(v.times, v.values, v.kind) if isinstance(v, Table) else v
            for k, v in u.items()
        }
    with pytest.raises(ValueError, match=said):
        cart.simulate((0.0, 2.0), [0.0, 0.0], u, **how)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (([0, 1, 1], [1, 2, 3]), "times do not increase from 1 to 2"),
        (([0, 0], [0, 1]), "times do not increase from 0 to 1"),
        (([0, 1, 3], [1, np.nan, 3]), "value 1 is not finite"),
        (([0, 3], [1, 2, 3]), "do not belong to each other"),
        (([0, 3], [1, 2], "square"), "no kind 'square'"),
        (([0, 1, 2], [[1, 2]] * 2), "do not belong to each other"),
        (([0, 0, 2], [[1, 2]] * 3), "times do not increase"),
    ],
)
def test_what_is_no_table_is_refused_when_it_is_made(given: tuple[Any, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Table(*given)


def test_a_table_of_all_inputs_has_its_times_first() -> None:
    assert np.shape(Table([0, 1, 2], [[1, 2]] * 3).values) == (3, 2)
    assert np.shape(Table([0, 1], [[1, 2]] * 2).values) == (2, 2)


def test_parameters_by_name_leave_the_others_as_they_are(cart: ModuleType) -> None:
    p = 2.0 * cart.defaults
    x = [1.0, 0.0]
    named = cart.simulate((0.0, 2.0), x, [1.0, 0.5], {cart.parameters[0]: p[0]})
    np.testing.assert_array_equal(named.x, cart.simulate((0.0, 2.0), x, [1.0, 0.5], p).x)
    assert not np.allclose(named.x, cart.simulate((0.0, 2.0), x, [1.0, 0.5]).x)
    many = cart.simulate((0.0, 2.0), x, None, {cart.parameters[0]: [1.0, 2.0, 3.0]})
    assert many.x.shape == (3, 2, 2)


@pytest.mark.parametrize("events", ["x", 3, [abs]])
def test_events_that_are_no_functions_by_name_are_refused(cart: ModuleType, events: Any) -> None:
    with pytest.raises(
        TypeError, match=r"simulate\(\) needs functions f\(t, x\) by name as events"
    ):
        cart.simulate((0.0, 1.0), [0.0, 0.0], events=events)


@pytest.mark.parametrize(
    "how", [{"rtol": "x"}, {"atol": None}, {"step_size": "a"}, {"threads": 1.5}, {"max_steps": "a"}]
)
def test_what_is_no_number_is_refused_by_name(cart: ModuleType, how: dict[str, Any]) -> None:
    with pytest.raises(
        TypeError, match=rf"simulate\(\) needs a .*number as {next(iter(how))}, got"
    ):
        cart.simulate((0.0, 1.0), [0.0, 0.0], **how)


def test_sample_times_do_not_gain_one_by_rounding() -> None:
    assert len(sample_times(0.1, 0.0, 2.0)) == 20
    assert len(sample_times(0.001, 0.0, 10.0)) == 10_000
    assert sample_times([0.5, 3.0], 0.0, 2.0).tolist() == [0.0, 0.5]
