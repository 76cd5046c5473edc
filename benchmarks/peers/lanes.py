"""The C that CasADi wrote of Pinocchio's recursion, recast: to vectors of several states with
libmvec, to numba, to JAX.

Its straight lines are read as text: loads, operations on temporaries, stores.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from codegen import compiler
from peers.casadi_c import Read
from peers.contest import PLAIN, Contender, compiled, put

LOAD = re.compile(r"^(a\d+)=arg\[0\]\? arg\[0\]\[(\d+)\] : 0;$")
STORE = re.compile(r"^if \(res\[0\]!=0\) res\[0\]\[(\d+)\]=(.+);$")
LANES = """#include <string.h>
enum {{ W = {width} }};
typedef double four __attribute__((vector_size(32)));
typedef double wide __attribute__((vector_size(8 * W)));
four _ZGVdN4v_sin(four);
four _ZGVdN4v_cos(four);
#define SPREAD(f) static inline wide f##_wide(wide x) \\
{{ four part; for (int k = 0; k < W; k += 4) {{ memcpy(&part, (double *)&x + k, 32); part = _ZGVdN4v_##f(part); \\
   memcpy((double *)&x + k, &part, 32); }} return x; }}
SPREAD(sin)
SPREAD(cos)
static inline wide casadi_sq(wide x) {{ return x * x; }}
int bench_open(const char *argument) {{ return argument == 0; }}
static __attribute__((noinline)) void body(const wide *in, wide *out)
{{
{declared}
{lines}
}}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    wide x[{inputs}], y[{outputs}];
    for (long i = 0; i + W <= n; i += W, in += W * in_size, out += W * out_size) {{
        for (int k = 0; k < {inputs}; k++)
            for (int lane = 0; lane < W; lane++) x[k][lane] = in[lane * in_size + k];
        body(x, y);
        for (int lane = 0; lane < W; lane++)
            for (int k = 0; k < {outputs}; k++) out[lane * out_size + k] = y[k][lane];
    }}
}}
"""


def statements(source: Path) -> list[str]:
    """The lines of the function's body, `in[k]` and `out[k]` in place of CasADi's pointers."""
    text = source.read_text()
    start = text.index("static int casadi_f0(")
    lines = [line.strip() for line in text[start : text.index("return 0;", start)].splitlines()[1:]]
    lines = [
        LOAD.sub(r"\1=in[\2];", line)
        for line in lines
        if line and not line.startswith("casadi_real")
    ]
    return [STORE.sub(r"out[\1]=\2;", line) for line in lines]


def vectors(source: Path, inputs: np.ndarray, size: int, read: Read) -> list[Contender]:
    """The compiler's vectors of four and eight lanes, with everyday flags and with all of ours."""
    lines = statements(source)
    names = sorted({name for line in lines for name in re.findall(r"\ba\d+\b", line)})
    body = [re.sub(r"\b(sin|cos)\(", r"\1_wide(", line) for line in lines]
    body = [
        re.sub(r"^(a\d+|out\[\d+\])=(-?[\d.][\d.e+-]*);$", r"\1=\2-(wide){0};", line)
        for line in body
    ]
    made = []
    for width in (4, 8):
        path = source.with_name(f"{source.stem}_lanes{width}.c")
        text = LANES.format(
            width=width,
            declared=f"    wide {', '.join(names)};",
            lines="\n".join(f"    {line}" for line in body),
            inputs=inputs.shape[1],
            outputs=size,
        )
        put(path, text)
        for flags, options in {
            "-O2": PLAIN,
            "our flags": (*compiler.FLAGS, *compiler.flags_of(["gcc"], "", "_batch")),
        }.items():
            library = compiled(
                f"{source.parent.name}-lanes{width}",
                {path: [*options, "-ffp-contract=fast", "-Wno-psabi"]},
                ["-lmvec"],
            )
            variant = f"{source.stem}, {width} lanes, {flags}"
            made.append(
                Contender("CasADi C in lanes", library, inputs, size, read=read, variant=variant)
            )
    return made


def python(source: Path, cos: str, sin: str) -> str:
    """The same lines in Python's words; `given` and `out` in place of the arrays."""
    lines = [
        re.sub(r"casadi_sq\((a\d+)\)", r"(\1*\1)", line.rstrip(";")) for line in statements(source)
    ]
    lines = [re.sub(r"\bin\[", "given[", line) for line in lines]
    return "\n".join(
        re.sub(r"\bcos\(", f"{cos}(", re.sub(r"\bsin\(", f"{sin}(", line)) for line in lines
    )
