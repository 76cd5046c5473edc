"""C, ctypes and NumPy give the graph's numbers; the text is safe, deterministic, and portable.

Of codegen.targets: c, charts, extension, manifest, nullspace, numpy, package, taylor.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import warnings
import weakref
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

from codegen import compiler, loader, text
from codegen.emit import emit
from codegen.passes import program
from codegen.targets import TARGETS
from hamel.build.module import published
from tests.toy import toy

HOSTILE = (
    '*/ #error "quoted" \\" \'\'\' """ ??/ \n\r\x00\x85\u2028 // /* %s {{ }} {% raw %} <script> \\'
)
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("targets")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return published(program(toy()), base / "toy").folder


@pytest.fixture(scope="module")
def module(folder: Path) -> ModuleType:
    return loader.load(folder)


def bindings(module: ModuleType) -> list[ModuleType]:
    return [
        module,
        *(importlib.import_module(f"{module.__name__}.{name}") for name in ("_library", "_numpy")),
    ]


def states(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(7)
    return random.normal(size=n), random.normal(size=(n, 4)), random.normal(size=(n, 1))


@needs_compiler
def test_backend(module: ModuleType) -> None:
    assert module.backend == "extension"
    assert (module.nx, module.nu, module.np_) == (4, 1, 3)
    assert module.states == ("q1", "q2", "der(q1)", "der(q2)") and module.parameters == (
        "l1",
        "l2",
        "m",
    )
    assert module.defaults.tolist() == [0.5, 0.7, 1.3]


@needs_compiler
@pytest.mark.parametrize("name", ["dynamics", "mass", "energy", "odd", "constant"])
def test_all_bindings_equal_the_graph(module: ModuleType, name: str) -> None:
    equations = toy()
    function = next(f for f in equations.functions if f.name == name)
    graph = ca.Function(
        "f", [argument.symbols for argument in equations.arguments], [function.result.value]
    )
    t, x, u = states(40)
    p = np.array([0.4, 0.9, 2.0])
    expected = np.array([graph(t[i], x[i], u[i], p).full() for i in range(40)])
    found = [getattr(binding, name)(t, x, u, p) for binding in bindings(module)]
    size = np.abs(expected).max()
    np.testing.assert_allclose(
        found[0].reshape(expected.shape), expected, rtol=1e-11, atol=1e-13 * size
    )
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=0)
    tame = (
        np.abs(found[0]).reshape(40, -1).max(axis=1) < 1e3
    )  # near a singular position rounding is amplified
    np.testing.assert_allclose(found[2][tame], found[0][tame], rtol=1e-12, atol=1e-15 * size)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-10, atol=1e-14 * size)
    for binding, many in zip(bindings(module), found):
        one = getattr(binding, name)(float(t[3]), x[3], u[3], p)
        np.testing.assert_allclose(one, many[3], rtol=1e-13)


@needs_compiler
def test_project_converges(module: ModuleType) -> None:
    _, x, _ = states(20)
    x[:, :2] *= 0.3
    for binding in bindings(module):
        found = binding.project(0.0, x)
        np.testing.assert_allclose(np.sin(found[:, 1]), found[:, 0] / 2, atol=1e-13)
        np.testing.assert_allclose(binding.project(0.0, x[2]), found[2], rtol=1e-14)


@needs_compiler
def test_failures_raise_or_become_nan(module: ModuleType) -> None:
    x = np.full((2, 3, 4), 0.3)
    x[1, 1, 2] = np.inf
    for binding in bindings(module):
        with pytest.warns(
            RuntimeWarning, match=r"toy.dynamics: 1 of 6 rows failed and are NaN; row 4: not finite"
        ):
            found = binding.dynamics(0.0, x, [0.0])
        assert np.isnan(found[1, 1]).all() and np.isfinite(found).sum() == 20
        with pytest.raises(
            FloatingPointError, match=r"toy.dynamics at t = 2.5: singular: \|det M\| < 1e-12"
        ):
            binding.dynamics(2.5, x[0, 0], [0.0], [0.0, 0.7, 1.3])
        with pytest.raises(FloatingPointError, match="not converged to 1e-13 in 20 steps"):
            binding.project(0.0, [3.0, 0.3, 0.0, 0.0])


@needs_compiler
def test_values_that_are_not_finite_never_pass(module: ModuleType) -> None:
    good = np.array([0.3, 0.2, 0.1, 0.4])
    for binding in bindings(module):
        for i in range(4):
            for bad in (np.nan, np.inf, -np.inf):
                x = good.copy()
                x[i] = bad
                for name in ("dynamics", "energy", "odd"):
                    with pytest.raises(FloatingPointError):
                        getattr(binding, name)(0.0, x, [0.0])
        with pytest.raises(FloatingPointError):
            binding.dynamics(0.0, good, [np.nan])
        with pytest.raises(FloatingPointError):
            binding.odd(np.nan, good)


@needs_compiler
def test_arguments_in_every_form(module: ModuleType) -> None:
    t, x, u = states(12)
    for binding in bindings(module):
        expected = binding.dynamics(0.0, x[0], u[0])
        out = np.empty(4)
        assert binding.dynamics(0.0, x[0], u[0], None, out) is out
        np.testing.assert_array_equal(out, expected)
        np.testing.assert_array_equal(
            binding.dynamics(t=0, x=list(x[0]), u=u[0].tolist(), p=module.defaults), expected
        )
        same = x[0].copy()
        binding.dynamics(0.0, same, u[0], out=same)
        np.testing.assert_array_equal(same, expected)
        rows = binding.dynamics(t.reshape(3, 4), x.reshape(3, 4, 4), u[:4])
        assert rows.shape == (3, 4, 4)
        wide = np.zeros((12, 9))
        wide[:, ::2][:, :4] = x
        np.testing.assert_array_equal(
            binding.dynamics(0.0, wide[:, ::2][:, :4], u), binding.dynamics(0.0, x, u)
        )
        strided = np.zeros((12, 8))
        binding.dynamics(0.0, x, u, out=strided[:, ::2])
        np.testing.assert_array_equal(strided[:, ::2], binding.dynamics(0.0, x, u))
        matrices = np.empty((12, 2, 2)).transpose(0, 2, 1)
        np.testing.assert_array_equal(binding.mass(0.0, x, out=matrices), binding.mass(0.0, x))
        assert binding.mass(0.0, x[0]).shape == (2, 2) and binding.energy(0.0, x[0]).shape == (1,)
        assert binding.dynamics(0.0, np.empty((0, 4)), u[0]).shape == (0, 4)


@needs_compiler
def test_results_that_somebody_holds_are_never_written_again(module: ModuleType) -> None:
    """The extension gives arrays out again that nobody holds: not their memory, nor a weak
    reference, nor in another shape."""
    _, x, u = states(60)
    one = module._binding.dynamics
    expected = [one(0.0, x[i], u[i]).copy() for i in range(60)]
    held = [one(0.0, x[i], u[i]) for i in range(60)]
    views = [one(0.0, x[i], u[i])[1:] for i in range(60)]
    buffers = [memoryview(one(0.0, x[i], u[i])) for i in range(60)]
    for i in range(60):
        np.testing.assert_array_equal(held[i], expected[i])
        np.testing.assert_array_equal(views[i], expected[i][1:])
        np.testing.assert_array_equal(np.asarray(buffers[i]), expected[i])
    weak = [weakref.ref(one(0.0, x[i], u[i])) for i in range(60)]
    assert all(
        found is None or (found == expected[i]).all()
        for i, found in enumerate(ref() for ref in weak)
    )
    for change in ({"shape": (2, 2)}, {"dtype": np.int64}, {"strides": (0,)}):
        odd = None
        for _ in range(9):
            odd = one(0.0, x[0], u[0])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for name, value in change.items():
                    setattr(odd, name, value)
            odd.flags.writeable = False
        del odd
        for i in range(20):
            found = one(0.0, x[i], u[i])
            assert found.flags.writeable and found.dtype == float
            np.testing.assert_array_equal(found, expected[i])


@needs_compiler
def test_a_result_of_another_shape_is_refused_however_it_is_held(module: ModuleType) -> None:
    """Nothing is written beyond an array that is too short, even where somebody has a weak
    reference to it."""
    _, x, u = states(1)
    room = np.full(64, 7.0)
    short = room[:1]
    held = weakref.ref(short)
    with pytest.raises((ValueError, TypeError)):
        module._binding.dynamics(0.0, x[0], u[0], out=short)
    assert (room == 7.0).all() and held() is short


@needs_compiler
def test_wrong_arguments_are_refused(module: ModuleType) -> None:
    x = np.zeros(4)
    for binding in bindings(module):
        for arguments in (
            (0.0, x[:3], [0.0]),
            (0.0, x),
            (0.0, x, [0.0], None, np.empty(4, dtype=np.float32)),
        ):
            with pytest.raises((TypeError, ValueError)):
                binding.dynamics(*arguments)
        with pytest.raises((TypeError, ValueError)):
            binding.dynamics(0.0, x, [0.0], out=np.empty(5))
        with pytest.raises(TypeError):
            binding.dynamics(0.0, x, [0.0], None, None, None)
        with pytest.raises(TypeError):
            binding.dynamics(0.0, x, nonsense=1)


@needs_compiler
def test_a_wrong_shape_is_told_by_the_name_of_its_argument(module: ModuleType) -> None:
    _, x, u = states(1)
    given = {"x": x[0], "u": u[0], "p": np.array(list(module.defaults))}
    for name, value in given.items():
        for bad in (
            value[:-1],
            np.append(value, 0.0),
            np.float64(1.0),
            np.ones((3, len(value) + 1)),
        ):
            for binding in bindings(module):
                said = f"needs {len(value)} values along the last axis of '{name}', got shape {np.shape(bad)}"
                with pytest.raises(ValueError, match=re.escape(said)):
                    binding.dynamics(0.0, **(given | {name: bad}))


def test_targets_are_listed_once() -> None:
    assert len({target.name for target in TARGETS}) == len(TARGETS)
    files = [name for target in TARGETS for name in target.files(program(toy()))]
    assert len(files) == len(set(files))


def test_same_bytes_for_every_hash_seed(tmp_path: Path) -> None:
    script = (
        "import hashlib; from codegen.emit import emit; from codegen.passes import program; from tests.toy import toy;"
        "print(hashlib.sha256(repr(emit(program(toy()))).encode()).hexdigest())"
    )
    seen = set()
    for seed in ("0", "4242"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.getcwd()}
        seen.add(
            subprocess.run(
                [sys.executable, "-c", script], env=environment, capture_output=True, check=True
            ).stdout
        )
    assert len(seen) == 1


def test_no_dates_and_no_paths() -> None:
    for name, content in emit(program(toy())).items():
        assert "/home/" not in content and "/tmp/" not in content, name
        assert not re.search(r"20\d\d-\d\d-\d\d", content), name


def run_alone(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Python with NumPy and the folder's parent on its path and nothing else."""
    numpy_home = Path(np.__file__).parents[1]
    preamble = f"import sys; sys.path[:0] = [{str(folder.parent)!r}, {str(numpy_home)!r}]\n"
    return subprocess.run(
        [sys.executable, "-I", "-S", "-c", preamble + script],
        capture_output=True,
        text=True,
        check=False,
    )


@needs_compiler
def test_folder_moves_and_falls_back(folder: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere" / "toy"
    shutil.copytree(folder, moved, ignore=shutil.ignore_patterns("__pycache__"))
    script = """
import warnings
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always")
    import toy
assert "hamel" not in sys.modules and "casadi" not in sys.modules
print(toy.backend, len(seen), toy.dynamics(0.0, [0.1, 0.2, 0.3, 0.4], [1.0]).tolist())
"""
    first = run_alone(moved, script)
    next(moved.glob("_toy.*")).unlink()
    second = run_alone(moved, script)
    next(moved.glob("libtoy.*")).unlink()
    third = run_alone(moved, script)
    rebuilt = subprocess.run(
        [sys.executable, "build.py"], cwd=moved, capture_output=True, text=True, check=False
    )
    fourth = run_alone(moved, script)
    lines = [run.stdout.split(maxsplit=2) for run in (first, second, third, fourth)]
    assert [line[:2] for line in lines] == [
        ["extension", "0"],
        ["ctypes", "0"],
        ["numpy", "1"],
        ["extension", "0"],
    ], third.stderr
    assert lines[0][2] == lines[1][2], rebuilt.stderr
    for _, _, found in lines[2:]:  # build.py compiles with optimisation
        np.testing.assert_allclose(json.loads(found), json.loads(lines[0][2]), rtol=1e-13)


@needs_compiler
def test_binaries_of_other_equations_are_not_used(folder: Path, tmp_path: Path) -> None:
    stale = tmp_path / "toy"
    shutil.copytree(folder, stale, ignore=shutil.ignore_patterns("__pycache__"))
    shared = stale / "_shared.py"
    shared.write_text(re.sub(r'PROGRAM = "\w+"', 'PROGRAM = "other"', shared.read_text()))
    with pytest.warns(RuntimeWarning, match="using NumPy.*compiled from other equations"):
        assert loader.load(stale).backend == "numpy"


STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")


@needs_compiler
def test_hostile_text_stays_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    built = published(program(toy("toy", HOSTILE, HOSTILE)), tmp_path / "toy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        module = loader.load(built.folder)
    assert module.backend == "extension" and module.dynamics(0.0, np.full(4, 0.3), [0.0]).shape == (
        4,
    )
    command = compiler.find_compiler()
    assert command
    sources = [str(built.folder / name) for name in ("example.c", "toy.c")]
    subprocess.run(
        [*command, *STRICT, "-trigraphs", *sources, "-lm", "-o", str(tmp_path / "example")],
        check=True,
    )
    assert json.loads((built.folder / "manifest.json").read_text())["description"] == HOSTILE


@pytest.mark.parametrize(
    "value", [0.1, 1e-320, 1.7976931348623157e308, 1 / 3, -2.5e-300, 123456789.0]
)
def test_numbers_round_trip(value: float) -> None:
    assert float(text.number(value)) == value
    assert (
        text.number(float("inf")) == "INFINITY"
        and text.number(float("-inf"), text.NUMPY) == "-np.inf"
    )
    assert text.number(float("nan")) == "NAN"


@pytest.mark.parametrize(
    ("value", "printed"),
    [
        (("add", "a", ("add", "b", "c")), "b + c + a"),
        (("sub", "a", ("sub", "b", "c")), "a - (b - c)"),
        (("mul", ("add", "a", "b"), ("neg", "c")), "(a + b) * -c"),
        (("div", "a", ("mul", "b", "c")), "a / (b * c)"),
        (("mul", "a", -2.0), "a * -2.0"),
        (
            ("where", ("lt", "a", ("add", "b", 1.0)), "c"),
            "((double)(a < (b + 1.0)) != 0 ? c : 0.0)",
        ),
    ],
)
def test_parentheses(value: tuple, printed: str) -> None:
    assert text.expression(value, text.C) == printed


def test_manifest_says_what_is_there() -> None:
    toy_program = program(toy())
    manifest = json.loads(emit(toy_program)["manifest.json"])
    assert manifest["operations"]["dynamics"] == toy_program.kernel("dynamics").operations["total"]
    assert manifest["operations_by_kind"]["dynamics"]["sin"] == 3
    assert manifest["functions"]["mass"]["shape"] == [2, 2] and manifest["arguments"]["p"][
        "defaults"
    ] == [0.5, 0.7, 1.3]
    assert manifest["choice"] == "crank"
    assert set(manifest["files"]) == set(emit(toy_program)) - {"manifest.json"}


@needs_compiler
def test_defaults_and_batches_use_precomputed_constants(module: ModuleType) -> None:
    """With the defaults, the same numbers given, and other numbers for every row."""
    t, x, u = states(30)
    plain = module.dynamics(0.0, x[0], u[0], module.defaults)
    np.testing.assert_allclose(module.dynamics(0.0, x[0], u[0]), plain, rtol=1e-12)
    p = module.defaults * np.linspace(0.8, 1.2, 30)[:, None]
    rows = module.dynamics(t, x, u, p)
    singles = np.array([module.dynamics(t[i], x[i], u[i], p[i]) for i in range(30)])
    tame = np.abs(singles).max(axis=1) < 1e3
    np.testing.assert_allclose(rows[tame], singles[tame], rtol=1e-11)
    p[7, 2] = np.nan
    with pytest.warns(RuntimeWarning, match=r"1 of 30 rows failed and are NaN; row 7: not finite"):
        assert np.isnan(module.dynamics(t, x, u, p)[7]).all()
    p[:8, 2] = (
        np.nan
    )  # what all rows share is still to be read when the first vector of rows has failed
    with pytest.warns(RuntimeWarning, match=r"8 of 30 rows failed"):
        shared = module.dynamics(0.0, x, [1.7], p)
    singles = np.array([module.dynamics(0.0, x[i], np.array([1.7]), p[i]) for i in range(8, 30)])
    tame = np.abs(singles).max(axis=1) < 1e3
    assert tame.any()
    np.testing.assert_allclose(shared[8:][tame], singles[tame], rtol=1e-11)


def test_steps_use_precomputed_constants() -> None:
    """Parameters stay as they are on the way, so what follows from them alone is computed once, not
    at every stage."""
    made = program(toy())
    hoisted = made.kernel("dynamics").hoisted
    assert (
        hoisted and hoisted.rest.operations["total"] < made.kernel("dynamics").operations["total"]
    )
    simulation = emit(made)["toy_simulate.c"]
    assert "#define MODEL_dynamics(r) toy_dynamics_precomputed\n" in simulation
    assert simulation.count("toy_dynamics_precompute(p, c)") == 1
    assert "toy_dynamics(" not in simulation


@needs_compiler
def test_batches_on_threads(module: ModuleType) -> None:
    t, x, u = states(37)
    expected = module.dynamics(t, x, u)
    for binding in bindings(module):
        many = module.threaded(binding.dynamics, 3)
        tame = np.abs(expected).max(axis=1) < 1e3
        np.testing.assert_allclose(many(t, x, u)[tame], expected[tame], rtol=1e-11)
        np.testing.assert_array_equal(many(t[0], x[0], u[0]), binding.dynamics(t[0], x[0], u[0]))
        out = np.empty((37, 2, 4))
        assert many(t[:, None], x[:, None], u[:2], out=out) is out
        np.testing.assert_allclose(
            out[tame, 0], module.dynamics(t, x, u[0])[tame], rtol=1e-9, atol=1e-9
        )
    with pytest.raises(TypeError):
        module.threaded(module.dynamics, 2)(t, x)
    x[[20, 31]] = np.nan
    for binding in bindings(module):
        with pytest.warns(RuntimeWarning) as alone:
            binding.dynamics(t, x, u)
        with pytest.warns(RuntimeWarning) as divided:
            module.threaded(binding.dynamics, 5)(t, x, u)
        assert [str(each.message) for each in divided] == [str(alone[0].message)]
        assert "2 of 37 rows failed and are NaN; row 20: not finite" in str(alone[0].message)
    with pytest.raises(ValueError, match="one thread or more, not 0"):
        module.threaded(module.dynamics, 0)
    with pytest.raises(TypeError, match="takes a function of the module, such as dynamics, not 3"):
        module.threaded(3, 2)
    with pytest.raises(TypeError, match="takes a number of threads, not 'two'"):
        module.threaded(module.dynamics, "two")


@needs_compiler
def test_one_header_for_c_and_cpp(tmp_path: Path, module: ModuleType) -> None:
    written = emit(replace(program(toy()), inline=True))
    (tmp_path / "toy_inline.h").write_text(written["toy_inline.h"])
    main = """#include "toy_inline.h"
#include <stdio.h>
int main(void) {
    const double x[4] = {0.1, 0.2, 0.3, 0.4}, u[1] = {0.0};
    double out[4];
    int i, status = toy_dynamics(0.0, x, u, toy_defaults, out);
    for (i = 0; i < 4; i++) printf("%.17g\\n", out[i]);
    return status;
}
"""
    (tmp_path / "main.c").write_text(main)
    command = compiler.find_compiler()
    assert command
    quiet = ["-Wno-unused-function"]
    subprocess.run(
        [*command, *STRICT, *quiet, "main.c", "-lm", "-o", "main"], cwd=tmp_path, check=True
    )
    printed = subprocess.run(
        [str(tmp_path / "main")], capture_output=True, text=True, check=True
    ).stdout
    np.testing.assert_allclose(
        [float(x) for x in printed.split()],
        module.dynamics(0.0, [0.1, 0.2, 0.3, 0.4], [0.0]),
        rtol=1e-12,
    )
    if shutil.which("g++"):
        subprocess.run(["g++", "-fsyntax-only", "-x", "c++", "main.c"], cwd=tmp_path, check=True)
    for name in ("toy_simulate.h", "toy_lanes.h"):  # which need nothing that stands before them
        for file in (name, "toy.h"):
            (tmp_path / file).write_text(written[file])
        (tmp_path / "both.c").write_text(f'#include "toy_inline.h"\n#include "{name}"\n')
        subprocess.run([*command, *quiet, "-fsyntax-only", "both.c"], cwd=tmp_path, check=True)
    assert "toy_inline.h" not in emit(program(toy()))


@pytest.mark.parametrize(
    ("macros", "tuned"),
    [("11", True), ("7", False), ("4\n#define __clang__ 1", False), ("", False)],
)
def test_lanes_on_zen_are_ordered_by_another_model(
    macros: str, tuned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where gcc has it: not in gcc 7, not in clang, and for lanes alone."""
    said = "#define __znver3 1\n" + (f"#define __GNUC__ {macros}\n" if macros else "")
    monkeypatch.setattr(compiler, "probe", lambda command: ((), said))
    assert (compiler.TUNE in compiler.flags_of(["cc"], "m", "m_batch")) is tuned
    assert compiler.TUNE not in compiler.flags_of(["cc"], "m", "m")


@pytest.mark.parametrize(
    ("macros", "whole", "contracted"),
    [("12", True, True), ("8", True, False), ("4\n#define __clang__ 1", False, False)],
)
def test_flags_of_lanes_are_for_gcc_alone(
    macros: str, whole: bool, contracted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiler, "probe", lambda command: ((), f"#define __GNUC__ {macros}\n"))
    batch, steps = (compiler.flags_of(["cc"], "m", f"m_{stem}") for stem in ("batch", "simulate"))
    assert set(compiler.WHOLE).issubset(batch) is whole
    assert set(compiler.CONTRACT).issubset(steps) is contracted


def test_functions_of_one_state_take_no_512_bit_instructions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They cost Intel's cores one of two units; lanes have no use for it."""
    for macros, there in (("#define __AVX512F__ 1\n", True), ("#define __AVX2__ 1\n", False)):
        monkeypatch.setattr(compiler, "probe", lambda command, said=macros: ((), said))
        for stem in ("m", "m_derivatives"):
            assert (compiler.NARROW in compiler.flags_of(["cc"], "m", stem)) is there
        assert compiler.NARROW not in compiler.flags_of(["cc"], "m", "m_batch")
        assert (compiler.WIDE in compiler.flags_of(["cc"], "m", "m_batch")) is there
