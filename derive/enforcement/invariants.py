"""Projection on constraints and invariants (jet spaces): after every step the nearest state with φ
= 0, A v = c and the energy and momenta of the start, x ← x − D K⁻¹ g with K = G W⁻¹ Gᵀ, D = W⁻¹ Gᵀ
and G the derivative of all g.

Near means in W = diag(M, ∂²T/∂w²) (positions and velocities, in units of 1 s), or W = 1.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from derive.choices.survey import survey_of
from derive.enforcement.limits import CONSERVED, TRIED
from derive.enforcement.records import Enforcement, Options
from derive.expressions.any_piece import on_any_piece
from derive.formulations.manifold import keeps_velocities
from derive.formulations.records import Equations, Function, Request, Result
from derive.mechanics.elimination.solve import ldl_solution, scalars

ABOUT = "constraints and invariants for the projection on them: [g, G W⁻¹ Gᵀ, W⁻¹ Gᵀ] row by row"


def _invariants(equations: Equations, options: Options) -> list[tuple[str, ca.SX]]:
    """Energy, always where it is conserved, and the momenta asked for, over the state. Unknown
    names raise KeyError."""
    system = equations.system
    v = equations.function("velocity").result.value
    w = equations.argument("x").symbols[equations.speeds]
    energy = equations.function("energy").result.value
    momenta = ca.substitute(ca.jacobian(system.T, system.v).T, system.v, v)
    names = {velocity.name: j for j, velocity in enumerate(system.model.velocities)}
    # a sum that constraints which move leave constant, too, where the motion in w does not show
    # time
    known = {"energy": energy[0] + energy[1] if system.homogeneous else energy[2]}
    if _relative_rate(equations, known["energy"], options) > CONSERVED:
        known["energy"] = ca.dot(ca.gradient(energy[0], w), w) - energy[0] + energy[1]
    known |= {f"{name}": momenta[j] for name, j in names.items()}
    known |= {
        c.name: momenta[names[f"der({c.name})"]]
        for c in system.model.coordinates
        if f"der({c.name})" in names
    }
    asked = [(name, known[name]) for name in options.conserve or ("energy",)]
    also = (
        "energy" not in options.conserve
        and _relative_rate(equations, known["energy"], options) <= CONSERVED
    )
    return [("energy", known["energy"]), *asked] if options.conserve and also else asked


def _refusal(equations: Equations, options: Options) -> str:
    try:
        held = _invariants(equations, options)
    except KeyError as missing:
        return (
            f"{missing} is no invariant that could be held: energy, or a coordinate or "
            "generalized velocity with its momentum"
        )
    if any(name == "energy" for name, _ in held) and _works_on_some_piece(equations):
        return (
            "energy is not conserved: where forces go on to another piece (a contact that is "
            "touched, a limit that is reached) they take power"
        )
    for name, value in held:
        rate = _relative_rate(equations, value, options)
        if rate > CONSERVED:
            what = "energy" if name == "energy" else f"the momentum of {name}"
            return (
                f"{what} is not conserved: at random admissible states it changes at "
                f"{rate:.2g} of the rate of its parts"
            )
    return ""


def _works_on_some_piece(equations: Equations) -> bool:
    """Whether forces in pieces take power on one of them, which sampled states need not touch."""
    power = ca.SX(equations.system.power)
    freed = on_any_piece(power) if ca.symvar(power) else power
    names = ca.vertcat(*ca.symvar(freed))
    if names.numel() == ca.vertcat(*ca.symvar(power)).numel():
        return False  # no pieces
    values = np.random.default_rng(0).uniform(0.5, 1.5, size=(names.numel(), TRIED))
    found = ca.Function("power", [names], [freed]).call([values])[0].full()
    return bool(np.any(np.abs(found[np.isfinite(found)]) > 0.0))


def _relative_rate(equations: Equations, value: ca.SX, options: Options) -> float:
    """max |dH/dt| over the sampled states, relative to the sum of the sizes of its terms."""
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    xdot = equations.function("dynamics").result.value
    gradient = ca.jacobian(value, slots["x"])
    terms = ca.vertcat(gradient.T * xdot, ca.jacobian(value, slots["t"]))
    function = ca.Function("rate", [slots[name] for name in "txup"], [ca.densify(terms)])
    state = equations.function("state")
    assert state.x is not None
    to_x = ca.Function(
        "x", [slots["t"], state.x.symbols, slots["p"]], [ca.densify(state.result.value)]
    )
    s = survey_of(equations.system).sampled
    u = np.array(options.inputs) if options.inputs else np.zeros(equations.system.u.numel())
    frame = equations.frame.values if equations.frame else ()
    rates: list[float] = []
    for t, q, v, p in zip(s.t, s.q, s.v, s.p):
        own, z = np.split(p, [len(p) - len(equations.z)])
        given = np.concatenate([options.parameters or own, frame])
        x = to_x(t, np.concatenate([q, v, z]), given)
        entries = np.asarray(function(t, x, u, given)).ravel()
        if np.isfinite(entries).all() and np.any(entries):
            rates.append(abs(entries.sum()) / np.abs(entries).sum())
    return max(rates, default=0.0)


def _with_manifold(euclidean: bool, equations: Equations, options: Options) -> Equations:
    request = Request(
        "manifold", ABOUT, lambda: _manifold(equations, _invariants(equations, options), euclidean)
    )
    return replace(equations, requests=(*equations.requests, request))


def _manifold(equations: Equations, held: list[tuple[str, ca.SX]], euclidean: bool) -> Function:
    """[g, K = G W⁻¹ Gᵀ, W⁻¹ Gᵀ]: what one Newton step x ← x − W⁻¹ Gᵀ K⁻¹ g needs. Derivatives are
    along v, so that quaternions move along their rates; first-order states stay."""
    system = equations.system
    w = equations.argument("x").symbols[equations.speeds, 0]
    requests = {request.name: request for request in equations.requests}
    closure = requests["closure"].function.result if "closure" in requests else None
    slip = (
        requests["slip"].function.result
        if "slip" in requests and keeps_velocities(equations)
        else None
    )
    parts = [result.value[:, 0] for result in (closure, slip) if result is not None] + [
        value for _, value in held
    ]
    g = ca.vertcat(*parts)
    G = ca.horzcat(ca.mtimes(ca.jacobian(g, system.q), system.N), ca.jacobian(g, w))
    W = _metric(equations, w, euclidean)
    solved = ldl_solution(scalars(W), scalars(G), list(reversed(range(W.size1()))))
    toward = ca.horzcat(*[ca.vertcat(*column) for column in solved.x]).T  # rows of G W⁻¹
    nv = system.v.numel()
    still = ca.SX(toward.size1(), len(equations.z))
    steps = ca.horzcat(ca.mtimes(toward[:, :nv], system.N.T), toward[:, nv:], still)
    value = ca.densify(ca.horzcat(g, ca.mtimes(toward, G.T), steps))
    labels = tuple(
        label for result in (closure, slip) if result is not None for label in result.labels
    )
    return Function(
        "manifold", ABOUT, Result("manifold", value, (*labels, *(name for name, _ in held)), ())
    )


def _metric(equations: Equations, w: ca.SX, euclidean: bool) -> ca.SX:
    system = equations.system
    nv, nw = system.v.numel(), w.numel()
    if euclidean or not (system.definite and system.written):
        return ca.SX.eye(nv + nw)
    T = equations.function("energy").result.value[0]
    return ca.diagcat(system.M, ca.hessian(T, w)[0])


def _enforcement(name: str, near: str, euclidean: bool) -> Enforcement:
    return Enforcement(
        name=name,
        about=f"after every step the nearest state, {near}, on the constraints and with the "
        "start's energy and chosen momenta",
        source="J. Tuomela, T. Arponen, V. Normi: On the simulation of multibody systems with "
        "holonomic constraints (jet spaces)",
        level="steps",
        refusal=_refusal,
        needs=lambda found: (
            "manifold",
            *(function.name for function in found.functions if function.name == "project"),
        ),
        equations=lambda found, options: _with_manifold(euclidean, found, options),
        conserves=True,
    )


INVARIANTS = _enforcement("invariants", "in the metric of M", False)
INVARIANTS_EUCLIDEAN = _enforcement("invariants_euclidean", "by plain distance", True)
