"""The minimal linear equations: ẋ = f(t, x, u, p) differentiated along the directions that φ = 0
leaves.

Source: Gonzalez, Aparicio, Garcia-Agundez Blanco et al. reduce the linearised multiplier equations;
as f is explicit here, its derivative holds their geometric stiffness and the perturbed dependent
velocities already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.choices.records import Guard
from derive.diagnostics import AssumptionError
from derive.expressions.columns import columns_of
from derive.expressions.roots import finite_jacobian
from derive.expressions.scalars import Vector
from derive.formulations.records import Argument, Equations, Function, Request, Result
from derive.linearize.limits import MANY, MINIMAL_NEAR, SPARED, WEAK
from derive.linearize.records import Linear
from derive.mechanics.elimination.solve import Block, lu_solution, scalars
from derive.mechanics.records import System
from derive.numerics import refuses_numerically
from derive.states.initial import initial_state


@refuses_numerically("the linear equations")
def linear(equations: Equations, q: np.ndarray, p: np.ndarray) -> Linear:
    """The linear equations with the dependent coordinates chosen at a configuration q on the
    constraints.

        δẋ_i = A δx_i + B δu,   δy = C δx_i + D δu,   A = ∂f_i/∂x T,   B = ∂f_i/∂u

    x_i are the n independent coordinates, quasi-velocities and first-order states, δx = T δx_i
    with φ_q δq = 0. A (n ×
    n), B (n × nu), C (ny × n), D (ny × nu) over (t, x, u, p). Raises AssumptionError for any
    formulation but `quasi_velocities`: the others are not minimal.
    """
    if equations.formulation != "quasi_velocities":
        raise AssumptionError(
            "only equations in quasi-velocities are minimal", "use the formulation quasi_velocities"
        )
    _, x, u, _ = (argument.symbols for argument in equations.arguments)
    system, nq = equations.system, equations.system.q.numel()
    pivots = _pivots(equations, q, p)
    dependent = [j for _, j in pivots]
    independent = [j for j in range(x.numel()) if j not in dependent]
    T, guards = _tangent(equations, pivots, independent, q, p)
    f, y = _value(equations, "dynamics"), _value(equations, "outputs")
    # f_i alone: the dependent rates follow from φ_q q̇ = 0 and would repeat these
    rates = f[independent, 0]
    argument = equations.arguments[1]
    return Linear(
        equations=equations,
        states=tuple(argument.labels[j] for j in independent),
        units=tuple(argument.units[j] for j in independent),
        inputs=equations.arguments[2].labels,
        outputs=_labels(equations, "outputs"),
        independent=tuple(independent),
        dependent=tuple(j for j in dependent if j < nq),
        T=T,
        A=ca.mtimes(finite_jacobian(rates, x), T),
        B=finite_jacobian(rates, u),
        C=ca.mtimes(finite_jacobian(y, x), T),
        D=finite_jacobian(y, u),
        guards=guards if system.phi.numel() else (),
    )


def _value(equations: Equations, name: str) -> ca.SX:
    return equations.function(name).result.value if equations.has(name) else ca.SX(0, 1)


def _labels(equations: Equations, name: str) -> tuple[str, ...]:
    return equations.function(name).result.labels if equations.has(name) else ()


def position_rows(system: System) -> ca.SX:
    """What is zero in q: φ, and |q|² − 1 of each unit quaternion, which ties its four coordinates
    as a constraint does."""
    return ca.vertcat(system.phi, *[ca.sumsqr(system.q[i : i + 4]) - 1 for i in system.quaternions])


def _pivots(equations: Equations, q: np.ndarray, p: np.ndarray) -> list[tuple[int, int]]:
    """(row, column) of each independent position row, by elimination with the largest pivots at
    q."""
    system = equations.system
    rows = position_rows(system)
    function = ca.Function(
        "rows", [system.t, system.q, system.own_p], [ca.densify(ca.jacobian(rows, system.q))]
    )
    J = np.asarray(function(0.0, q, p))
    # a small weight makes a column look weak, so that it is taken last as a dependent one
    weights = np.array([SPARED if spared else 1.0 for spared in _spared(equations)])
    rank = int(np.linalg.matrix_rank(J, tol=WEAK * np.max(np.abs(J)))) if J.size else 0
    return pivoted(J * weights, rank)


def pivoted(matrix: np.ndarray, rank: int) -> list[tuple[int, int]]:
    """Gauss elimination with complete pivoting: places (row, column) of the first `rank` pivots.
    The columns become dependent coordinates: those that the rows determine best."""
    left = matrix.copy()
    places: list[tuple[int, int]] = []
    for _ in range(rank):
        i, j = np.unravel_index(int(np.argmax(np.abs(left))), left.shape)
        places.append((int(i), int(j)))
        left = left - np.outer(left[:, j] / left[i, j], left[i])
        left[i] = 0.0
        left[:, j] = 0.0
    return places


def _spared(equations: Equations) -> list[bool]:
    """Coordinates whose rate is a quasi-velocity: a reader wants to keep those."""
    system, t = equations.system, equations.arguments[0].symbols
    w = equations.arguments[1].symbols[equations.speeds, 0]
    rates = _value(equations, "dynamics")[: system.q.numel()]
    pattern = ca.jacobian(rates, ca.vertcat(t, system.q, w)).sparsity()
    used: dict[int, list[int]] = {}
    for i, j in zip(*pattern.get_triplet()):
        used.setdefault(i, []).append(j)
    first = 1 + system.q.numel()
    return [len(used.get(i, [])) == 1 and used[i][0] >= first for i in range(system.q.numel())]


def _tangent(
    equations: Equations,
    pivots: Sequence[tuple[int, int]],
    independent: Sequence[int],
    q: np.ndarray,
    p: np.ndarray,
) -> tuple[ca.SX, tuple[Guard, ...]]:
    """δx = T δ(states): δq_d = −φ_d⁻¹ φ_i δq_i by an unrolled elimination in the order of the
    pivots.

    The guards are relative to the pivots at (q, p), where they were chosen.
    """
    x = equations.arguments[1]
    T = ca.SX(x.symbols.numel(), len(independent))
    for k, j in enumerate(independent):
        T[j, k] = 1.0
    if not pivots:
        return T, ()
    system = equations.system
    J = scalars(ca.jacobian(position_rows(system), system.q))
    rows, columns = [i for i, _ in pivots], [j for _, j in pivots]
    free = [k for k, j in enumerate(independent) if j < system.q.numel()]
    sides: list[Vector] = [[-J[i][independent[k]] for i in rows] for k in free]
    order = [Block((k,), (k,), 1.0, 1.0, 2) for k in range(len(rows))]
    solution = lu_solution([[J[i][j] for j in columns] for i in rows], sides, order)
    for k, side in zip(free, solution.x):
        for j, value in zip(columns, side):
            T[j, k] = value
    chosen = (
        ca.Function("pivots", [system.t, system.q, system.own_p], [ca.vertcat(*solution.pivots)])(
            0.0, q, p
        )
        .full()
        .ravel()
    )
    varying = [k for k, pivot in enumerate(solution.pivots) if not ca.SX(pivot).is_constant()]
    return T, tuple(
        _guard(x, columns[k], ca.SX(solution.pivots[k]), MINIMAL_NEAR * abs(float(chosen[k])))
        for k in varying
    )


def _guard(x: Argument, j: int, pivot: ca.SX, least: float) -> Guard:
    return Guard(f"pivot of {x.labels[j]}", pivot, least, MINIMAL_NEAR)


def with_linearization(equations: Equations) -> Equations:
    """The equations with `linearization` among the functions that can be asked for."""
    if equations.formulation != "quasi_velocities":
        return equations
    request = Request("linearization", ABOUT, lambda: linearization(equations))
    return replace(equations, requests=(*equations.requests, request))


ABOUT = (
    "[A B; C D] of δẋ = A δx + B δu, δy = C δx + D δu in minimal states: independent "
    "coordinates, quasi-velocities"
)


def linearization(equations: Equations) -> Function:
    """[A B; C D], (n + ny) × (n + nu), as a function of the generated module; dependent coordinates
    are chosen at the initial configuration. A guard tells where their pivots come near zero: there
    other coordinates would have to be the dependent ones."""
    initial = initial_state(equations.system)
    result = linear(equations, initial.q, np.array(equations.system.own_parameters))
    value = ca.densify(ca.blockcat([[result.A, result.B], [result.C, result.D]]))
    labels = (*(f"der({name})" for name in result.states), *result.outputs)
    about = f"{ABOUT}; states {', '.join(result.states)}"
    guards = _dynamics(equations).guards
    return Function(
        "linearization", about, Result("AB_CD", value, labels, ()), guards=(*guards, *result.guards)
    )


def _dynamics(equations: Equations) -> Function:
    return equations.function("dynamics")


Evaluator = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def evaluator(equations: Equations, value: ca.SX) -> Evaluator:
    """`value` at t = 0 for rows of x (N × nx), u (N × nu) and p (N × np): an array N × rows ×
    columns."""
    symbols = [argument.symbols for argument in equations.arguments]
    function = ca.Function("value", symbols, [ca.cse(ca.densify(value))])
    shape = value.shape

    def evaluated(x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """The matrix at many points at once: x is many × nx, and so on; the result is many × rows ×
        columns.

        Time is zero, as a motion is steady only where nothing depends on t. CasADi lays the results
        of a map side by side, which is why the axes are exchanged.
        """
        many = len(x)
        if many >= MANY:
            return columns_of(function)(np.zeros((1, 1)), x.T, u.T, p.T)[0].transpose(2, 0, 1)
        values = (
            np.asarray(function(np.zeros((1, many)), x.T, u.T, p.T))
            if value.numel()
            else np.zeros((shape[0], 0))
        )
        return values.reshape(shape[0], many, shape[1]).transpose(1, 0, 2)

    return evaluated
