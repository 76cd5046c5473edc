"""Functions of the C library that are written anew for loops over lanes: against many digits, and
where they are used."""

import ctypes
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
BOUND = {"expm1": 2.0, "cosh": 2.0, "log1p": 2.0} | dict.fromkeys(
    ("tanh", "sinh", "asin", "acos"), 2.5
)  # else 1.5
TINY = 2.0**-1022
UNUSUAL = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 1e300, -1e300, 1e-310, 1.0, -1.0]


@pytest.fixture(scope="module", params=[("-O3", "-march=native"), ("-O0", "-ffp-contract=off")])
def library(request, tmp_path_factory):
    names = sorted(name.upper() for name in LIBRARY)
    called = [*names, *set(_MADE_OF.values())]
    program = SimpleNamespace(real=next(real for real in REALS if real.bits == 64))
    functions = text.render("lane_functions.c.j2", program, called=called)
    loops = [LOOP.format(name=x, more=", y[i]" if x == "ATAN2" else "") for x in names]
    folder = tmp_path_factory.mktemp("lanes")
    (folder / "lanes.c").write_text(HEAD + functions + "".join(loops))
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
    every = np.concatenate(
        [
            random.uniform(-1, 1, 400),
            random.uniform(-40, 40, 400),
            random.choice([-1, 1], 400) * 10.0 ** random.uniform(-300, 300, 400),
            random.choice([-1, 1], 300) * 10.0 ** random.uniform(-20, 3, 300),
            1.0 + 10.0 ** random.uniform(-16, -1, 100),
            1.0 - 10.0 ** random.uniform(-16, -1, 100),
        ]
    )
    if name in ("asin", "acos"):
        return every[np.abs(every) <= 1]
    return np.abs(every) if name == "log" else every[every > -1] if name == "log1p" else every


def exact(name: str, x: float, y: float) -> mpmath.mpf:
    with mpmath.workdps(60):
        given = (mpmath.mpf(x), mpmath.mpf(y)) if name == "atan2" else (mpmath.mpf(x),)
        return getattr(mpmath, name)(*given)


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_each_is_that_of_many_digits_to_some_units_in_the_last_place(library, name):
    x = arguments(name)
    y = np.random.default_rng(4).permutation(x)
    rows = found(library, name, x, y)
    worst = 0.0
    for value, a, b in zip(rows, x, y):
        if name in ("sinh", "cosh") and abs(a) > 709.9:
            assert np.isnan(value)  # the function for one state knows
            continue
        wanted = exact(name, a, b)
        if abs(wanted) > mpmath.mpf(np.finfo(float).max):
            assert value == np.copysign(np.inf, float(mpmath.sign(wanted)))
        elif abs(wanted) < TINY:
            assert abs(value - wanted) <= 5e-324
        else:
            worst = max(worst, float(abs(value - wanted) / np.spacing(abs(float(wanted)))))
    assert worst < BOUND.get(name, 1.5)


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_unusual_arguments_give_what_the_library_gives_or_no_number(library, name):
    x = np.repeat(UNUSUAL, len(UNUSUAL))
    y = np.tile(UNUSUAL, len(UNUSUAL))
    called = {"atan2": np.arctan2, "atan": np.arctan, "asin": np.arcsin, "acos": np.arccos}
    function = called.get(name) or getattr(np, name)
    with np.errstate(all="ignore"):
        wanted = function(x, y) if name == "atan2" else function(x)
    rows = found(library, name, x, y)
    same = np.isclose(rows, wanted, rtol=1e-15, atol=5e-324) | np.isnan(rows)
    negative_zero = (name == "atan2") & (y == 0) & np.signbit(y) & (x == 0)  # any angle there
    assert np.all(same | negative_zero)
    plain = np.isfinite(x) & np.isfinite(wanted)
    if name not in ("sinh", "cosh"):
        assert np.isfinite(rows[plain & (np.isfinite(y) | (name != "atan2"))]).all()
