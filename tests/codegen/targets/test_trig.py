"""The inlined sine and cosine: below one unit in the last place on |x| ≤ 1e5, the library's own
beyond; scalar and in batches. In steps of motions side by side, shorter ones.

Of codegen.targets: turns.
"""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import casadi as ca
import mpmath
import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from hamel.build.module import published
from tests.scenes import derived
from tests.toy import turning

pytestmark = pytest.mark.optimised

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("trig")
    x = ca.SX.sym("x", 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return loader.load(
            published(program(turning(ca.vertcat(ca.sin(x), ca.cos(x)), x)), base / "turn").folder
        )


def points() -> np.ndarray:
    """Everywhere, small, and the neighbours of multiples of π/4."""
    random = np.random.default_rng(3)
    wide = np.concatenate([random.uniform(-scale, scale, 20_000) for scale in (1e5, 1e3, 7.0, 0.8)])
    small = random.uniform(-1, 1, 2_000) * 2.0 ** -random.integers(0, 1000, 2_000)
    near = np.arange(0, 127_324) * (np.pi / 4)
    ends = np.array(
        [
            1e5,
            -1e5,
            np.nextafter(1e5, 0),
            0.0,
            5e-324,
            -5e-324,
            np.pi / 4,
            np.nextafter(np.pi / 4, 1),
        ]
    )
    found = np.concatenate(
        [wide, small, near, -near, np.nextafter(near, np.inf), np.nextafter(near, -np.inf), ends]
    )
    return found[np.abs(found) <= 1e5]


def errors(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """In units in the last place of the exact value."""
    return np.asarray(
        np.abs(found - exact) / np.spacing(np.maximum(np.abs(exact.astype(float)), 1e-300))
    )


@needs_compiler
@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no long double to compare with")
def test_one_unit_in_the_last_place(module: ModuleType) -> None:
    x = points()
    found = module.dynamics(0.0, x[:, None])
    exact = x.astype(np.longdouble)
    assert errors(found[:, 0], np.sin(exact)).max() <= 0.8
    assert errors(found[:, 1], np.cos(exact)).max() <= 0.8
    one_by_one = np.array([module.dynamics(0.0, value[None]) for value in x[::97]])
    assert np.abs(one_by_one - found[::97]).max() <= 2.3e-16


@needs_compiler
def test_nearest_to_multiples_of_half_a_turn(module: ModuleType) -> None:
    """Where almost nothing is left of the argument; mpmath reduces it with 60 digits."""
    multiples = [k * math.pi / 2 for k in (1, 2, 3, 4, 11, 37, 1571, 20_000, 44_441, 63_661)]
    x = np.array(
        [v for m in multiples for v in (m, -m, math.nextafter(m, 0), math.nextafter(m, 1e9))]
    )
    with mpmath.workdps(60):
        exact = [(mpmath.sin(mpmath.mpf(float(v))), mpmath.cos(mpmath.mpf(float(v)))) for v in x]
    for found in (module.dynamics(0.0, x[:, None]), [module.dynamics(0.0, v[None]) for v in x]):
        for row, wanted in zip(found, exact):
            for value, true in zip(row, wanted):
                assert abs((mpmath.mpf(float(value)) - true) / math.ulp(float(true))) <= 0.8


def shorter(x: np.ndarray, folder: Path, *flags: str) -> tuple[np.ndarray, np.ndarray]:
    """Sines and cosines of the function for steps of motions, as a compiler with `flags` has it."""
    text = emit(program(derived("four_bar"), None, ("dop853",)))["four_bar_batch.c"]
    found = re.search(r"^INLINE void four_bar_sincos_short.*?^}\n", text, re.MULTILINE | re.DOTALL)
    assert found
    (folder / "short.c").write_text(
        "#include <math.h>\n#include <stdint.h>\n#include <string.h>\n#define INLINE static inline\n"
        + found[0]
        + "void all(int n, const double *x, double *s, double *c)\n"
        "{\n    for (int i = 0; i < n; i++) four_bar_sincos_short(x[i], s + i, c + i);\n}\n"
    )
    command = compiler.find_compiler()
    assert command
    library = folder / f"short{len(flags)}.so"
    made = [*command, "-std=c99", "-O2", "-shared", "-fPIC", *flags, "short.c", "-o", str(library)]
    subprocess.run(made, cwd=folder, check=True)
    arrays = [np.ascontiguousarray(x), np.empty_like(x), np.empty_like(x)]
    ctypes.CDLL(str(library)).all(
        len(x), *(a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in arrays)
    )
    return arrays[1], arrays[2]


@needs_compiler
@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no long double to compare with")
@pytest.mark.parametrize("flags", [("-ffp-contract=off",), ("-march=native", "-ffp-contract=fast")])
def test_shorter_ones_of_steps(tmp_path: Path, flags: tuple[str, ...]) -> None:
    """With one rounding of a product and a sum, and with two."""
    x = points()
    sines, cosines = shorter(x, tmp_path, *flags)
    exact = x.astype(np.longdouble)
    assert np.abs(sines - np.sin(exact)).max() <= 2.3e-16
    assert np.abs(cosines - np.cos(exact)).max() <= 2.3e-16
    small = np.abs(x) <= 0.8
    assert errors(sines[small], np.sin(exact[small])).max() <= 1.6
    assert shorter(np.array([0.0, -0.0]), tmp_path, *flags)[0].tolist() == [0.0, 0.0]


@needs_compiler
def test_zeros_keep_their_signs(module: ModuleType) -> None:
    x = np.array([0.0, -0.0] * 9)
    assert (np.signbit(module.dynamics(0.0, x[:, None])[:, 0]) == np.signbit(x)).all()
    assert [np.signbit(module.dynamics(0.0, value[None])[0]) for value in x[:2]] == [False, True]


@needs_compiler
def test_the_library_beyond(module: ModuleType) -> None:
    x = np.array([1e5 + 1e-9, -123456.7, 3e8, 1e22, -1.7e308, 2.5, 7.0, 1e300])
    wanted = [(math.sin(value), math.cos(value)) for value in x]
    np.testing.assert_array_max_ulp(module.dynamics(0.0, x[:, None]), np.array(wanted), maxulp=1)
    for value, pair in zip(x, wanted):
        if abs(value) > 1e5:
            assert tuple(module.dynamics(0.0, value[None])) == pair
    x[[2, 5]] = np.nan, np.inf
    with pytest.warns(RuntimeWarning, match="2 of 8 rows failed and are NaN; row 2: not finite"):
        found = module.dynamics(0.0, x[:, None])
    assert np.isnan(found[[2, 5]]).all() and np.isfinite(np.delete(found, [2, 5], axis=0)).all()


@needs_compiler
def test_every_length_and_stride_of_a_batch(module: ModuleType) -> None:
    for n in (1, 2, 3, 5, 8, 13, 64):
        x = np.linspace(-3, 3, n)[:, None]
        wanted = np.hstack([np.sin(x), np.cos(x)])
        np.testing.assert_allclose(module.dynamics(np.zeros(n), x), wanted, rtol=1e-15, atol=1e-16)
        wide = np.zeros((n, 5))
        np.testing.assert_allclose(
            module.dynamics(0.0, x, out=wide[:, 1:3]), wanted, rtol=1e-15, atol=1e-16
        )
        np.testing.assert_allclose(wide[:, 1:3], wanted, rtol=1e-15, atol=1e-16)
        assert not wide[:, [0, 3, 4]].any()
        np.testing.assert_allclose(
            module.dynamics(0.0, x[::-1]), wanted[::-1], rtol=1e-15, atol=1e-16
        )
        status = module.dynamics(np.zeros((2, 1)), x)
        assert status.shape == (2, n, 2)


@needs_compiler
@pytest.mark.skipif(shutil.which("objdump") is None, reason="no disassembler")
def test_batches_are_vector_instructions(module: ModuleType) -> None:
    if "__AVX2__" not in compiler.probe(tuple(compiler.find_compiler()))[1]:
        pytest.skip("no AVX2 here")
    library = next(Path(module.__path__[0]).glob("libturn.*"))
    listing = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", str(library)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    lanes = (
        listing.split("<turn_dynamics_lanes>:")[1].split("\n\n")[0]
        if "<turn_dynamics_lanes>:" in listing
        else listing
    )
    packed = sum(
        lanes.count(name) for name in ("213pd", "231pd", "132pd", "mulpd", "addpd", "subpd")
    )
    assert packed > 30 and packed > 3 * sum(lanes.count(name) for name in ("mulsd", "addsd"))
