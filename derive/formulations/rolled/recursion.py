"""Functions of a tree as loops: which links are of one kind, in what order they stand, and what
stands in the tables. The formulas are those of `derive.mechanics.loops`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.deferred import changed
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations.limits import MOST_KINDS, MOST_PARAMETRIC
from derive.formulations.rolled.columns import Factors, signature, stacked, together
from derive.formulations.rolled.rows import (
    NAMES,
    Array,
    Own,
    Row,
    Sort,
    exact,
    frames_of,
    number,
    orientation,
    row_of,
)
from derive.formulations.rolled.ways import WAYS, AtLink, Places, Way
from derive.joints.rotations import cross, difference, is_one, plus, product, rotated, transpose
from derive.mechanics.loops.records import Joint, Kind, Recursion
from derive.mechanics.records import Link, Pushed, System
from derive.mechanics.scene import OF_A_LINK
from derive.mechanics.templates import (
    Q,
    Shared,
    Slots,
    V,
    check_own,
    formulas,
    shared,
    written,
    written_shared,
)
from derive.model.load_records import Exhaust


def recursion(system: System, function: str = "dynamics", otherwise: str = "") -> Recursion:
    """The loops of a function of a tree. Raises AssumptionError, with the reason, for what has
    joints with Euler angles or screws, is closed, or has forces that act between joints; and with
    `otherwise`, where that is said."""
    _check(system)
    if otherwise:
        raise AssumptionError(otherwise)
    way = WAYS[function]
    links, order = system.links, _order(system.links)
    frames, ground = frames_of(links, order)
    coordinates = _coordinates(system)
    own = _of_links(system, way, coordinates, frames)
    place = {i: k for k, i in enumerate(order)} | {-1: -1}
    rows = [
        row_of(system, i, frames, ground, own[i], place[i] == place[links[i].parent] + 1)
        for i in order
    ]
    at_link = AtLink.with_most(
        max(len(own[i].q) for i in order),
        max(len(links[i].columns) for i in order),
        max(len(row.inputs) for row in rows),
    )
    factors = Factors(system)
    kinds, kinds_of, rows_of, joints = _kinds(system, rows, at_link, factors)
    gravity = ground.T @ np.array([number(x, "gravity") for x in system.gravity])
    axes: Matrix = [[exact(x) for x in line] for line in ground]
    loops, row = way.sweeps(joints, [exact(x) for x in gravity], axes, at_link)
    places = Places(
        system.q.numel(),
        system.v.numel(),
        tuple(own[i].q for i in order),
        tuple(links[i].columns for i in order),
        tuple(row.inputs for row in rows),
    )
    return Recursion(
        parents=tuple(place[links[i].parent] for i in order),
        kinds_of=kinds_of,
        rows_of=rows_of,
        indices=places.state | places.inputs("input", 0) | way.indices(places),
        reads=(*at_link.reads, *way.reads(at_link)),
        kinds=kinds,
        angles=tuple(x.angle for x in joints),
        sweeps=loops,
        t=system.t,
        row=row.symbols,
        p=system.p,
        factors=stacked(factors.symbols),
        formulas=tuple(factors.formulas),
    )


# ---- which trees


def _check(system: System) -> None:
    """A tree, and nothing that lies between its joints."""
    if system.rows or system.phi.numel():
        raise AssumptionError("it has constraints")
    if not system.links:
        raise AssumptionError("nothing moves")
    rows, columns = system.M_extra.sparsity().get_triplet()
    if rows != columns:
        raise AssumptionError("inertia couples joints that do not follow each other")
    if any(isinstance(load, Exhaust) for load in system.model.loads):
        raise AssumptionError("a mass depends on t")
    if ca.depends_on(ca.diag(system.M_extra), ca.vertcat(system.q, system.t)):
        raise AssumptionError("a kinetic energy given by formula is not constant")


def _coordinates(system: System) -> list[tuple[int, ...]]:
    """By link the coordinates whose rates its velocities make: of one velocity the one that it is
    the rate of."""
    rates: list[list[int]] = [[] for _ in range(system.v.numel())]
    for row, column in zip(*system.N.sparsity().get_triplet()):
        rates[column].append(row)
    found = [tuple(sorted({k for j in x.columns for k in rates[j]})) for x in system.links]
    for link, own in zip(system.links, found):
        single = len(link.columns) == 1
        if single and not (len(own) == 1 and is_one(system.N[own[0], link.columns[0]])):
            raise AssumptionError("a velocity is not the rate of a coordinate")
    if sorted(k for own in found for k in own) != list(range(system.q.numel())):
        raise AssumptionError("a coordinate belongs to several joints")
    return found


def _of_links(
    system: System, way: Way, coordinates: Sequence[tuple[int, ...]], frames: Sequence[Array]
) -> list[Own]:
    """By link what belongs to its joint, or else to that and the link by itself."""
    try:
        return _own(system, coordinates, frames, way.force(system))
    except AssumptionError:
        if not way.pushes or system.pushed is None:
            raise
        pushed = system.pushed()
        if not pushed.couples:
            raise
    at_joints = changed(system, Q=pushed.force)
    found = _own(at_joints, coordinates, frames, way.force(at_joints))
    slots = _slots(system, coordinates)
    if way.idle:
        pushed = _without_inputs(system, pushed)
    return [
        replace(own, push=_push(system, pushed, i, frames[i], slots))
        if i in pushed.couples
        else own
        for i, own in enumerate(found)
    ]


def _without_inputs(system: System, pushed: Pushed) -> Pushed:
    idle = ca.SX.zeros(system.u.numel())

    def at_rest(x: Vector) -> Vector:
        return [*ca.vertsplit(ca.substitute(ca.vertcat(*map(ca.SX, x)), system.u, idle))]

    couples = {i: (at_rest(n), at_rest(f)) for i, (n, f) in pushed.couples.items()}
    return replace(pushed, couples=couples)


def _push(system: System, pushed: Pushed, i: int, frame: Array, slots: Slots) -> Shared:
    """(n, f) about the joint point, along the frame of link i, over the pose of that frame. With F
    (link ← frame) and the joint point b: R = R' Fᵀ, r = r' − R b, ω = F ω', v = F v' − ω × b."""
    link = system.links[i]
    F: Matrix = [[exact(x) for x in line] for line in frame]
    own = ca.SX.sym("own", OF_A_LINK)
    entries: Vector = [*ca.vertsplit(own)]
    R = product([entries[:3], entries[3:6], entries[6:9]], transpose(F))
    omega = rotated(F, entries[12:15])
    at: Vector = [
        *(x for line in R for x in line),
        *difference(entries[9:12], rotated(R, link.b)),
        *omega,
        *difference(rotated(F, entries[15:]), cross(omega, link.b)),
    ]
    n, f = pushed.couples[i]
    about = rotated(transpose(F), difference(n, cross(link.b, f)))
    wrench = ca.vertcat(*[ca.SX(x) for x in (*about, *rotated(transpose(F), f))])
    placed = ca.substitute(wrench, pushed.poses[i], ca.vertcat(*[ca.SX(x) for x in at]))
    return shared(placed, own, slots)


def _slots(system: System, coordinates: Sequence[tuple[int, ...]]) -> Slots:
    return Slots(
        system.t, system.q, system.v, system.u, system.p,
        {k: n for own in coordinates for n, k in enumerate(own)},
        {j: n for link in system.links for n, j in enumerate(link.columns)},
        {(Q, k): i for i, own in enumerate(coordinates) for k in own}
        | {(V, j): i for i, link in enumerate(system.links) for j in link.columns},
    )  # fmt: skip


def _own(
    system: System, coordinates: Sequence[tuple[int, ...]], frames: Sequence[Array], force: ca.SX
) -> list[Own]:
    """By link what belongs to its joint."""
    rotors = ca.diag(system.M_extra)
    several = [i for i, link in enumerate(system.links) if len(link.columns) > 1]
    rates = ca.mtimes(system.N, system.v) if several else ca.SX(0, 1)
    values: list[Scalar] = [*ca.vertsplit(ca.densify(force))]
    places: dict[int, range] = {}
    for i in several:
        turned = orientation(system.links[i], frames[i]) or []
        more = [*(rates[k] for k in coordinates[i]), *(x for line in turned for x in line)]
        places[i] = range(len(values), len(values) + len(more))
        values += more
    found = formulas(ca.SX(ca.vertcat(*values)), _slots(system, coordinates))
    result: list[Own] = []
    for i, (link, own) in enumerate(zip(system.links, coordinates)):
        places_of = [*link.columns, *places.get(i, ())]
        for k in places_of:
            check_own(found[k], own, link.columns, link.name)
        rotor = tuple(rotors[j] for j in link.columns)
        result.append(Own(own, tuple(found[k] for k in places_of), rotor))
    return result


def _order(links: Sequence[Link]) -> list[int]:
    """Depth first, the child that carries most directly behind its parent."""
    children: dict[int, list[int]] = {}
    size = [1] * len(links)
    for i in reversed(range(len(links))):
        children.setdefault(links[i].parent, []).append(i)
        if links[i].parent >= 0:
            size[links[i].parent] += size[i]
    order: list[int] = []
    stack = sorted(children[-1], key=lambda i: (size[i], -i))
    while stack:
        i = stack.pop()
        order.append(i)
        stack += sorted(children.get(i, []), key=lambda c: (size[c], -c))
    return order


# ---- kinds


def _kinds(
    system: System, rows: Sequence[Row], at_link: AtLink, factors: Factors
) -> tuple[tuple[Kind, ...], tuple[int, ...], tuple[int, ...], list[Joint]]:
    """Kinds in the order of their first link, and for every link its kind and the row of it."""
    sorts = list(dict.fromkeys(row.sort for row in rows))
    if len(sorts) > MOST_KINDS:
        raise AssumptionError(f"it has {len(sorts)} kinds of joints, too many for one loop")
    kinds: list[Kind] = []
    joints: list[Joint] = []
    rows_of: dict[int, int] = {}
    for sort in sorts:
        own = {n: row.values for n, row in enumerate(rows) if row.sort == sort}
        distinct: dict[tuple[object, ...], tuple[int, tuple[Scalar, ...]]] = {}
        for n, values in own.items():
            rows_of[n] = distinct.setdefault(signature(values), (len(distinct), values))[0]
        table = [values for _, values in distinct.values()]
        kind, joint = _kind(system, sort, table, at_link, factors)
        kinds.append(kind)
        joints.append(joint)
    of = {sort: k for k, sort in enumerate(sorts)}
    return (
        tuple(kinds),
        tuple(of[row.sort] for row in rows),
        tuple(rows_of[n] for n in range(len(rows))),
        joints,
    )


def _kind(
    system: System,
    sort: Sort,
    table: Sequence[tuple[Scalar, ...]],
    at_link: AtLink,
    factors: Factors,
) -> tuple[Kind, Joint]:
    """Columns that hold one number become that number."""
    parametric = any(_is_parametric(values) for values in table)
    if len(table) > MOST_PARAMETRIC and parametric:
        columns, values = factors.apart(table)
    else:
        columns, values = together(table)
    symbols = stacked([symbol for symbol, _ in columns])
    rows = tuple(zip(*(column for _, column in columns))) if columns else ((),) * len(table)
    about = sort.shape.about + (", further child" if sort.further else "")
    return Kind(about, symbols, rows), _joint(sort, values, system.t, at_link)


def _is_parametric(values: Sequence[Scalar]) -> bool:
    return not all(isinstance(x, float) for x in values)


def _joint(sort: Sort, values: Sequence[Scalar], t: ca.SX, at_link: AtLink) -> Joint:
    """With the first symbols of what is at the link."""
    shape = sort.shape
    named: dict[str, Scalar] = dict(zip(NAMES, values))
    count, many = len(shape.axes), len(shape.shifts)
    q, v = ca.vertsplit(at_link.q)[:many], ca.vertsplit(at_link.v)[:count]
    rest = values[len(NAMES) :]
    written_out = _written(sort, rest[count:], t, q, v, at_link.u)
    tau, others = written_out[:count], written_out[count:]
    rates: Vector = others[:many] if others else [*v]
    entries = others[many:]
    tensor = [
        [named["I" + "".join(sorted("xyz"[a] + "xyz"[b]))] for b in range(3)] for a in range(3)
    ]
    return Joint(
        axes=shape.axes,
        q=tuple(q),
        v=tuple(v),
        rates=rates,
        tau=tau,
        rotor=[*rest[:count]],
        angle=plus(q[shape.angle], named["offset"]) if shape.angle >= 0 else None,
        turned=[entries[3 * i : 3 * i + 3] for i in range(3)] if shape.turned else None,
        shifts=shape.shifts,
        alpha=(named["sin_alpha"], named["cos_alpha"]),
        beta=(named["sin_beta"], named["cos_beta"]),
        gamma=(named["sin_gamma"], named["cos_gamma"]),
        place=[named["px"], named["py"], named["pz"]],
        mass=named["m"],
        moment=[named["mx"], named["my"], named["mz"]],
        tensor=tensor,
        push=_pushed(sort, rest[count:], t, at_link.u),
    )


def _pushed(
    sort: Sort, constants: Sequence[Scalar], t: ca.SX, u: ca.SX
) -> tuple[ca.SX, Vector] | None:
    """What acts on links of a kind by themselves, over symbols for a link's pose."""
    if sort.push is None:
        return None
    own = ca.SX.sym("own", OF_A_LINK)
    left: Vector = [*constants[sum(sort.constants) :]]
    inputs: Vector = [*ca.vertsplit(u)[sum(sort.inputs) :]]
    return own, written_shared(sort.push, ca.vertsplit(own), t, left, inputs)


def _written(
    sort: Sort,
    constants: Sequence[Scalar],
    t: ca.SX,
    q: Sequence[ca.SX],
    v: Sequence[ca.SX],
    u: ca.SX,
) -> Vector:
    """The formulas of a kind over these symbols."""
    left, inputs = iter(constants), iter(ca.vertsplit(u))
    return [
        written(key, q, v, t, [*islice(left, many)], [*islice(inputs, taken)])
        for key, many, taken in zip(sort.keys, sort.constants, sort.inputs)
    ]
