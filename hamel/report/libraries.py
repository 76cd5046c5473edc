"""Library solvers over the same equations, compiled, as reference lines: CVODES and IDAS (CasADi), DOP853 and Radau (SciPy)."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from codegen.compiler import FLAGS, SUFFIX, find_compiler
from derive.formulations.choices import workshop
from derive.formulations.records import Equations
from hamel.pipeline import load_module
from hamel.report.building import Start, first_state, plain_equations, start
from hamel.report.running import TOO_LONG, TooLong, timed

SCIPY = {"DOP853 (SciPy)": "DOP853", "Radau (SciPy)": "Radau"}
MOST_STEPS = 1_000_000


def rows(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    unit: Mapping[str, str],
    solver: str,
    runs: Sequence[Mapping[str, Any]],
    limit: float,
    share: float,
) -> Iterator[dict[str, Any]]:
    """One solver on one unit's equations, loose tolerances first."""
    found = start(path, values)
    with tempfile.TemporaryDirectory(prefix="hamel-") as place:
        if solver in SCIPY:
            solve = _scipy(found, load_module(Path(folder)), SCIPY[solver], span, limit)
        elif solver == "IDAS":
            solve = _idas(found, Path(place), span)
        else:
            solve = _cvodes(found, plain_equations(found, unit), Path(place), span)
        slow = False
        for run in runs:
            made = {"status": TOO_LONG} if slow else _row(solve, found, span, run["rtol"], limit, share)
            slow = made["status"] == TOO_LONG
            yield {"run": run["key"], "row": made}


Run = Callable[[], tuple[np.ndarray, dict[str, Any]]]  # → (q, v) at the end, counts
Solver = Callable[[float], Run]  # by relative tolerance


def _row(solve: Solver, found: Start, span: float, rtol: float, limit: float, share: float) -> dict[str, Any]:
    """Violations are those at the end; the energy of these is not asked for."""
    begin = time.process_time()
    try:
        ms, (end, counts) = timed(solve(rtol), share)
    except TooLong:
        return {"status": TOO_LONG}
    except FloatingPointError as error:
        return {"status": str(error).partition(": ")[2] or str(error)}
    except RuntimeError as error:
        flag = re.search(r"\b(?:CV|IDA)_[A-Z_]+", str(error))
        spent = time.process_time() - begin
        return {"status": TOO_LONG if spent > limit else f"stops: {flag.group() if flag else 'it gives no reason'}"}
    if not np.isfinite(end).all():
        return {"status": "not finite"}
    phi, slip = _violations(found, span, end)
    return {"status": "ok", "ms": ms, "end": end.tolist(), "phi": phi, "velocity": slip, "balance": None, **counts}


def _violations(found: Start, span: float, end: np.ndarray) -> tuple[float, float]:
    s = found.system
    slip = ca.mtimes(s.A, s.v) - s.c
    made = ca.Function("violations", [s.t, s.q, s.v, s.p], [ca.densify(s.phi), ca.densify(slip)])
    phi, rates = made(span, end[: s.q.numel()], end[s.q.numel() :], found.p)
    return float(np.max(np.abs(np.asarray(phi)), initial=0.0)), float(np.max(np.abs(np.asarray(rates)), initial=0.0))


def _scipy(found: Start, module: Any, method: str, span: float, limit: float) -> Solver:
    from scipy.integrate import solve_ivp

    x = module.state(0.0, np.concatenate([found.initial.q, found.initial.v]), found.u, found.p)
    nq = found.system.q.numel()

    def run(rtol: float) -> tuple[np.ndarray, dict[str, Any]]:
        begin = time.process_time()

        def slope(t: float, y: np.ndarray) -> np.ndarray:
            if time.process_time() - begin > limit:
                raise TooLong(t)
            return module.dynamics(t, y, found.u, found.p)

        jacobian: dict[str, Any] = {"jac": lambda t, y: module.jacobian(t, y, found.u, found.p)} if method == "Radau" else {}
        made = solve_ivp(slope, (0.0, span), x, method=method, rtol=max(rtol, 3e-14), atol=rtol / 100, t_eval=(span,), **jacobian)
        if not made.success:
            raise FloatingPointError(made.message)
        end = made.y[:, -1]
        v = module.velocity(span, end, found.u, found.p)
        return np.concatenate([end[:nq], v]), {"calls": int(made.nfev)}

    return lambda rtol: lambda: run(rtol)


def _cvodes(found: Start, made: Equations, folder: Path, span: float) -> Solver:
    """x' = f(t, x, u, p) of the equations, as they are."""
    t, x, u, p = (argument.symbols for argument in made.arguments)
    functions = {function.name: function.result.value for function in made.functions}
    v = ca.Function("v", [t, x, u, p], [ca.densify(functions["velocity"])])
    ode = _compiled(ca.Function("ode", [x, t, u, p], [ca.densify(functions["dynamics"])], ["x", "t", "u", "p"], ["xdot"]), folder)
    nq, state = found.system.q.numel(), first_state(found, made)
    T, X = ca.MX.sym("t"), ca.MX.sym("x", x.numel())  # type: ignore[call-overload]
    dae = {"t": T, "x": X, "ode": ode(X, T, found.u, found.p)}

    def finished(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values[:nq], np.asarray(v(span, values, found.u, found.p)).ravel()])

    return _sundials("cvodes", dae, {"x0": state}, span, finished)


def _idas(found: Start, folder: Path, span: float) -> Solver:
    """The bordered system as it stands, index 1: v̇ and λ are algebraic unknowns."""
    s, kept = found.system, list(workshop(found.system).kept)
    a, lam = ca.SX.sym("a", s.v.numel()), ca.SX.sym("lam", len(kept))  # type: ignore[call-overload]
    x, z = ca.vertcat(s.q, s.v), ca.vertcat(a, lam)
    A = s.A[kept, :]
    residual = ca.vertcat(ca.mtimes(s.M, a) + s.h - s.Q - ca.mtimes(A.T, lam), ca.mtimes(A, a) - s.beta[kept])
    names = ["x", "z", "t", "u", "p"]
    both = ca.Function(
        "dae", [x, z, s.t, s.u, s.p], [ca.densify(ca.vertcat(s.qdot, a)), ca.densify(residual)], names, ["ode", "alg"]
    )
    made = _compiled(both, folder)
    T, X, Z = ca.MX.sym("t"), ca.MX.sym("x", x.numel()), ca.MX.sym("z", z.numel())  # type: ignore[call-overload]
    ode, alg = made(X, Z, T, found.u, found.p)
    x0, none = np.concatenate([found.initial.q, found.initial.v]), np.zeros(z.numel())
    J = ca.Function("J", [x, z, s.t, s.u, s.p], [ca.densify(residual), ca.densify(ca.jacobian(residual, z))])
    offset, matrix = (np.asarray(value) for value in J(x0, none, 0.0, found.u, found.p))
    z0 = np.linalg.lstsq(matrix, -offset.ravel(), rcond=None)[0]
    dae = {"t": T, "x": X, "z": Z, "ode": ode, "alg": alg}
    return _sundials("idas", dae, {"x0": x0, "z0": z0}, span, lambda values: values)


def _sundials(
    plugin: str, dae: dict[str, ca.MX], given: dict[str, np.ndarray], span: float, finished: Callable[[np.ndarray], np.ndarray]
) -> Solver:
    def solver(rtol: float) -> Run:
        options = {"reltol": rtol, "abstol": rtol / 100, "max_num_steps": MOST_STEPS}
        made = ca.integrator("solver", plugin, dae, 0.0, span, options)

        def run() -> tuple[np.ndarray, dict[str, Any]]:
            end = np.asarray(made(**given)["xf"]).ravel()
            counts: dict[str, Any] = made.stats()
            return finished(end), {"steps": int(counts["nsteps"]), "calls": int(counts["nfevals"])}

        return run

    return solver


def _compiled(function: ca.Function, folder: Path) -> ca.Function:
    """The function with its derivatives as C of CasADi's, compiled with the flags of our own modules."""
    here = Path.cwd()
    os.chdir(folder)  # the generator takes no path
    try:
        code = ca.CodeGenerator("solver.c")
        for each in (function, function.jacobian(), function.forward(1)):
            code.add(each)
        code.generate()
    finally:
        os.chdir(here)
    library = folder / f"solver{SUFFIX}"
    command = [*(find_compiler() or []), *FLAGS, "-shared", str(folder / "solver.c"), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return ca.external(function.name(), str(library))
