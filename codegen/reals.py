"""The precisions that generated code can work in, each a line of one table: its names in C and in
Python, and its digits.

The C templates and the numbers in them are written for double. `recast` makes C of another
precision of it, word by word: types, functions of libm and constants, which get their suffix;
comments and strings stay. What a tolerance is in another precision, the record says: in units of
rounding for residuals, the same share of the digits for what must stay away from zero.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from derive.diagnostics import HamelError, did_you_mean, listed

FUNCTIONS = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh",
    "atanh", "exp", "log", "expm1",
    "log1p", "erf", "floor", "ceil", "fabs", "pow", "atan2", "hypot", "fmin", "fmax", "copysign",
    "fmod",
    "remainder", "rint",
)  # fmt: skip


@dataclass(frozen=True)
class Real:
    """`name` is NumPy's, `c` the type in C; `reach` the largest angle of the inlined sine and
    cosine."""

    name: str
    c: str
    suffix: str  # of constants and of libm's functions
    python: str  # the dtype, as Python text
    parsed: str  # the letter of PyArg_ParseTuple
    digits: int  # to print so that the value reads back
    reach: str
    rtol: str  # of `simulate`, when none is given
    atol: str
    least_step: int  # of `simulate`, in units of rounding of the time
    words: Mapping[str, str] = field(
        default_factory=dict[str, str], repr=False
    )  # of C for double, and what stands for them

    @property
    def epsilon(self) -> float:
        """The distance from 1 to the next larger number: 2⁻⁵² of float64, 2⁻²³ of float32."""
        return float(np.finfo(self.name).eps)

    @property
    def bits(self) -> int:
        """The length of a number, from which follows how many a vector register holds."""
        return int(np.finfo(self.name).bits)

    @property
    def reach_squared(self) -> str:
        """reach² as a constant of C: the squares of four angles together are compared with it."""
        return f"1e{2 * int(self.reach[2:])}"

    @property
    def coarseness(self) -> float:
        """The unit of rounding in terms of that of double."""
        return self.epsilon / math.ulp(1.0)

    @property
    def dtype(self) -> str:
        """A last argument for NumPy's constructors, where it has to be said."""
        return f", dtype={self.python}" if self.words else ""

    @property
    def narrow(self) -> str:
        """The cast from a double, where it has to be said."""
        return f"({self.c})" if self.words else ""

    @property
    def widen(self) -> str:
        """The cast to a double, where it has to be said; `recast` knows the word."""
        return "(DOUBLE)" if self.words else ""

    def nearest(self, value: Any) -> Any:
        """A number, or an array of them, rounded to this precision; double again."""
        return (
            np.asarray(value, dtype=float).astype(self.name).astype(float) if self.words else value
        )

    def rounding(self, tolerance: float) -> float:
        """As many units of rounding as the tolerance is in double."""
        return tolerance * self.coarseness if self.words else tolerance

    def share(self, tolerance: float) -> float:
        """What leaves the same share of the digits as the tolerance does in double."""
        return (
            tolerance ** (math.log(self.epsilon) / math.log(math.ulp(1.0)))
            if self.words and tolerance > 0
            else tolerance
        )

    def wider(self, part: float) -> float:
        """How much farther from zero a pivot has to stay that in double may come to this part of
        its usual size."""
        return self.share(part) / part

    def rounded(self, text: str) -> str:
        """`rounding` of a number in a template, as text."""
        return f"{self.rounding(float(text)):.1e}" if self.words else text

    def shared(self, text: str) -> str:
        """`share` of a number in a template, as text."""
        return f"{self.share(float(text)):.1e}" if self.words else text

    def holds(self, value: float) -> bool:
        """Can it be written with all digits: zero, or neither too large nor too small? What is not
        finite is kept as it is."""
        limits = np.finfo(self.name)
        return (
            value == 0
            or not math.isfinite(value)
            or float(limits.tiny) <= abs(value) <= float(limits.max)
        )


FLOAT64 = Real("float64", "double", "", "float", "d", 17, "1e5", "1e-9", "1e-11", 16)
FLOAT32 = Real(
    "float32", "float", "f", "np.float32", "f", 9, "1e4", "1e-5", "1e-7", 2,
    {"double": "float", "DOUBLE": "double", "DBL_EPSILON": "FLT_EPSILON", "NPY_DOUBLE": "NPY_FLOAT"}
    | {name: f"{name}f" for name in FUNCTIONS},
)  # fmt: skip
REALS: tuple[Real, ...] = (FLOAT64, FLOAT32)


def real_of(name: str) -> Real:
    """The precision of that name. Raises HamelError where there is none."""
    known = {real.name: real for real in REALS}
    if name not in known:
        raise HamelError(
            f"unknown precision {name!r}; {did_you_mean(name, known) or listed(known)}"
        )
    return known[name]


_TOKENS = re.compile(
    r"""(?P<kept>/\*.*?\*/|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')"""
    r"|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<number>(?:0[xX][0-9a-fA-F.]+[pP][+-]?\d+"
    r"|(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)[fF]?)"
    r"|(?P<whole>\d\w*)",
    re.DOTALL,
)


def recast(source: str, real: Real) -> str:
    """C that was written for double in another precision: words by the table of `real`, constants
    with its suffix; comments and strings are kept. Text for double comes back as it is."""
    if not real.words:
        return source

    def token(found: re.Match[str]) -> str:
        if found["word"]:
            return real.words.get(found["word"], found["word"])
        return constant(found["number"], real) if found["number"] else found[0]

    return _TOKENS.sub(token, source)


def constant(text: str, real: Real) -> str:
    """A constant of C with its suffix, in as many digits as it takes; one that has a suffix is left
    alone."""
    if text[-1] in "fF":  # the exponent of a hexadecimal constant is decimal
        return text
    value = float.fromhex(text) if text[:2] in ("0x", "0X") else float(text)
    return f"{np.dtype(real.name).type(value)!s}{real.suffix}"
