"""Regressors against the reference's inverse dynamics with other masses, inertias and friction:
what is linear in π is told by doubling it, τ(2π) − τ(π) = Y π and 2 τ(π) − τ(2π) = rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from derive.expressions.tree import ZERO, Number
from derive.mechanics.regression.regressor import INERTIAL, Group, groups, parameters
from derive.model.records import Body, Model
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.quasi import partial_velocities_at
from hamel.verify.limits import CANCELLING, FLOOR, SMALL, SOLVED, TERMS
from hamel.verify.reference.outcome import Reference, evaluate, state_of
from hamel.verify.reference.states import State, inertia_tensor
from hamel.verify.reference.vectors import Array


@dataclass(frozen=True)
class Motion:
    """What is asked of the reference at one state: its motion, and the parameters π and 2π."""

    t: float
    q: Array
    v: Array
    vdot: Array
    full: Array
    pi: Array
    once: Reference
    twice: Reference


@dataclass(frozen=True)
class Forces:
    """The two parts of inverse dynamics, and the sizes of what they are sums of."""

    linear: Array
    rest: Array
    size: Array


def _forces(x: Motion) -> Forces:
    once, small = _inverse(x.once, x)
    twice, large = _inverse(x.twice, x)
    return Forces(twice - once, 2.0 * once - twice, small + large)


def _inverse(ref: Reference, x: Motion) -> tuple[Array, Array]:
    """τ = M a + h − Q(u = 0), and the sum of the sizes."""
    idle = np.zeros(len(ref.model.inputs))
    o = evaluate(ref, state_of(ref, x.t, x.q, x.v, idle, x.full))
    size = np.abs(o.M) @ np.abs(x.vdot) + np.abs(o.h) + np.abs(o.Q) + o.summed.force
    return o.M @ x.vdot + o.h - o.Q, size


def _motions(e: Evidence) -> Iterator[Motion]:
    """Any v̇ and any parameters at the states."""
    rng = np.random.default_rng(6)
    for s in e.samples:
        vdot = e.units.vdot * rng.normal(size=len(s.v))
        drawn = _drawn(e, s.state, rng)
        yield Motion(s.t, s.q, s.v, vdot, s.full, *_with(e, drawn))


@dataclass(frozen=True)
class Drawn:
    """Mass, centre of mass and tensor about it of each group, and the coefficients of loads."""

    bodies: Mapping[str, tuple[float, Array, Array]]
    loads: Mapping[tuple[str, str], float]


def _drawn(e: Evidence, state: State, rng: np.random.Generator) -> Drawn:
    bodies = {g.body: _body(e, g, state, rng) for g in groups(e.system)}
    others = [x for x in parameters(e.system) if x.kind not in INERTIAL]
    known = {load.name: load for load in e.system.model.loads}
    loads = {
        (x.owner, x.kind): rng.uniform(0.5, 1.5)
        * (abs(state.value(getattr(known[x.owner], x.kind))) or 1.0)
        for x in others
    }
    return Drawn(bodies, loads)


def _body(
    e: Evidence, group: Group, state: State, rng: np.random.Generator
) -> tuple[float, Array, Array]:
    length = e.units.own.length
    own = sum(state.value(e.system.model.body(name).mass) for name in group.bodies)
    mass = rng.uniform(0.5, 1.5) * (own or e.units.energy * e.units.time**2 / length**2)
    flat = _in_plane(e.system.model.plane)
    com = length * rng.normal(size=3) * flat
    half = rng.normal(size=(3, 3))
    if not flat.all():
        half = np.diag(np.where(flat == 0.0, 1.0 + rng.uniform(), 0.0))
    return mass, com, mass * length**2 * half @ half.T


def _in_plane(plane: str) -> Array:
    return np.array([float(not plane or axis in plane) for axis in "xyz"])


def _with(e: Evidence, drawn: Drawn) -> tuple[Array, Reference, Reference]:
    """π, and the reference with π and with 2π."""
    tens = {name: _ten(*numbers) for name, numbers in drawn.bodies.items()}
    pi = [
        tens[x.owner][INERTIAL.index(x.kind)]
        if x.kind in INERTIAL
        else drawn.loads[x.owner, x.kind]
        for x in parameters(e.system)
    ]
    models = [_changed(e.reference.model, e, drawn, factor) for factor in (1.0, 2.0)]
    once, twice = (replace(e.reference, model=model) for model in models)
    return np.array(pi), once, twice


def _ten(mass: float, com: Array, about_com: Array) -> Array:
    tensor = about_com + mass * ((com @ com) * np.eye(3) - np.outer(com, com))
    places = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
    return np.array([mass, *(mass * com), *(tensor[i, j] for i, j in places)])


# a body without mass, whichever way the file gives its numbers
NOTHING: dict[str, Any] = {
    "mass": ZERO,
    "com": (ZERO,) * 3,
    "inertia": (ZERO,) * 6,
    "first_moment": None,
    "about_origin": None,
}


def _changed(model: Model, e: Evidence, drawn: Drawn, factor: float) -> Model:
    bodies = {body.name: body for body in model.bodies}
    for group in groups(e.system):
        for name in group.bodies:
            bodies[name] = replace(bodies[name], **NOTHING)
        bodies[group.body] = _replaced(bodies[group.body], drawn.bodies[group.body], factor)
    loads = tuple(_load(load, drawn, factor) for load in model.loads)
    return replace(model, bodies=tuple(bodies.values()), loads=loads)


def _replaced(body: Body, numbers: tuple[float, Array, Array], factor: float) -> Body:
    mass, com, I = numbers
    x, y, z = (Number(float(c)) for c in com)
    entries = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
    xx, yy, zz, xy, xz, yz = (Number(factor * float(entry)) for entry in entries)
    inertia = (xx, yy, zz, xy, xz, yz)
    given = {"mass": Number(factor * mass), "com": (x, y, z), "inertia": inertia}
    return replace(body, **(NOTHING | given))


def _load(load: Any, drawn: Drawn, factor: float) -> Any:
    own = {key: Number(factor * x) for (name, key), x in drawn.loads.items() if name == load.name}
    return replace(load, **own) if own else load


def values(e: Evidence) -> float | None:
    """π of the file, from the reference's own frames and numbers."""
    if not e.graph.has("standard_parameters"):
        return None
    errors: list[float] = []
    for s, x in zip(e.samples, e.x):
        ours = np.reshape(e.graph("standard_parameters", s.t, x, s.u, s.p), -1)
        wanted = _own(e, s.state)
        # of one kind the largest counts: a tensor's entries are sums of those of its parts
        kinds = [parameter.kind[:1] + parameter.unit for parameter in parameters(e.system)]
        largest = {k: max(abs(w) for w, kind in zip(wanted, kinds) if kind == k) for k in kinds}
        size = np.array([largest[kind] or 1.0 for kind in kinds])
        errors.append(worst((ours - wanted) / size))
    return worst(errors)


def _own(e: Evidence, state: State) -> Array:
    tens = {group.body: _together(e.system.model, group, state) for group in groups(e.system)}
    known = {load.name: load for load in e.system.model.loads}
    return np.array(
        [
            tens[x.owner][INERTIAL.index(x.kind)]
            if x.kind in INERTIAL
            else state.value(getattr(known[x.owner], x.kind))
            for x in parameters(e.system)
        ]
    )


def _together(model: Model, group: Group, state: State) -> Array:
    """The ten of all bodies of a group, about the origin of the one that carries them."""
    carrier, total = state.frames[group.body], np.zeros(10)
    for name in group.bodies:
        frame, body = state.frames[name], model.body(name)
        R = carrier.rotation.T @ frame.rotation
        r = carrier.rotation.T @ (frame.origin - carrier.origin)
        com = r + R @ state.vector(body.com)
        total += _ten(state.value(body.mass), com, R @ inertia_tensor(state, body) @ R.T)
    return total


def over_v(e: Evidence) -> float | None:
    """Y π and the rest, from (q, v, v̇)."""
    names = [name for name in ("regressor", "regressor_rest") if e.graph.has(name)]
    if not names:
        return None
    errors: list[float] = []
    for s, motion in zip(e.samples, _motions(e)):
        wanted = _forces(motion)
        x = np.concatenate([motion.q, motion.v, motion.vdot])
        size = _floored(wanted.size / e.units.force) * e.units.force
        for name in names:
            ours = e.graph(name, s.t, x, s.u, s.p)
            errors.append(worst(_difference(name, ours, wanted, motion.pi) / size))
    return worst(errors)


def over_w(e: Evidence) -> float | None:
    """Sᵀ Y π and Sᵀ rest at v̇ = S ẇ + σ, from (q, w, ẇ)."""
    names = [name for name in ("regressor_w", "regressor_rest_w") if e.graph.has(name)]
    if not names:
        return None
    rng, errors = np.random.default_rng(7), list[float]()
    conditions = e.own_conditions(e.graph)
    for k, s in enumerate(e.samples):
        S = partial_velocities_at(e, k)
        speeds = slice(len(s.q), len(s.q) + S.shape[1])  # behind them are first-order states
        own = e.graph("dynamics", s.t, e.x[k], s.u, s.p)[speeds]
        wdot = own + e.units.w / e.units.time * rng.normal(size=len(own))
        vdot = e.vdot[k] + S @ (wdot - own)
        drawn = _drawn(e, s.state, rng)
        motion = Motion(s.t, s.q, e.velocities[k], vdot, s.full, *_with(e, drawn))
        wanted = _forces(motion)
        unit = e.units.power / e.units.w
        size = _floored(np.abs(S).T @ wanted.size / unit) * unit * conditions[k]
        projected = Forces(S.T @ wanted.linear, S.T @ wanted.rest, size)
        x = np.concatenate([e.x[k][: speeds.stop], wdot])
        for name in names:
            ours = e.graph(name, s.t, x, s.u, s.p)
            errors.append(worst(_difference(name, ours, projected, motion.pi) / size))
    return worst(errors)


def _floored(size: Array) -> Array:
    return np.maximum(size, SMALL + FLOOR * size.max(initial=0.0))


def _difference(name: str, got: Array, wanted: Forces, pi: Sequence[float] | Array) -> Array:
    if "rest" in name:
        return np.reshape(got, -1) - wanted.rest
    return np.reshape(got, (-1, len(pi))) @ pi - wanted.linear


CHECKS = (
    Check("π", TERMS, "reference: masses and inertias of bodies fixed to each other", values),
    Check("Y π + rest", CANCELLING, "reference: inverse dynamics at π and 2π, any π, v̇", over_v),
    Check(
        "Sᵀ (Y π + rest)",
        SOLVED,
        "reference: its projection at π and 2π, any π and ẇ, per condition number of [A; B]",
        over_w,
    ),
)
