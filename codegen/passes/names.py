"""Identifiers that are safe in C and Python alike, made from the names a model uses."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

from codegen.reals import REALS

_C = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while asm typeof linux unix bool true false NULL NAN INFINITY HUGE_VAL
EOF errno main isnan isinf isfinite M_PI M_E M_PI_2 M_PI_4 M_1_PI M_2_PI M_SQRT2 M_LN2 M_LN10
M_LOG2E M_LOG10E M_2_SQRTPI M_SQRT1_2 FP_NAN FP_ZERO j0 j1 jn y0 y1 yn gamma lgamma tgamma
remainder div abs labs exp2 log2 log10 log1p cbrt round trunc rint nan fma erf erfc signbit
ldexp frexp modf scalb logb FP_NORMAL FP_SUBNORMAL FP_INFINITE HUGE_VALF HUGE_VALL SIZE_MAX
isnormal fpclassify offsetof
"""
# macros of the generated C, and functions that are called where locals are
_MACROS = """
ALIGNED APART AT BY_FOURS COLD EXPORT EXPORTED FAR INLINE PART RARE RARELY SEPARATE WHOLE
casadi_int casadi_real clear give hand look take
"""
_OURS = """
t t_ c x u p out work lane LANES LARGER SMALLER EXP EXPM1 LOG LOG1P TANH SINH COSH ATAN ATAN2
ASIN ACOS POW quarter_expm1 turned arc head log_head bad stray np math status step k finite residual
error rows side sides solved others power power0 power1 out0 out1
where isscalar sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log expm1 sqrt
fabs floor ceil pow atan2 hypot fmin fmax copysign fmod sign
"""
_RECAST = (word for real in REALS for pair in real.words.items() for word in pair)
RESERVED = frozenset(
    [
        *_C.split(),
        *_MACROS.split(),
        *_OURS.split(),
        *_RECAST,
        *keyword.kwlist,
        *keyword.softkwlist,
    ]
)


def identifier(label: str) -> str:
    """An identifier like the label: der(q1) → der_q1, base.vx → base_vx."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", label).strip("_") or "value"
    return f"n{name}" if name[0].isdigit() else name


class Names:
    """Gives out names, each only once."""

    def __init__(self, taken: Iterable[str] = RESERVED) -> None:
        self.taken = set(taken)
        self._next: dict[str, int] = {}

    def __call__(self, wanted: str) -> str:
        """The wanted name, or with a number appended; plain "z" is always numbered."""
        name = wanted
        while name in self.taken or name == "z":
            self._next[wanted] = self._next.get(wanted, 0 if wanted == "z" else 1) + 1
            name = (
                f"{wanted}{self._next[wanted]}"
                if wanted == "z"
                else f"{wanted}_{self._next[wanted]}"
            )
        self.taken.add(name)
        return name
