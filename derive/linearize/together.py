"""The rows of a steady motion and the matrix of its linear equations as one function of a module,
which is then evaluated at many motions side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.formulations.records import Argument, Equations, Function, Result
from derive.linearize.study import Study

STEADY = "steady"  # what the function is called
ABOUT = "what vanishes in a steady motion, then the matrix of its linear equations row by row"

Call = Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def together(study: Study) -> Equations:
    """Equations with that function alone, (R, A) over (x, u, p, s): the free names s of the motion
    stand behind the parameters."""
    equations, problem = study.equations, study.problem
    _, x, u, p = (argument.symbols for argument in equations.arguments)
    names = problem.motion.sweepable
    s = ca.vertcat(*[ca.SX.sym(name) for name in names]) if names else ca.SX(0, 1)
    R = problem.residual(x, u, p, s)
    at = list(study.kept)
    value = ca.densify(ca.vertcat(R, ca.vec(study.linear.A[at, at].T)))
    slot = equations.arguments[3]
    further = Argument(
        "p", ca.vertcat(p, s), (*slot.labels, *names), (*slot.units, *("" for _ in names))
    )
    labels = tuple(str(k) for k in range(value.numel()))
    return replace(
        equations,
        arguments=(*equations.arguments[:3], further),
        functions=(Function(STEADY, ABOUT, Result("RA", value, labels)),),
        requests=(),
        families=(),
        charts=(),
        parameters=(*equations.parameters, *(study.at[name] for name in names)),
    )


def plain(study: Study) -> Call:
    """The same function by CasADi, at one motion."""
    equations = together(study)
    arguments = [argument.symbols for argument in equations.arguments]
    function = ca.Function("plain", arguments, [equations.functions[0].result.value])
    return lambda t, x, u, p: function(t, x, u, p).full().ravel()


def by_call(study: Study, call: Call) -> Study:
    """The study with its rows and matrices by `call`, the compiled function."""
    nx, rows = study.equations.arguments[1].symbols.numel(), len(study.problem.rows)
    n, free = len(study.kept), len(study.problem.motion.sweepable)

    def residuals(y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
        return call(0.0, y[:, :nx], y[:, nx:], np.hstack([p, s]))[:, :rows]

    def matrices(x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        values = call(0.0, x, u, np.hstack([p, np.zeros((len(p), free))]))
        return values[:, rows:].reshape(len(x), n, n)

    return replace(study, residuals=residuals, A_kept=matrices)
