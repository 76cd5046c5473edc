"""SUNDIALS through CasADi: CVODES on the state derivative, IDAS on the constraints themselves.

IDAS integrates the index-2 system of Gear, Gupta and Leimkuhler in (q, v), with multipliers λ and
μ:
    q̇ = N (v + A_hᵀ μ),  M v̇ + h = Q + Aᵀ λ,  0 = φ(q, t),  0 = A v − c     (A_h: the holonomic
    rows)
so that positions and velocities are both held, without a choice of quasi-velocities. The
traditional reference. Newton's method is to converge in q and v alone: rounding of A v gives λ an
error of that over the step, which in short steps is more than any tolerance. Nor can v be found
better than the rounding of the largest rates: its absolute tolerance ends there.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from codegen.compiler import FLAGS, SUFFIX, find_compiler
from codegen.runtime.simulation import Simulation, Status
from derive.formulations.records import Equations
from derive.states.closing import Kinematics
from hamel.simulate.libraries.records import Problem, Reference, Refusal, refusal, simulation
from hamel.simulate.limits import MOST_LIBRARY_STEPS, UNCHECKED

# of flags; IDA shortens some of them
_STATUS = {
    "TOO_MUCH_WORK": Status.MORE,
    "CONV_FAILURE": Status.NOT_SOLVED,
    "CONV_FAIL": Status.NOT_SOLVED,
}
Run = Callable[[], Simulation]


def _cvodes(problem: Problem) -> Run:
    slots = {argument.name: argument.symbols for argument in problem.equations.arguments}
    results = {function.name: function.result.value for function in problem.equations.functions}
    work = results["power"] if "power" in results else ca.SX(0)
    system = {
        "x": slots["x"],
        "t": slots["t"],
        "u": slots["u"],
        "p": slots["p"],
        "ode": results["dynamics"],
        "quad": work,
    }
    return _prepared("cvodes", system, problem, np.zeros(0), {})


def _idas(problem: Problem) -> Run:
    equations, x = problem.equations, problem.x
    system, rows = equations.system, _independent_rows(equations)
    closing = [i for i in rows if system.rows[i].position >= 0]
    lam, mu = ca.SX.sym("lam", len(rows)), ca.SX.sym("mu", len(closing))
    A = system.A[rows, :]
    qdot = ca.substitute(system.qdot, system.v, system.v + ca.mtimes(system.A[closing, :].T, mu))
    vdot = ca.solve(system.M, system.Q - system.h + ca.mtimes(A.T, lam))
    phi = ca.vertcat(*[system.phi[system.rows[i].position] for i in closing])
    dae = {
        "x": ca.vertcat(system.q, system.v), "z": ca.vertcat(mu, lam), "t": system.t,
        "u": system.u, "p": system.p,
        "ode": ca.vertcat(qdot, vdot),
        "alg": ca.vertcat(phi, ca.mtimes(A, system.v) - system.c[rows, :]),
        "quad": equations.function("power").result.value,
    }  # fmt: skip
    t, module = float(problem.times[0]), problem.module
    z = np.concatenate([np.zeros(len(closing)), _multipliers(problem, rows)])
    rates = module.dynamics(t, x, problem.u, problem.p)
    span, nq = float(np.ptp(problem.times)), system.q.numel()
    finest = 10 * np.finfo(float).eps * (np.max(np.abs(x[nq:])) + span * np.max(np.abs(rates[nq:])))
    tolerances = [
        *[problem.atol] * nq,
        *[max(problem.atol, finest)] * (x.size - nq),
        *[UNCHECKED] * z.size,
    ]
    return _prepared(
        "idas",
        dae,
        problem,
        z,
        {
            "suppress_algebraic": True,
            "calc_ic": False,
            "init_xdot": rates.tolist(),
            "step0": min(1e-5, 1e-3 * span),
            "abstolv": tolerances,
            # CasADi's own takes the small pivots of short steps for zeros
            "linear_solver": "csparse",
        },
    )


def _multipliers(problem: Problem, kept: list[int]) -> np.ndarray:
    """λ of the independent rows at the start, with the same Aᵀ λ as that of all rows."""
    system, t, q = (
        problem.equations.system,
        problem.times[0],
        problem.x[: problem.equations.system.q.numel()],
    )
    A = Kinematics(system).velocities(float(t), q, problem.p)[0]
    lam = problem.module.reactions(float(t), problem.x, problem.u, problem.p)
    return lam if len(kept) == len(A) else np.linalg.lstsq(A[kept].T, A.T @ lam, rcond=None)[0]


def _independent_rows(equations: Equations) -> list[int]:
    """The independent rows, by the names that their own function shows; without such a function no
    row says anything."""
    if not equations.offers("slip"):
        return []
    names = [row.name for row in equations.system.rows]
    slip = equations.request("slip").function
    return [names.index(label) for label in slip.result.labels]


def _prepared(
    solver: str, dae: dict[str, ca.SX], problem: Problem, z: np.ndarray, options: dict[str, Any]
) -> Run:
    """Gives the rows at the output times; the first one is the state given."""
    times = problem.times
    steps = {
        "abstol": problem.atol,
        "reltol": problem.rtol,
        "max_num_steps": MOST_LIBRARY_STEPS,
        "show_eval_warnings": False,
    }
    outcome = _compiled(dae) if problem.compiled else dae
    motion = ca.integrator("motion", solver, outcome, times[0], times[1:], {**steps, **options})
    u = np.tile(problem.u[:, np.newaxis], (1, times.size - 1))

    def run() -> Simulation:
        try:
            result = motion(x0=problem.x, z0=z, u=u, p=problem.p)
        except RuntimeError as error:
            raise _refusal(problem, solver, str(error)) from None
        x = np.vstack([problem.x, np.asarray(result["xf"]).T])
        work = np.concatenate([[0.0], np.asarray(result["qf"]).ravel()])
        counts: dict[str, Any] = motion.stats()
        return simulation(problem, x, work, counts["nsteps"], counts["netfails"], counts["nfevals"])

    return run


def _refusal(problem: Problem, solver: str, message: str) -> Refusal:
    """CasADi gives the flag of SUNDIALS within its message and nowhere else."""
    flag = re.search(r"\b(?:CV|IDA)_([A-Z_]+)", message)
    why = f"{solver.upper()} stopped: {message.strip().splitlines()[-1]}"
    if flag is None:
        return refusal(problem, why)
    status = _STATUS.get(flag.group(1), Status.STEP_TOO_SMALL)
    return refusal(problem, why, status, f"stops: {flag.group()}")


def _compiled(dae: dict[str, ca.SX]) -> dict[str, ca.MX]:
    """The same system with its functions and their derivatives as C of CasADi's, compiled with the
    flags of our own modules."""
    given = {name: dae[name] for name in ("x", "z", "t", "u", "p") if name in dae}
    sides = {name: ca.densify(dae[name]) for name in ("ode", "alg", "quad") if name in dae}
    function = ca.Function("sides", [*given.values()], [*sides.values()], [*given], [*sides])
    symbols = {name: ca.MX.sym(name, value.shape[0]) for name, value in given.items()}  # type: ignore[call-overload]
    results = compiled_by_casadi(function)(*symbols.values())
    return {**symbols, **dict(zip(sides, results if isinstance(results, tuple) else (results,)))}


def compiled_by_casadi(function: ca.Function) -> ca.Function:
    """Loaded for as long as the process lives; the files are gone at once. The function itself
    without a compiler."""
    command = find_compiler()
    if command is None:
        return function
    with tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as folder:
        code = ca.CodeGenerator("sides.c")
        for each in (function, function.jacobian(), function.forward(1)):
            code.add(each)
        code.generate(folder + os.sep)
        library = os.path.join(folder, f"sides{SUFFIX}")
        flags = [*FLAGS, "-shared", os.path.join(folder, "sides.c"), "-o", library, "-lm"]
        subprocess.run([*command, *flags], check=True, capture_output=True)
        return ca.external(function.name(), library)


def _needs_multipliers(equations: Equations) -> str:
    if equations.z:
        return f"it knows no first-order states ({', '.join(equations.z)})"
    if not equations.system.rows:
        return "there are no constraints to hold"
    if equations.formulation != "augmented":
        return (
            "it holds the constraints of the generalized velocities by multipliers of its "
            "own: give it the formulation augmented"
        )
    return (
        ""
        if equations.system.written
        else "the mass matrix is not written out for a system of this length"
    )


_SOURCE = "A. C. Hindmarsh et al.: SUNDIALS, ACM TOMS 31, 2005, through CasADi"
CVODES = Reference("cvodes", "CVODES (BDF) through CasADi on the same equations", _SOURCE, _cvodes)
IDAS = Reference(
    "idas",
    "IDAS (BDF) through CasADi on the stabilised index-2 system of Gear, Gupta and Leimkuhler",
    f"C. W. Gear, B. Leimkuhler, G. K. Gupta, J. Comput. Appl. Math. 12, 1985; {_SOURCE}",
    _idas,
    _needs_multipliers,
)
