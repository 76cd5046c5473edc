"""Code in float32: nothing of it computes in double, its sines are exact to a unit, and what is
wrong in it is still seen."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sysconfig
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

import hamel
from codegen import compiler, loader
from codegen.emit import emit
from codegen.integrators import INTEGRATORS
from codegen.passes import in_precision, program
from codegen.program import Expression, Kernel, Program
from codegen.reals import FLOAT32, FLOAT64, REALS, recast
from derive.diagnostics import AssumptionError, HamelError, ModelError, VerificationError
from derive.enforcement import ENFORCEMENTS, Options, kept_equations
from derive.formulations import equations
from derive.linearize.minimal import with_linearization
from derive.model import load
from derive.states import system
from hamel.build import keys, pipeline, reuse, stages
from hamel.build.module import published
from hamel.build.tune import timings
from hamel.verify.checks import code
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence
from tests.scenes import MODELS
from tests.toy import toy, turning

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
EPSILON = FLOAT32.epsilon
STRICT = (
    "-std=c99",
    "-O1",
    "-Wall",
    "-Wextra",
    "-pedantic",
    "-Wdouble-promotion",
    "-Wconversion",
    "-Werror",
)


def single(made: Program) -> Program:
    return in_precision(made, "float32")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("real")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return published(replace(single(program(toy())), inline=True), base / "toy").folder


@pytest.fixture(scope="module")
def module(folder: Path) -> ModuleType:
    return loader.load(folder)


@pytest.fixture(scope="module")
def turn(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("turn")
    x = ca.SX.sym("x", 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        made = single(program(turning(ca.vertcat(ca.sin(x), ca.cos(x)), x)))
        return loader.load(published(made, base / "turn").folder)


def bindings(module: ModuleType) -> list[ModuleType]:
    return [
        module,
        *(importlib.import_module(f"{module.__name__}.{name}") for name in ("_library", "_numpy")),
    ]


def test_precisions_are_listed_once() -> None:
    assert len({real.name for real in REALS}) == len(REALS)
    for real in REALS:
        assert (
            real.nearest(0.1) == np.dtype(real.name).type(0.1)
            and real.holds(0.0)
            and real.holds(1.0)
        )


def test_double_stays_as_it_is() -> None:
    made = program(toy())
    assert in_precision(made, "float64") is made
    assert single(made).fingerprint != made.fingerprint
    source = "double x = 0.1; /* a double */"
    assert recast(source, FLOAT64) is source
    assert [
        FLOAT64.rounded("4e-15"),
        FLOAT64.shared("1e-6"),
        FLOAT64.dtype,
        FLOAT64.narrow,
        FLOAT64.widen,
    ] == [
        "4e-15",
        "1e-6",
    ] + [""] * 3
    assert FLOAT64.rounding(0.3) == FLOAT64.share(0.3) == 0.3 and FLOAT64.wider(1e-9) == 1.0


@pytest.mark.parametrize(
    ("double", "single"),
    [
        (
            "const double a = 0.1 * sin(x1e5) + 1e-12;",
            "const float a = 0.1f * sinf(x1e5) + 1e-12f;",
        ),
        ('"0.1 %.17g double" /* 2.0 double */ 1.0', '"0.1 %.17g double" /* 2.0 double */ 1.0f'),
        (
            "x[1] + 2 + 0x1f + 3u - .5 + 0.3333333333333333",
            "x[1] + 2 + 0x1f + 3u - 0.5f + 0.33333334f",
        ),
        ("0x1.8p1 + 0x1.8p23f + 1.5f", "3.0f + 0x1.8p23f + 1.5f"),
        ("(double)(DOUBLE)x + DBL_EPSILON * asin(b)", "(float)(double)x + FLT_EPSILON * asinf(b)"),
    ],
)
def test_words_and_constants(double: str, single: str) -> None:
    assert recast(double, FLOAT32) == single


@needs_compiler
def test_no_double_anywhere(folder: Path, tmp_path: Path) -> None:
    command = compiler.find_compiler()
    assert command
    for name in ("toy.c", "toy_batch.c", "toy_simulate.c", "toy_cpu.c", "example.c"):
        subprocess.run(
            [*command, *STRICT, "-c", name, "-o", str(tmp_path / "made.o")], cwd=folder, check=True
        )
        text = re.sub(r"/\*.*?\*/", "", (folder / name).read_text(), flags=re.DOTALL)
        assert not re.search(r"\bdouble\b", text.replace("(double)out[i]", "")), name
    (tmp_path / "main.c").write_text('#include "toy_inline.h"\nint main(void) { return 0; }\n')
    subprocess.run(
        [
            *command,
            *STRICT,
            "-Wno-unused-function",
            f"-I{folder}",
            str(tmp_path / "main.c"),
            "-lm",
            "-o",
            str(tmp_path / "m"),
        ],
        check=True,
    )
    includes = [
        f"-isystem{place}" for place in (sysconfig.get_paths()["include"], np.get_include())
    ]
    flags = ["-std=c99", "-O1", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror"]
    subprocess.run(
        [*command, *flags, *includes, "-c", "toy_module.c", "-o", str(tmp_path / "made.o")],
        cwd=folder,
        check=True,
    )


@needs_compiler
@pytest.mark.parametrize(
    ("name", "enforcements"),
    [("double_pendulum", ["invariants"]), ("four_bar", ["projection", "selective", "tangent"])],
)
def test_no_double_in_any_enforcement_or_integrator(
    name: str, enforcements: list[str], tmp_path: Path
) -> None:
    s, known = (
        system(load(MODELS / f"{name}.yaml")),
        {enforcement.name: enforcement for enforcement in ENFORCEMENTS},
    )
    found = with_linearization(
        kept_equations(s, None, "quasi_velocities", known[enforcements[0]], Options())
    )
    made = single(
        program(found, ["default"], [integrator.name for integrator in INTEGRATORS], enforcements)
    )
    for file, text in emit(made).items():
        (tmp_path / file).write_text(text)
    command = compiler.find_compiler()
    assert command
    source = f"{name}_simulate.c"
    subprocess.run(
        [*command, *STRICT, "-c", source, "-o", str(tmp_path / "made.o")], cwd=tmp_path, check=True
    )
    assert not re.search(
        r"\bdouble\b", re.sub(r"/\*.*?\*/", "", (tmp_path / source).read_text(), flags=re.DOTALL)
    )


@needs_compiler
@pytest.mark.parametrize("name", ["dynamics", "mass", "energy", "odd", "constant"])
def test_all_bindings_equal_the_graph(module: ModuleType, name: str) -> None:
    given = toy()
    function = next(f for f in given.functions if f.name == name)
    graph = ca.Function(
        "f", [argument.symbols for argument in given.arguments], [function.result.value]
    )
    random = np.random.default_rng(7)
    t, x, u = (random.normal(size=shape).astype(np.float32) for shape in (40, (40, 4), (40, 1)))
    p = np.array([0.4, 0.9, 2.0], np.float32)
    wanted = np.array(
        [graph(float(t[i]), *(v.astype(float) for v in (x[i], u[i], p))).full() for i in range(40)]
    )
    tame = np.abs(wanted).reshape(40, -1).max(axis=1) < 1e3
    for binding in bindings(module):
        found = getattr(binding, name)(t, x, u, p)
        assert found.dtype == np.float32
        np.testing.assert_allclose(
            found.reshape(wanted.shape)[tame],
            wanted[tame],
            rtol=2e-4,
            atol=2e-5 * np.abs(wanted).max(),
        )
        one = getattr(binding, name)(float(t[3]), x[3], u[3], p)
        assert one.dtype == np.float32
        np.testing.assert_allclose(one, found[3], rtol=1e-4, atol=1e-6)


@needs_compiler
def test_what_numpy_can_round_is_taken(module: ModuleType) -> None:
    x, u = np.array([0.1, 0.2, 0.3, 0.4]), [1]
    for binding in bindings(module):
        wanted = binding.dynamics(0.0, x.astype(np.float32), np.ones(1, np.float32))
        for given in (
            x,
            x.tolist(),
            x.astype(np.longdouble),
            np.repeat(x.astype(np.float32), 2)[::2],
        ):
            found = binding.dynamics(0, given, u, module.defaults.astype(float))
            assert found.dtype == np.float32
            np.testing.assert_allclose(found, wanted, rtol=4 * EPSILON)
        for given in (x + 1j, ["a", "b", "c", "d"]):
            with pytest.raises(TypeError, match="needs real numbers as"):
                binding.dynamics(0.0, given, u)
        with pytest.raises(TypeError, match="needs a float32 array as out"):
            binding.dynamics(0.0, x, u, out=np.empty(4))
        with (
            pytest.warns(RuntimeWarning, match="overflow"),
            pytest.raises(FloatingPointError, match="not finite"),
        ):
            binding.dynamics(0.0, x * 1e300, u)


@needs_compiler
def test_values_that_are_not_finite_never_pass(module: ModuleType) -> None:
    good = np.array([0.3, 0.2, 0.1, 0.4], np.float32)
    for binding in bindings(module):
        assert np.isfinite(binding.dynamics(0.0, np.full(4, 1e-45, np.float32), [0.0])).all()
        for bad in (np.nan, np.inf, -np.inf):
            for i in range(4):
                x = good.copy()
                x[i] = bad
                for name in ("dynamics", "energy", "odd"):
                    with pytest.raises(FloatingPointError):
                        getattr(binding, name)(0.0, x, [0.0])
            with pytest.raises(FloatingPointError):
                binding.dynamics(0.0, good, [bad])
        with pytest.raises(FloatingPointError, match="singular"):
            binding.dynamics(0.0, good, [0.0], [1e-5, 0.7, 1.3])


@needs_compiler
def test_tuning_times_it_in_its_own_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert timings({"single": single(program(toy(), ["dynamics"]))})["single"] > 0


def units(found: np.ndarray, exact: np.ndarray) -> float:
    """The largest error in units in the last place of the exact value."""
    return float(
        np.max(
            np.abs(found.astype(float) - exact)
            / np.spacing(np.abs(exact).astype(np.float32)).astype(float)
        )
    )


def angles() -> Iterator[np.ndarray]:
    """One float in 251 up to 1e4, and all around multiples of a quarter turn."""
    last = int(np.array([1e4], np.float32).view(np.uint32)[0])
    for start in range(0, last, 251 * 2**18):
        yield np.arange(start, min(start + 251 * 2**18, last), 251, dtype=np.uint32).view(
            np.float32
        )
    near = (np.arange(1, 12_700) * (np.pi / 4)).astype(np.float32).view(np.int32)[
        :, None
    ] + np.arange(-3, 4, dtype=np.int32)
    yield near.view(np.float32).ravel()
    yield np.array([1e4, 0.0, 1e-45, 1e-38], np.float32)


@needs_compiler
def test_sines_are_exact_to_a_unit(turn: ModuleType) -> None:
    for k, x in enumerate(angles()):
        x = x if k % 2 else -x
        found = turn.dynamics(np.float32(0), x[:, None])
        assert units(found[:, 0], np.sin(x.astype(float))) <= 0.8
        assert units(found[:, 1], np.cos(x.astype(float))) <= 0.8
    zeros = np.array([0.0, -0.0] * 9, np.float32)
    assert (np.signbit(turn.dynamics(0.0, zeros[:, None])[:, 0]) == np.signbit(zeros)).all()
    assert np.signbit(turn.dynamics(0.0, zeros[1:2])[0])
    one_by_one = np.array([turn.dynamics(0.0, value[None]) for value in x])
    assert np.abs(one_by_one - found).max() <= EPSILON


@needs_compiler
def test_the_library_beyond(turn: ModuleType) -> None:
    x = np.array([10_000.001, -12_345.6, 3e8, 1e22, -3e38, 2.5, 7.0, 1e30], np.float32)
    found = turn.dynamics(0.0, x[:, None])
    assert (
        units(found[:, 0], np.sin(x.astype(float))) <= 1
        and units(found[:, 1], np.cos(x.astype(float))) <= 1
    )
    x[[2, 5]] = np.nan, np.inf
    with pytest.warns(RuntimeWarning, match="2 of 8 rows failed and are NaN; row 2: not finite"):
        turn.dynamics(0.0, x[:, None])


@needs_compiler
def test_batches_have_twice_the_lanes(turn: ModuleType) -> None:
    text = (Path(turn.__path__[0]) / "turn_lanes.h").read_text()
    assert re.findall(r"LANES = (\d+)", text) == ["16", "8"]
    for n in (1, 7, 8, 9, 16, 37):
        x = np.linspace(-3, 3, n, dtype=np.float32)[:, None]
        np.testing.assert_allclose(
            turn.dynamics(0.0, x), np.hstack([np.sin(x), np.cos(x)]), rtol=1e-6, atol=1e-7
        )


@needs_compiler
@pytest.mark.parametrize(
    "by",
    [("dop853", None), ("rosenbrock", None), ("implicit_midpoint", 1e-3)],
    ids=lambda by: by[0],
)
def test_simulation(
    by: tuple[str, float | None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second of a four-bar, on the constraints to rounding; the same in ctypes and, where the
    method is explicit, in NumPy."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    integrator, step = by
    made = program(equations(system(load(MODELS / "four_bar.yaml"))), ["default"], (integrator,))
    double = in_numpy(
        program(equations(system(load(MODELS / "four_bar.yaml"))), ["default"]), tmp_path / "double"
    )
    module = loader.load(published(single(made), tmp_path / "four_bar").folder)
    start = double.project(0.0, np.array([0.5, 0.5, 1.5, 2.0]))
    wanted = double.simulate((0.0, 1.0), start, [0.0], rtol=1e-9).x[-1]
    for name in ("_four_bar", "_library", "_numpy")[: 3 if integrator == "dop853" else 2]:
        monkeypatch.setattr(
            module, "_binding", importlib.import_module(f"{module.__name__}.{name}")
        )
        found = module.simulate((0.0, 1.0), start, [0.0], step_size=step)
        assert (
            found.x.dtype == found.t.dtype == np.float32 and found.position_violation < 20 * EPSILON
        )
        np.testing.assert_allclose(found.x[-1], wanted, rtol=0, atol=2e-4 * np.abs(wanted).max())


@needs_compiler
def test_time_does_not_stand_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of a millisecond a thousand seconds from zero, where the last digit of a float is a
    sixteenth of one."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = program(equations(system(load(MODELS / "double_pendulum.yaml"))), ["dynamics"], ("rk4",))
    module = loader.load(published(single(made), tmp_path / "double_pendulum").folder)
    early, late = (
        module.simulate((t, t + 1.0), [0.5, 0.0, 0.0, 0.0], step_size=1e-3) for t in (0.0, 1024.0)
    )
    np.testing.assert_allclose(late.x[-1], early.x[-1], rtol=0, atol=1e-5)


@needs_compiler
def test_what_is_written_says_so(folder: Path) -> None:
    assert json.loads((folder / "manifest.json").read_text())["real"] == "float32"
    assert "real" not in json.loads(emit(program(toy()))["manifest.json"])
    stub = (folder / "__init__.pyi").read_text()
    assert (
        "float32" in stub
        and "float64" not in stub
        and "float64" not in (folder / "__init__.py").read_text()
    )


def test_what_loses_its_digits_is_refused() -> None:
    for value in (1e39, 1e-39):
        with pytest.raises(
            AssumptionError, match=r"parameter l1 has the number .*float32 cannot hold"
        ):
            single(program(replace(toy(), parameters=(value, 0.7, 1.3))))
    with pytest.raises(AssumptionError, match="float32 cannot hold 1e-42 with all digits"):
        hamel.simulate(MODELS / "pendulum.yaml", values={"m": 1e-42}, real="float32")
    with pytest.raises(
        ModelError, match="cvodes computes in float64: integrate float32 with dop853"
    ):
        hamel.simulate(MODELS / "pendulum.yaml", integrator="cvodes", real="float32")
    with pytest.raises(HamelError, match=r"unknown precision 'float3'; did you mean 'float32'"):
        hamel.build(MODELS / "pendulum.yaml", real="float3")


# ---- what is wrong is seen


def flipped(value: Expression) -> Iterator[Expression]:
    """The expression with one sum made a difference, or the other way round."""
    if isinstance(value, tuple):
        operation, *operands = value
        if operation in ("add", "sub"):
            yield ("sub" if operation == "add" else "add", *operands)
        for k, operand in enumerate(operands):
            yield from (
                (operation, *operands[:k], other, *operands[k + 1 :]) for other in flipped(operand)
            )


def wrong(kernel: Kernel) -> Iterator[Kernel]:
    """The kernel with one sign wrong, in every place there is one."""
    for i, section in enumerate(kernel.sections):
        for j, statement in enumerate(section.statements):
            for value in flipped(statement.value):
                statements = (
                    *section.statements[:j],
                    replace(statement, value=value),
                    *section.statements[j + 1 :],
                )
                yield replace(
                    kernel,
                    sections=(
                        *kernel.sections[:i],
                        replace(section, statements=statements),
                        *kernel.sections[i + 1 :],
                    ),
                )


def in_numpy(made: Program, place: Path) -> ModuleType:
    """The module's NumPy text, not compiled."""
    place.mkdir()
    for name, text in emit(made).items():
        (place / name).write_text(text)
    with pytest.warns(RuntimeWarning, match="using NumPy"):
        return loader.load(place)


def test_every_wrong_sign_is_seen(tmp_path: Path) -> None:
    s = system(load(MODELS / "double_pendulum.yaml"))
    made = single(program(equations(s), ["dynamics"]))
    right = made.kernel("dynamics")
    module = in_numpy(made, tmp_path / "right")
    seen = evidence(reference(s.model), equations(s), module, states=20)
    tolerance = code.EXACT * FLOAT32.coarseness
    assert code._function(seen, "dynamics", module.dynamics) < tolerance / 4
    for k, kernel in enumerate(wrong(right)):
        bad = in_numpy(replace(made, kernels=(kernel,)), tmp_path / f"wrong{k}")
        assert code._function(seen, "dynamics", bad.dynamics) > 100 * tolerance
    assert k > 5


@needs_compiler
@pytest.mark.slow
def test_a_build_with_a_wrong_sign_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path, asked = MODELS / "pendulum.yaml", ("dynamics", "energy")
    assert len({keys.file_key(path, {"real": real.name}) for real in REALS}) == len(REALS)
    made = hamel.build(path, out=tmp_path / "made", functions=asked, real="float32")
    assert made.real == "float32" and loader.load(made.folder).defaults.dtype == np.float32
    usual = stages.program_of
    monkeypatch.setattr(reuse, "file_key", lambda *given: None)
    monkeypatch.setattr(pipeline, "file_key", lambda *given: None)

    def spoiled(*given: object, **options: object) -> Program:
        made = usual(*given, **options)  # type: ignore[arg-type]
        bad = next(wrong(made.kernel("energy")))
        return replace(
            made,
            kernels=tuple(bad if kernel.name == "energy" else kernel for kernel in made.kernels),
        )

    monkeypatch.setattr(stages, "program_of", spoiled)
    with pytest.raises(VerificationError, match="module = graph"):
        hamel.build(path, out=tmp_path / "other", functions=asked, real="float32")
    assert not (tmp_path / "other").exists()
