"""Whole simulations as contenders: ours, a plain loop of DOP853, CasADi's exported loop of RK4, and
the solvers of libraries."""

from __future__ import annotations

import ctypes
import itertools
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from multiprocessing.connection import Connection
from pathlib import Path

import casadi as ca
import numpy as np

from codegen import compiler
from codegen.emit import emit
from codegen.integrators import DOP853
from codegen.passes import program
from codegen.program import Program
from codegen.targets.schemes import number
from derive.formulations.records import Equations
from hamel.simulate.libraries import REFERENCES, Problem
from hamel.simulate.libraries.sundials import compiled_by_casadi
from peers.contest import BUILD, HERE, PLAIN, compiled
from peers.mechanisms import Mechanism

TOLERANCES = tuple(-5 - k / 4 for k in range(33))  # decimal exponents
INTEGRATORS = ("verner9", "dop853", "taylor")
COARSE = tuple(-6.0 - k / 2 for k in range(16))  # for what takes long
PATIENCE = 2.0  # seconds for what is not timed
LONGEST = 1.5  # seconds of a run; tighter ones are not tried after that
End = np.ndarray


@dataclass(frozen=True)
class Course:
    """A motion to simulate from y = (q, q̇) over `span` seconds, and the mechanism it is of."""

    mechanism: Mechanism
    start: End
    span: float

    @property
    def folder(self) -> Path:
        found = BUILD / "whole" / self.mechanism.name
        found.mkdir(parents=True, exist_ok=True)
        return found


@dataclass(frozen=True)
class Simulation:
    """`run(setting, repeats)`: the least ms and (q, q̇) at the end, None where it stops early."""

    peer: str
    variant: str
    run: Callable[[float, int], tuple[float, End] | None]
    settings: Sequence[float] = TOLERANCES


@dataclass(frozen=True)
class Chosen:
    """A setting of a simulation, with the ms it takes and the error it ends with."""

    simulation: Simulation
    setting: float
    ms: float
    error: float


def in_turn(chosen: Sequence[Chosen], rounds: int, share: float) -> list[float]:
    """The least ms of each, all in turn: each is timed `rounds` times for `share` ms."""
    least = [c.ms for c in chosen]
    for _ in range(rounds):
        for i, c in enumerate(chosen):
            made = c.simulation.run(c.setting, max(1, round(share / c.ms)))
            if made is not None:
                least[i] = min(least[i], made[0])
    return least


# ---- ours


def ours(
    of: Equations, x: np.ndarray, u: np.ndarray, rates: Callable[[End], End], span: float
) -> Iterator[Simulation]:
    """With the functions of an everyday module, and with nothing to watch; with each enforcement.
    All numbers are folded in."""
    needed = tuple(
        function.name for function in of.functions if function.name in ("dynamics", "project")
    )
    for name, functions in (("default functions", None), ("lean", needed)):
        made = program(of, functions, INTEGRATORS)
        folder = (
            BUILD / "whole" / f"{made.name}-{of.formulation}-{of.choice or 'v'}-{name.split()[0]}"
        )
        folder.mkdir(parents=True, exist_ok=True)
        files = emit(made)
        loop = folder / "loop.c"
        texts = {file: text for file, text in files.items() if file.endswith((".c", ".h"))} | {
            "loop.c": _loop(made, x, u, span)
        }
        for file, text in texts.items():
            _write(folder / file, text)
        apart = {
            "example.c",
            "loop.c",
            *(f"{made.name}_{part}.c" for part in ("cpu", "module")),
        }
        sources = {loop: ["-O2", f"-I{folder}", f"-I{HERE}"]}
        for path in (folder / file for file in texts if file.endswith(".c") and file not in apart):
            sources[path] = [*compiler.FLAGS, *compiler.flags_of(["gcc"], made.name, path.stem)]
        library = _library(compiled(folder.name, sources))
        for (i, integrator), (k, enforcement) in itertools.product(
            enumerate(INTEGRATORS), enumerate(made.enforcements)
        ):
            run = _run(
                library, len(x), rates, lambda i=i, k=k, library=library: library.choose(i, k)
            )
            yield Simulation(
                "hamel", f"{of.formulation} {of.choice}, {integrator}, {enforcement}, {name}", run
            )


def _loop(made: Program, x: np.ndarray, u: np.ndarray, span: float) -> str:
    name, big = made.name, made.name.upper()
    reduced = ", 0" if made.turning else ""
    return f"""#include "{name}_simulate.h"
#include <math.h>
static int integrator, enforcement;
void choose(int first, int second) {{ integrator = first; enforcement = second; }}
static int once(double setting, double *end)
{{
    static const double x[] = {_values(x)}, u[] = {_values([*u, 0.0])}, times[] = {{{span!r}}};
    {name}_simulation s = {{0}};
    double work;
    s.integrator = integrator;
    s.enforcement = enforcement;
    for (int i = 0; i < {big}_NX; i++)
        s.x[i] = x[i];
    return {name}_simulate(&s, 1, times, u, 0, pow(10.0, setting), pow(10.0, setting - 2.0), 100000000, end, &work{reduced});
}}
#include "whole.c"
"""


# ---- the augmented system, compiled by CasADi


def plain(of: Course) -> Iterator[Simulation]:
    """DOP853 in a plain loop, with everyday flags and with all of ours."""
    y = len(of.start)
    _write(of.folder / "rates.c", _code(of.mechanism.rates))
    source = of.folder / "plain.c"
    _write(source, _plain(of))
    for flags, options in _flags().items():
        library = _library(
            compiled(
                f"whole-{of.mechanism.name}-plain",
                {source: [*options, f"-I{HERE}", f"-I{of.folder}"]},
            )
        )
        yield Simulation("plain C DOP853 loop, CasADi augmented", flags, _run(library, y))


def _plain(of: Course) -> str:
    stages = []
    for k, (c, weights) in enumerate(zip(DOP853.c[1:], DOP853.a[1:]), 1):
        stages.append(f"for (int i = 0; i < N; i++) z[i] = y[i] + h * ({combination(weights)});")
        if k < 12:
            stages.append(f"RHS(t + {number(c)} * h, z, k[{k}]);")
    errors = [
        f"for (int i = 0; i < N; i++) e[i] = {combination(weights)};" for weights in DOP853.errors
    ]
    return f"""#define N {len(of.start)}
#define T_END {of.span!r}
#define START {_values(of.start)}
#define STAGES {" ".join(stages)}
#define ERROR5 {errors[0]}
#define ERROR3 {errors[1]}
#include "rates.c"
static void right(double t, const double *y, double *dy)
{{
    const double *arg[] = {{&t, y}};
    double *res[] = {{dy}};
    rates(arg, res, 0, 0, 0);
}}
#define RHS right
#include "dop853.c"
#include "whole.c"
"""


def combination(weights: Sequence[Fraction]) -> str:
    """The sum of weights times slopes as C."""
    terms = [(weight, f"k[{i}][i]") for i, weight in enumerate(weights) if weight]
    first = f"{number(terms[0][0])} * {terms[0][1]}"
    return first + "".join(f" {'-' if w < 0 else '+'} {number(abs(w))} * {k}" for w, k in terms[1:])


def exported(of: Course, error: Callable[[End], float], within: float) -> Iterator[Simulation]:
    """The loop of RK4 that CasADi exports (fold), in as few steps as meet the error; its exported
    step finds how many."""
    size, count = len(of.start), _fewest(of, error, within)
    step = _step(of.mechanism)
    z = ca.MX.sym("z", size + 1)
    h = of.span / count
    fixed = ca.Function("fixed", [z], [step(z, h)])
    loop = ca.Function("motion", [z], [fixed.fold(count)(z)[1:]])
    source = of.folder / f"rk4_{count}.c"
    start = _values([0.0, *of.start])
    once = (
        f"static int once(double setting, double *end) {{ static const double start[] = {start}; static double *res[MOST];"
        " arg[0] = start; res[0] = end; (void)setting; return motion(arg, res, iw, w, 0); }"
    )
    _write(source, _code(loop) + _WORK + once + '\n#include "whole.c"\n')
    for flags, options in _flags().items():
        library = _library(
            compiled(f"whole-{of.mechanism.name}-rk4", {source: [*options, f"-I{HERE}"]})
        )
        yield Simulation(
            "CasADi's exported RK4 loop", f"{count} steps, {flags}", _run(library, size), (0.0,)
        )


_WORK = "enum { MOST = 4096 };\nstatic const double *arg[MOST];\nstatic double w[1 << 20];\nstatic casadi_int iw[1 << 16];\n"


def _step(of: Mechanism) -> ca.Function:
    """(t, y) a step of h further."""
    size = of.rates.numel_out(0)
    z, h = ca.SX.sym("z", size + 1), ca.SX.sym("h")
    t, y = z[0], z[1:]
    k1 = of.rates(t, y)
    k2 = of.rates(t + h / 2, y + h / 2 * k1)
    k3 = of.rates(t + h / 2, y + h / 2 * k2)
    k4 = of.rates(t + h, y + h * k3)
    return ca.Function("step", [z, h], [ca.vertcat(t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))])


def _fewest(of: Course, error: Callable[[End], float], within: float) -> int:
    """Steps of RK4, to two per cent, by its fourth order and then by trial."""
    source = of.folder / "step.c"
    body = f"""static int once(double setting, double *end)
{{
    double z[] = {_values([0.0, *of.start])}, next[N], h = {of.span!r} / setting;
    for (long i = 0; i < (long)setting; i++) {{
        const double *arg[] = {{z, &h}};
        double *res[] = {{next}};
        step(arg, res, 0, 0, 0);
        memcpy(z, next, sizeof z);
    }}
    memcpy(end, z + 1, sizeof z - sizeof *z);
    return 0;
}}
#include "whole.c"
"""
    _write(
        source,
        f"#include <string.h>\nenum {{ N = {len(of.start) + 1} }};\n"
        + _code(_step(of.mechanism))
        + body,
    )
    run = _run(
        _library(compiled(f"whole-{of.mechanism.name}-step", {source: [*PLAIN, f"-I{HERE}"]})),
        len(of.start),
    )
    count = 500
    while _error(run, count, error) > within:
        count *= 2
    low, high = count // 2, count
    while high > 1.02 * low:
        middle = round((low * high) ** 0.5)
        low, high = (middle, high) if _error(run, middle, error) > within else (low, middle)
    return high


def _error(
    run: Callable[[float, int], tuple[float, End] | None],
    setting: float,
    error: Callable[[End], float],
) -> float:
    made = run(setting, 1)
    return np.inf if made is None else error(made[1])


# ---- libraries


def cvodes(of: Course) -> Iterator[Simulation]:
    """Through CasADi over the compiled system, with and without stiffness in mind."""
    size = len(of.start)
    external = compiled_by_casadi(of.mechanism.rates)
    t, y, ts, ys = ca.MX.sym("t"), ca.MX.sym("y", size), ca.SX.sym("t"), ca.SX.sym("y", size)
    systems = {
        "compiled": {"x": y, "t": t, "ode": external(t, y)},
        "interpreted": {"x": ys, "t": ts, "ode": of.mechanism.rates(ts, ys)},
    }
    for (how, system), (method, solver) in itertools.product(
        systems.items(), (("bdf", "newton"), ("adams", "functional"))
    ):
        given = {
            "linear_multistep_method": method,
            "nonlinear_solver_iteration": solver,
            "max_num_steps": 10**7,
        }

        def run(
            setting: float,
            repeats: int,
            given: dict[str, object] = given,
            system: dict[str, object] = system,
        ) -> tuple[float, End] | None:
            tight = {"reltol": 10**setting, "abstol": 10 ** (setting - 2)}
            motion = ca.integrator("motion", "cvodes", system, 0.0, of.span, {**given, **tight})
            return timed(lambda: np.asarray(motion(x0=of.start)["xf"]).ravel(), repeats)

        yield Simulation("CVODES", f"{method}, {solver}, {how}", run, COARSE)


def libraries(
    module: object,
    found: Equations,
    x: np.ndarray,
    u: np.ndarray,
    to: Callable[[End], End],
    span: float,
) -> Iterator[Simulation]:
    """SciPy and IDAS over our compiled functions, as `hamel report` runs them."""
    for reference in REFERENCES:
        if reference.name == "cvodes" or reference.refusal(found):
            continue

        def run(
            setting: float, repeats: int, reference: object = reference
        ) -> tuple[float, End] | None:
            rtol = 10**setting
            p = np.array(found.parameters)
            problem = Problem(module, found, np.array([0.0, span]), x, u, p, rtol, rtol / 100, True)  # type: ignore[arg-type]
            motion = reference.prepare(problem)  # type: ignore[attr-defined]
            return timed(lambda: to(motion().x[-1]), repeats)

        yield Simulation(reference.name, f"{found.formulation} {found.choice}", run, COARSE)


def timed(call: Callable[[], End], repeats: int) -> tuple[float, End] | None:
    """In a process of its own, for a library that does not come to its end cannot be interrupted
    otherwise."""
    here, there = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(
        target=_repeated, args=(call, repeats, there)
    )
    child.start()
    made = here.recv() if here.poll(PATIENCE + 2 * LONGEST * repeats) else None
    child.kill()
    child.join()
    return made


def _repeated(call: Callable[[], End], repeats: int, to: Connection) -> None:
    least, end = np.inf, None
    for _ in range(repeats):
        begin = time.perf_counter()
        try:
            end = call()
        except (FloatingPointError, RuntimeError):
            to.send(None)
            return
        least = min(least, 1e3 * (time.perf_counter() - begin))
    to.send((least, end))


# ---- C


def _run(
    library: ctypes.CDLL,
    size: int,
    to: Callable[[End], End] = lambda end: end,
    before: Callable[[], object] = lambda: None,
) -> Callable[[float, int], tuple[float, End] | None]:
    def run(setting: float, repeats: int) -> tuple[float, End] | None:
        before()
        end = np.empty(size)
        ms = library.whole(setting, repeats, end.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
        return None if ms < 0 or not np.isfinite(end).all() else (ms, to(end))

    return run


def _library(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    library.whole.restype = ctypes.c_double
    library.whole.argtypes = [ctypes.c_double, ctypes.c_long, ctypes.POINTER(ctypes.c_double)]
    return library


def _flags() -> dict[str, Sequence[str]]:
    return {
        "-O2": PLAIN,
        "our flags": (*compiler.FLAGS, *compiler.probe(("gcc",))[0], "-std=gnu11"),
    }


def _code(function: ca.Function) -> str:
    generator = ca.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    return generator.dump()


def _values(values: Sequence[float] | np.ndarray) -> str:
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
