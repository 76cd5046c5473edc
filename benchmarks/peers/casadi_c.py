"""C written by CasADi's generator as a contender."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from codegen import compiler
from peers.contest import BUILD, PLAIN, Contender, compiled, put

LOOP = """typedef long long integer;
int {function}(const double **arg, double **res, integer *iw, double *w, int mem);
int {function}_work(integer *args, integer *results, integer *integers, integer *doubles);
enum {{ MOST = 1 << 17 }};
static const double *arg[MOST];
static double *res[MOST], w[MOST];
static integer iw[MOST];
int bench_open(const char *argument)
{{
    integer args, results, integers, doubles;
    {function}_work(&args, &results, &integers, &doubles);
    return argument == 0 || args > MOST || results > MOST || integers > MOST || doubles > MOST;
}}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {{
        arg[0] = in;
        res[0] = out;
        {function}(arg, res, iw, w, 0);
    }}
}}
"""
Read = Callable[[np.ndarray], np.ndarray]


def of_function(
    peer: str, stem: str, function: ca.Function, inputs: np.ndarray, read: Read
) -> list[Contender]:
    """A function of one vector with one vector as result."""
    folder = BUILD / "models" / stem
    generator = ca.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    source = folder / f"{function.name()}.c"
    put(source, generator.dump())
    return of_source(peer, source, inputs, function.numel_out(0), read)


def of_source(
    peer: str, source: Path, inputs: np.ndarray, size: int, read: Read
) -> list[Contender]:
    """A file with a function of its own name: with everyday flags, and with all of ours."""
    loop = source.with_name(f"{source.stem}_loop.c")
    put(loop, LOOP.format(function=source.stem))
    made = []
    for flags, options in {
        "-O2": PLAIN,
        "our flags": (*compiler.FLAGS, *compiler.probe(("gcc",))[0]),
    }.items():
        library = compiled(f"{source.parent.name}-{source.stem}", {loop: PLAIN, source: options})
        made.append(
            Contender(peer, library, inputs, size, read=read, variant=f"{source.stem}, {flags}")
        )
    return made
