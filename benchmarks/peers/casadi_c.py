"""C written by CasADi's generator as a contender."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
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
SEVERAL = """typedef long long integer;
int {function}(const double **arg, double **res, integer *iw, double *w, int mem);
int {function}_work(integer *args, integer *results, integer *integers, integer *doubles);
integer {function}_n_in(void), {function}_n_out(void);
const integer *{function}_sparsity_in(integer i), *{function}_sparsity_out(integer i);
enum {{ MOST = 1 << 17 }};
static const double *arg[MOST];
static double *res[MOST], w[MOST];
static integer iw[MOST], from[8], to[8];
static integer entries(const integer *pattern)
{{
    return pattern[2] == 1 ? pattern[0] * pattern[1] : pattern[2 + pattern[1]]; /* dense, in short */
}}
int bench_open(const char *argument)
{{
    integer args, results, integers, doubles, i;
    {function}_work(&args, &results, &integers, &doubles);
    for (i = 0; i + 1 < {function}_n_in(); i++)
        from[i + 1] = from[i] + entries({function}_sparsity_in(i));
    for (i = 0; i + 1 < {function}_n_out(); i++)
        to[i + 1] = to[i] + entries({function}_sparsity_out(i));
    return argument == 0 || args > MOST || results > MOST || integers > MOST || doubles > MOST;
}}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {{
        for (integer k = 0; k < {function}_n_in(); k++)
            arg[k] = in + from[k];
        for (integer k = 0; k < {function}_n_out(); k++)
            res[k] = out + to[k];
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
    peer: str, source: Path, inputs: np.ndarray, size: int, read: Read, loop_text: str = LOOP
) -> list[Contender]:
    """A file with a function of its own name: with everyday flags, and with all of ours."""
    loop = source.with_name(f"{source.stem}_loop.c")
    put(loop, loop_text.format(function=source.stem))
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


def of_matrices(
    peer: str, source: Path, inputs: np.ndarray, shapes: Sequence[tuple[int, int]], read: Read
) -> list[Contender]:
    """A function of several vectors, one after the other in a row of `inputs`, with matrices of
    these shapes as results: their entries that are not zero, column by column. `read` gets all
    entries, row by row."""
    size = sum(rows * columns for rows, columns in shapes)
    made = of_source(peer, source, inputs, size, read, SEVERAL)
    patterns = _patterns(made[0].library, source.stem, len(shapes))

    def dense(rows: np.ndarray) -> np.ndarray:
        parts, begin = [], 0
        for row, column, shape in patterns:
            matrix = np.zeros((len(rows), *shape))
            matrix[:, row, column] = rows[:, begin : begin + len(row)]
            parts.append(matrix.reshape(len(rows), -1))
            begin += len(row)
        return read(np.hstack(parts))

    return [replace(contender, read=dense) for contender in made]


def _patterns(
    library: Path, function: str, count: int
) -> list[tuple[np.ndarray, np.ndarray, tuple[int, int]]]:
    """Rows and columns of what every result holds, and its shape."""
    call = getattr(ctypes.CDLL(str(library)), f"{function}_sparsity_out")
    call.argtypes, call.restype = [ctypes.c_longlong], ctypes.POINTER(ctypes.c_longlong)
    found = []
    for i in range(count):
        said = call(i)
        rows, columns = said[0], said[1]
        ends = np.array(said[2 : 3 + columns])
        if said[2] == 1:  # dense, in short
            ends = rows * np.arange(columns + 1)
            row = np.tile(np.arange(rows), columns)
        else:
            row = np.array(said[3 + columns : 3 + columns + int(ends[-1])])
        found.append((row, np.repeat(np.arange(columns), np.diff(ends)), (rows, columns)))
    return found
