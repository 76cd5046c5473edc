"""How a motion depends on where it began and on parameters, as a motion of its own.

Beside x its slopes D = ∂x/∂(p, x₀) are integrated, for the free parameters p:

    ẋ = f(t, x, u, p),   Ḋ = ∂f/∂x D + [∂f/∂p  0]

They are further first-order states of a module, so the same integrator takes them along, in lanes
and through kinks. Of forces that jump this would leave out how the time of the jump moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.formulations.evaluate import slots_of
from derive.formulations.records import Argument, Equations, Function, Iteration, Result

Array = np.ndarray
WATCHED = ("guards", "constraint_rows", "kinks")  # what a motion looks at on its way
JUMPS = frozenset(
    {ca.OP_SIGN, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR}
)


def is_continuous(equations: Equations) -> bool:
    """Whether ẋ is written without anything that jumps: kinks are allowed."""
    value = equations.function("dynamics").result.value
    tape = ca.Function("tape", slots_of(equations), [value])
    return all(tape.instruction_id(k) not in JUMPS for k in range(tape.n_instructions()))


def varied(equations: Equations, free: Sequence[str], scale: Sequence[float]) -> Equations:
    """`dynamics` of (x, D), D row by row behind x; by each free parameter in units of its `scale`,
    as the starts of D may have theirs: steps are controlled by errors of D, too."""
    slot, p = equations.argument("x"), equations.argument("p")
    numbers = [p.labels.index(name) for name in free]
    dynamics = equations.function("dynamics")
    x, f = slot.symbols, dynamics.result.value
    by = [(p.labels[k], p.units[k]) for k in numbers] + list(zip(slot.labels, slot.units))
    D = ca.SX.sym("D", x.numel(), len(by))
    direct = ca.mtimes(ca.jacobian(f, p.symbols)[:, numbers], ca.diag(ca.SX(ca.DM(list(scale)))))
    slopes = ca.mtimes(ca.jacobian(f, x), D) + ca.horzcat(direct, ca.SX(*2 * x.shape[:1]))
    labels = tuple(f"{of} by {name}" for of in slot.labels for name, _ in by)
    units = tuple(f"{of or 1}/({unit or 1})" for of in slot.units for _, unit in by)
    whole = Argument(
        "x", ca.vertcat(x, ca.vec(D.T)), (*slot.labels, *labels), (*slot.units, *units)
    )
    rates = Result(
        "xdot",
        ca.densify(ca.vertcat(f, ca.vec(slopes.T))),
        (*dynamics.result.labels, *(f"der({name})" for name in labels)),
        (*dynamics.result.units, *(f"{unit}/s" for unit in units)),
    )
    return replace(
        equations,
        arguments=tuple(whole if slot.name == "x" else slot for slot in equations.arguments),
        functions=(Function("dynamics", dynamics.about, rates, (), dynamics.guards),),
        named=(),
        requests=tuple(x for x in equations.requests if x.name in WATCHED),
        families=(),
        z=(*equations.z, *labels),
    )


@dataclass(frozen=True)
class Slopes:
    """Of what is measured, y = g(t, x, u, p), and of one step of the projection that a motion
    begins with, by (free p, x): each gives its value and its slopes."""

    seen: ca.Function
    step: ca.Function | None
    left: ca.Function | None  # what the step has to make zero
    until: Iteration | None
    free: int

    def of_seen(self, t: Array, x: Array, u: Array, p: Array, D: Array, scale: Array) -> Array:
        """∂y/∂(p, x₀) along motions, (…, quantities, n), where D, (…, nx, n), is in the `scale` of
        the parameters."""
        lead, nx, n = x.shape[:-1], x.shape[-1], D.shape[-1]
        count = int(np.prod(lead))
        rows = [
            np.broadcast_to(each, (*lead, each.shape[-1])).reshape(count, each.shape[-1]).T
            for each in (t[..., None], x, u, p)
        ]
        slopes = np.asarray(self.seen.map(count)(*rows))
        by = slopes.T.reshape(count, self.free + nx, -1).transpose(0, 2, 1)
        y = by[..., self.free :] @ D.reshape(-1, nx, n)
        y[..., : self.free] += by[..., : self.free] * scale
        return y.reshape(*lead, *y.shape[1:])

    def at_start(self, t: float, x: Array, u: Array, p: Array) -> tuple[Array, Array]:
        """x on the constraints, and its slopes by (p, x): those of every step, one after the
        other."""
        nx = len(x)
        D = np.hstack([np.zeros((nx, self.free)), np.eye(nx)])
        if self.step is None or self.left is None or self.until is None:
            return x, D
        for _ in range(self.until.most):
            moved, by = map(np.asarray, self.step(t, x, u, p))
            D = by[:, self.free :] @ D + np.hstack([by[:, : self.free], np.zeros((nx, nx))])
            x = moved.ravel()
            if float(self.left(t, x, u, p)) <= self.until.tolerance:
                break
        return x, D


def slopes(equations: Equations, free: Sequence[str], names: Sequence[str]) -> Slopes:
    """Of the quantities `names`: states, velocities and outputs."""
    x, p = equations.argument("x"), equations.argument("p")
    columns = slots_of(equations)
    by = ca.vertcat(*(p.symbols[p.labels.index(name)] for name in free), x.symbols)
    known = dict(zip(x.labels, ca.vertsplit(x.symbols)))
    for name in ("velocity", "outputs"):
        if equations.has(name):
            result = equations.function(name).result
            known = dict(zip(result.labels, ca.vertsplit(ca.densify(result.value)))) | known
    y = ca.vertcat(*(known[name] for name in names))
    seen = ca.Function("seen", columns, [ca.vec(ca.densify(ca.jacobian(y, by)))])
    if not equations.has("project"):
        return Slopes(seen, None, None, None, len(free))
    project = equations.function("project")
    value, residual = ca.densify(project.result.value), project.residual
    step = ca.Function("step", columns, [value, ca.densify(ca.jacobian(value, by))])
    left = ca.Function("left", columns, [ca.SX(1) if residual is None else residual])
    return Slopes(seen, step, left, project.iteration, len(free))
