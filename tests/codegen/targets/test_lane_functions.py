"""Functions of the C library that are written anew for loops over lanes: against many digits, and
where they are used."""

import ctypes
import platform
import re
import shutil
import subprocess
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest

from codegen import text
from codegen.passes.lanes import LIBRARY
from codegen.reals import REALS
from codegen.targets.c import _MADE_OF  # type: ignore[reportPrivateUsage]

pytestmark = pytest.mark.optimised

HEAD = """#include <math.h>
#include <stdint.h>
#include <string.h>
#define INLINE static inline
"""
LOOP = """
void {name}_loop(int n, const double *restrict x, const double *restrict y, double *restrict out)
{{
    (void)y;
    for (int i = 0; i < n; i++)
        out[i] = {name}(x[i]{more});
}}
"""
OF_TWO = ("ATAN2", "POW")
BOUND = {"exp": 1.0, "log": 1.0}  # units in the last place, else 1.5
TINY = 2.0**-1022
MOST = np.finfo(float).max
UNUSUAL = [0.0, np.inf, np.nan, 5e-324, 1e-310, 1e-300, 2.0**-54, 0.5, 1.0, 1e200, 1e300, MOST]
UNUSUAL = [sign * value for value in UNUSUAL for sign in (1.0, -1.0)]
BORDERS = [np.tan(np.pi / 8), 1.0, np.tan(3 * np.pi / 8)]  # of atan: where a polynomial ends


def source() -> tuple[list[str], str]:
    """Names of the functions, and them with a loop for each."""
    names = sorted(name.upper() for name in LIBRARY)
    called = [*names, *set(_MADE_OF.values())]
    program = SimpleNamespace(real=next(real for real in REALS if real.bits == 64))
    functions = text.render("lane_functions.c.j2", program, called=called)
    loops = [LOOP.format(name=x, more=", y[i]" if x in OF_TWO else "") for x in names]
    return names, HEAD + functions + "".join(loops)


@pytest.fixture(scope="module", params=[("-O3", "-march=native"), ("-O0", "-ffp-contract=off")])
def library(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lanes")
    (folder / "lanes.c").write_text(source()[1])
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fno-math-errno", "-fno-trapping-math"]
    command = [shutil.which("gcc") or "cc", *flags, *request.param, "-shared", "-fPIC"]
    subprocess.run([*command, "lanes.c", "-o", "lanes.so", "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "lanes.so"))


def found(library, name: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    out, pointer = np.empty_like(x), ctypes.POINTER(ctypes.c_double)
    rows = (np.ascontiguousarray(a).ctypes.data_as(pointer) for a in (x, y, out))
    getattr(library, f"{name.upper()}_loop")(len(x), *rows)
    return out


def arguments(name: str) -> np.ndarray:
    random = np.random.default_rng(3)
    sign = random.choice([-1, 1], 3_000)
    every = np.concatenate(
        [
            random.uniform(-1, 1, 2_000),
            random.uniform(-40, 40, 1_000),
            sign[:400] * 10.0 ** random.uniform(-323, 308, 400),
            sign[:300] * 10.0 ** random.uniform(-20, 3, 300),
            sign[:300] * random.uniform(700, 746, 300),  # where exponentials end
            sign[:300] * random.uniform(0.1, 0.6, 300),
            *(sign[:300] * border * random.uniform(0.999, 1.001, 300) for border in BORDERS),
            *(sign[:200] * (1.0 + k * 10.0 ** random.uniform(-16, -1, 200)) for k in (-1, 1)),
            *(sign[:200] * (0.5 + k * 10.0 ** random.uniform(-16, -1, 200)) for k in (-1, 1)),
        ]
    )
    if name in ("asin", "acos"):
        return every[np.abs(every) <= 1]
    return np.abs(every) if name == "log" else every[every > -1] if name == "log1p" else every


def pairs(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arguments of atan2: of any size, near each other, at borders, each near overflow and below
    what is normal."""
    random = np.random.default_rng(4)
    size = 10.0 ** np.concatenate([random.uniform(305, 308, 700), random.uniform(-323, -305, 700)])
    size = np.concatenate([size, 10.0 ** random.uniform(-300, 300, 700)])
    ratio = random.choice(BORDERS, len(size)) * 10.0 ** random.uniform(-1, 1, len(size)) ** 3
    ratio *= random.choice([-1, 1], len(size))
    with np.errstate(over="ignore"):
        near = np.clip(size * ratio, -MOST, MOST)
    along, across = (np.concatenate(both) for both in ((size, near), (near, size)))
    return np.concatenate([x, across]), np.concatenate([random.permutation(x), along])


def powers(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of every size up to where they end, and whole ones of negative numbers."""
    random = np.random.default_rng(5)
    base = np.concatenate([np.abs(x), 10.0 ** random.uniform(-323, 308, 2_000)])
    base = base[(base > 0) & (base != 1.0)]
    with np.errstate(all="ignore"):
        exponent = random.uniform(-745, 709, len(base)) / np.log(base)
    exponent[::3] = random.uniform(-3, 3, len(exponent[::3]))
    whole = random.integers(-7, 8, len(x)).astype(float)
    near = 1.0 + random.normal(size=400) * 10.0 ** random.uniform(-15, -1, 400)
    near = near[near != 1.0]
    far = random.uniform(-700, 700, len(near)) / np.log(near)
    first, second = np.concatenate([base, x, near]), np.concatenate([exponent, whole, far])
    plain = np.isfinite(second) & (first != 0)
    return first[plain], second[plain]


def given(name: str) -> tuple[np.ndarray, np.ndarray]:
    found = arguments(name)
    return pairs(found) if name == "atan2" else powers(found) if name == "pow" else (found, found)


def exact(name: str, x: float, y: float) -> mpmath.mpf:
    with mpmath.workdps(60):
        both = mpmath.mpf(x), mpmath.mpf(y)
        if name == "pow":
            return mpmath.power(*both)
        return getattr(mpmath, name)(*(both if name == "atan2" else both[:1]))


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_each_is_that_of_many_digits_to_some_units_in_the_last_place(library, name):
    x, y = given(name)
    rows = found(library, name, x, y)
    worst = 0.0
    for value, a, b in zip(rows, x, y):
        wanted = exact(name, a, b)
        if abs(wanted) > mpmath.mpf(MOST):
            assert value == np.copysign(np.inf, float(mpmath.sign(wanted)))
        elif abs(wanted) < TINY:
            assert abs(value - wanted) <= 5e-324
        else:
            worst = max(worst, float(abs(value - wanted) / np.spacing(abs(float(wanted)))))
    assert worst < BOUND.get(name, 1.5)


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_unusual_arguments_give_what_the_library_gives(library, name):
    x = np.repeat(UNUSUAL, len(UNUSUAL))
    y = np.tile(UNUSUAL, len(UNUSUAL))
    called = {
        "pow": np.float_power,
        "atan2": np.arctan2,
        "atan": np.arctan,
        "asin": np.arcsin,
        "acos": np.arccos,
    }
    function = called.get(name) or getattr(np, name)
    with np.errstate(all="ignore"):
        wanted = function(x, y) if name.upper() in OF_TWO else function(x)
    rows = found(library, name, x, y)
    np.testing.assert_allclose(rows, wanted, rtol=1e-15, atol=5e-324)
    finite = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(rows[finite]), np.signbit(wanted[finite]))


@pytest.mark.skipif(
    platform.machine() != "x86_64" or shutil.which("gcc") is None, reason="gcc's report of loops"
)
def test_compilers_make_vector_instructions_of_each(tmp_path):
    """gcc drops a loop whose conditions it moves about; all of a model's function goes with it."""
    names, written = source()
    (tmp_path / "lanes.c").write_text(written)
    flags = ["-std=c99", "-O3", "-mavx2", "-mfma", "-fno-math-errno", "-fno-trapping-math"]
    command = ["gcc", *flags, "-fopt-info-vec-optimized", "-S", "lanes.c", "-o", "lanes.s"]
    report = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = {int(x) for x in re.findall(r"lanes\.c:(\d+):\d+: optimized: loop", report.stderr)}
    loops = [k for k, line in enumerate(written.splitlines(), 1) if "for (int i = 0" in line]
    assert dict(zip(names, loops)) == {n: k for n, k in zip(names, loops) if k in lines}
