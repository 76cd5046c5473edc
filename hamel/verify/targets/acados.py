"""The acados target, without acados: its C compiled against the BLASFEO in CasADi, called
as acados calls it (vectors and matrices inside larger ones), and compared with Runge-Kutta steps of
the module and their differences."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from codegen import compiler
from derive.diagnostics import ToolchainError, VerificationError
from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.records import Row, Subject, TargetCheck, result

STEP, SUBSTEPS = 0.01, 2  # s; shorter where the state moves fast
MOVE = 0.1  # of the sizes of its entries the state may move in a step
BY = 1e-4  # of differences, relative
DIFFERENCES = 1e-6  # to what derivatives and differences of the fourth order must agree
STRICT = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
HEADER = "blasfeo_d_aux.h"
# all that acados itself adds to BLASFEO here, in its own layout
EXTERNAL = """#ifndef EXTERNAL_FUNCTION_GENERIC_H
#define EXTERNAL_FUNCTION_GENERIC_H
struct blasfeo_dmat_args { struct blasfeo_dmat *A; int ai, aj; };
struct blasfeo_dvec_args { struct blasfeo_dvec *x; int xi; };
#endif
"""
# vectors and matrices of BLASFEO's own, the results inside larger ones; u before x in one vector
CALLER = """
#include "blasfeo_d_aux_ext_dep.h"
static void zeros(struct blasfeo_dmat *A, int m, int n)
{{
    int i, j;
    blasfeo_allocate_dmat(m, n, A);
    for (i = 0; i < m; i++)
        for (j = 0; j < n; j++)
            blasfeo_dgein1(0.0, A, i, j);
}}
static void vector(struct blasfeo_dvec *v, int n, const double *values)
{{
    int i;
    blasfeo_allocate_dvec(n, v);
    for (i = 0; i < n; i++)
        blasfeo_dvecin1(values[i], v, i);
}}
int call(int results, double *ux, double *pi, double *p, double *fun, double *jac, double *hess);
int call(int results, double *ux, double *pi, double *p, double *fun, double *jac, double *hess)
{{
    struct blasfeo_dvec z, l, f;
    struct blasfeo_dmat B, H;
    struct blasfeo_dvec_args x = {{&z, NU}}, u = {{&z, 0}}, by = {{&l, 0}}, to = {{&f, 0}};
    struct blasfeo_dmat_args J = {{&B, 3, 1}}, S = {{&H, 1, 1}};
    void *in[3] = {{&x, &u, &by}}, *out[3] = {{&to, &J, &S}};
    int i, j, status;
    vector(&z, NZ, ux);
    vector(&l, NX, pi);
    vector(&f, NX, fun);
    zeros(&B, NZ + 4, NX + 2);
    zeros(&H, NZ + 2, NZ + 2);
    status = results == 1 ? {name}_disc_dyn_fun(in, out, p) : results == 2 ?
        {name}_disc_dyn_fun_jac(in, out, p) : {name}_disc_dyn_fun_jac_hess(in, out, p);
    for (i = 0; i < NX; i++)
        fun[i] = blasfeo_dvecex1(&f, i);
    for (i = 0; i < NZ; i++) {{
        for (j = 0; j < NX; j++)
            jac[i * NX + j] = blasfeo_dgeex1(&B, 3 + i, 1 + j);
        for (j = 0; j < NZ; j++)
            hess[i * NZ + j] = blasfeo_dgeex1(&H, 1 + i, 1 + j);
    }}
    blasfeo_free_dmat(&H);
    blasfeo_free_dmat(&B);
    blasfeo_free_dvec(&f);
    blasfeo_free_dvec(&l);
    blasfeo_free_dvec(&z);
    return status;
}}
"""
Step = Callable[[Array], Array]


@dataclass(frozen=True)
class Answer:
    """x⁺, ∂x⁺/∂(u, x) transposed, ∂²(πᵀ x⁺)/∂(u, x)²."""

    fun: Array
    jacobian: Array
    hessian: Array


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """ToolchainError without a C compiler."""
    command = compiler.find_compiler()
    if command is None:
        raise ToolchainError("no C compiler", "apt install gcc")
    with tempfile.TemporaryDirectory() as folder:
        library = _library(subject, Path(folder), command)
        errors = np.array(list(_errors(subject, library)))
    values, same, jacobians, hessians = errors.T if errors.size else [[]] * 4
    about = f"{SUBSTEPS} Runge-Kutta steps, with BLASFEO; not run with acados"
    return (
        result(subject, "steps", [*values], about),
        result(subject, "one step by all three functions", [*same], "with and without derivatives"),
        _differences("Jacobian", [*jacobians]),
        _differences("Hessian", [*hessians]),
    )


def _differences(name: str, errors: list[float]) -> CheckResult:
    value = float(np.max(errors, initial=0.0)) if errors else np.inf
    passed = bool(value <= DIFFERENCES)
    return CheckResult(name, value, DIFFERENCES, passed, "against differences of order 4")


def _library(subject: Subject, place: Path, command: list[str]) -> ctypes.CDLL:
    (place / "acados" / "utils").mkdir(parents=True)
    (place / "acados" / "utils" / "external_function_generic.h").write_text(EXTERNAL)
    source = subject.folder / "acados" / f"{subject.name}_acados.c"
    head = f'#define SUBSTEPS {SUBSTEPS}\n#include "{source.as_posix()}"\n'
    (place / "call.c").write_text(head + CALLER.format(name=subject.name), "utf-8")
    blasfeo = _blasfeo()
    headers = ["-isystem", str(blasfeo.parent / "include"), f"-I{place}"]
    linked = [str(blasfeo), f"-Wl,-rpath,{blasfeo.parent}", "-lm"]
    asked = [*command, *STRICT, *headers, "call.c", *linked, "-o", "call.so"]
    done = subprocess.run(asked, check=False, cwd=place, capture_output=True, text=True)
    if done.returncode:
        said = compiler.first_error(done.stderr)
        raise VerificationError(f"the C for acados does not compile: {said}")
    try:
        return ctypes.CDLL(str(place / "call.so"))
    except OSError as error:
        raise VerificationError(f"the C for acados is not whole: {error}") from error


def _blasfeo() -> Path:
    """The library of BLASFEO that comes with CasADi, its headers beside it in a folder."""
    folder = Path(ca.__file__).parent
    libraries = [folder / f"libblasfeo{end}" for end in (".so", ".dylib")]
    there = [path for path in libraries if path.is_file()]
    if not (there and (folder / "include" / HEADER).is_file()):
        raise ToolchainError("this CasADi comes without BLASFEO", "pip install -U casadi")
    return there[0]


def _called(library: ctypes.CDLL, results: int, row: Row, h: float, pi: Array) -> Answer:
    t, x, u, p = row
    nx, nz = len(x), len(x) + len(u)
    given = [np.concatenate(part) for part in ((u, x), (pi,), (p, [t, h]))]
    answer = Answer(np.full(nx, np.nan), np.zeros((nz, nx)), np.zeros((nz, nz)))
    arrays = (*given, answer.fun, answer.jacobian, answer.hessian)
    pointers = (array.ctypes.data_as(ctypes.c_void_p) for array in arrays)
    library.call(results, *pointers)
    return answer


def _errors(subject: Subject, library: ctypes.CDLL) -> Iterator[tuple[float, ...]]:
    """Of steps, of the other two functions, of Jacobians and of Hessians, at every state."""
    random = np.random.default_rng(0)
    for k, _ in enumerate(subject.sizes("dynamics")):
        row = subject.row("dynamics", k)
        t, x, u, p = row
        h = _length(subject, row)
        pi = random.normal(size=len(x))
        answer = _called(library, 3, row, h, pi)
        others = [_called(library, n, row, h, pi) for n in (1, 2)]

        def step(z: Array, t: float = t, p: Array = p, h: float = h, nu: int = len(u)) -> Array:
            return _stepped(subject, (t, z[nu:], z[:nu], p), h)

        def slopes(
            z: Array, t: float = t, p: Array = p, h: float = h, pi: Array = pi, nu: int = len(u)
        ) -> Array:
            return _called(library, 2, (t, z[nu:], z[:nu], p), h, pi).jacobian @ pi

        z = np.concatenate([u, x])
        expected = step(z)
        size = float(np.max(np.abs(expected)))
        moved = float(np.max(np.abs(answer.jacobian @ pi)))
        yield (
            _worst(answer.fun - expected) / size,
            max(_worst(other.fun - answer.fun) for other in others) / size
            + _worst(others[1].jacobian - answer.jacobian),
            _relative(answer.jacobian, _slopes(step, z), 0.0),
            _relative(answer.hessian, _slopes(slopes, z), BY * moved),
        )


def _length(subject: Subject, row: Row) -> float:
    """Of a step in which the state moves a little."""
    rates = np.abs(subject.module.dynamics(*row))
    sizes = np.maximum(np.abs(row[1]), 1.0)
    return min(STEP, MOVE / float(np.max(rates / sizes, initial=1.0)))


def _stepped(subject: Subject, row: Row, length: float) -> Array:
    """The classical Runge-Kutta method over `dynamics` of the module."""
    t, x, u, p = row
    h = length / SUBSTEPS
    for n in range(SUBSTEPS):
        now = t + n * h
        k1 = subject.module.dynamics(now, x, u, p)
        k2 = subject.module.dynamics(now + h / 2, x + h / 2 * k1, u, p)
        k3 = subject.module.dynamics(now + h / 2, x + h / 2 * k2, u, p)
        k4 = subject.module.dynamics(now + h, x + h * k3, u, p)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def _slopes(function: Step, z: Array) -> Array:
    """Row k: the difference quotient by entry k, of order 4."""
    rows = []
    for k in range(len(z)):
        d = np.zeros(len(z))
        d[k] = BY * max(1.0, abs(z[k]))
        near, far = (function(z + n * d) - function(z - n * d) for n in (1, 2))
        rows.append((8.0 * near - far) / (12.0 * d[k]))
    return np.array(rows)


def _relative(value: Array, expected: Array, floor: float) -> float:
    size = max(float(np.max(np.abs(expected))), floor)
    return _worst(value - expected) / size if size else _worst(value)


def _worst(difference: Array) -> float:
    worst = float(np.max(np.abs(difference), initial=0.0))
    return np.inf if np.isnan(worst) else worst


ACADOS = TargetCheck("acados", "a C compiler", check)
