"""Functions of a tree as loops: which links are of one kind, in what order they stand, and what
stands in the tables. The formulas are those of `derive.mechanics.loops`."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Scalar, Vector
from derive.formulations.limits import MOST_KINDS, MOST_PARAMETRIC
from derive.formulations.rolled.columns import Factors, signature, stacked, together
from derive.formulations.rolled.rows import NAMES, Own, Row, Sort, exact, frames_of, number, row_of
from derive.formulations.rolled.ways import WAYS, AtLink, Places
from derive.joints.rotations import is_zero, plus
from derive.mechanics.loops.records import Joint, Kind, Recursion
from derive.mechanics.records import Link, System
from derive.mechanics.templates import check_own, formulas, written
from derive.model.load_records import Exhaust


def recursion(system: System, function: str = "dynamics", otherwise: str = "") -> Recursion:
    """The loops of a function of a tree of turning and sliding links. Raises AssumptionError, with
    the reason, for what has other joints, is closed, or has forces that act between joints; and
    with `otherwise`, where that is said."""
    _check(system)
    if otherwise:
        raise AssumptionError(otherwise)
    way = WAYS[function]
    links, order = system.links, _order(system.links)
    frames, ground = frames_of(links, order)
    coordinates = _coordinates(system)
    acting = formulas(way.force(system), system.t, system.q, system.v, system.u, system.p)
    rotors = ca.diag(system.M_extra)
    rows: list[Row] = []
    place = {i: k for k, i in enumerate(order)} | {-1: -1}
    for i in order:
        (j,) = links[i].columns
        check_own(acting[j], coordinates[j], j, links[i].name)
        own = Own(acting[j], rotors[j], system.q[coordinates[j]])
        rows.append(row_of(links, i, frames, ground, own, place[i] == place[links[i].parent] + 1))
    at_link = AtLink.with_inputs(max(len(row.inputs) for row in rows))
    factors = Factors(system)
    kinds, kinds_of, rows_of, joints = _kinds(system, rows, at_link, factors)
    gravity = ground.T @ np.array([number(x, "gravity") for x in system.gravity])
    loops, row = way.sweeps(joints, [exact(x) for x in gravity], at_link)
    places = Places(
        len(coordinates),
        system.u.numel(),
        tuple(coordinates[links[i].columns[0]] for i in order),
        tuple(links[i].columns[0] for i in order),
        tuple(row.inputs for row in rows),
    )
    return Recursion(
        parents=tuple(place[links[i].parent] for i in order),
        kinds_of=kinds_of,
        rows_of=rows_of,
        indices=places.state | places.inputs("input", 0) | way.indices(places),
        reads=(*at_link.reads, *way.reads(at_link)),
        kinds=kinds,
        angles=tuple(None if x.slides else plus(x.q, x.offset) for x in joints),
        sweeps=loops,
        t=system.t,
        row=row.symbols,
        p=system.p,
        factors=stacked(factors.symbols),
        formulas=tuple(factors.formulas),
    )


# ---- which trees


def _check(system: System) -> None:
    """A tree of joints with one velocity each, that turns or slides along one axis."""
    if system.rows or system.phi.numel():
        raise AssumptionError("it has constraints")
    if not system.links:
        raise AssumptionError("nothing moves")
    for link in system.links:
        if len(link.columns) != 1:
            raise AssumptionError(f"{link.name} has {len(link.columns)} degrees of freedom")
        angular, linear = link.motion[0][:3], link.motion[0][3:]
        if not (all(map(is_zero, angular)) or all(map(is_zero, linear))):
            raise AssumptionError(f"{link.name} turns and slides at once")
    rows, columns = system.M_extra.sparsity().get_triplet()
    if rows != columns:
        raise AssumptionError("inertia couples joints that do not follow each other")
    if any(isinstance(load, Exhaust) for load in system.model.loads):
        raise AssumptionError("a mass depends on t")
    if ca.depends_on(ca.diag(system.M_extra), ca.vertcat(system.q, system.t)):
        raise AssumptionError("a kinetic energy given by formula is not constant")


def _coordinates(system: System) -> dict[int, int]:
    """By velocity the coordinate whose rate it is."""
    rows, columns = system.N.sparsity().get_triplet()
    plain = len(rows) == system.v.numel() == system.q.numel()
    if not (plain and system.N.is_constant() and len(set(rows)) == len(set(columns)) == len(rows)):
        raise AssumptionError("a velocity is not the rate of a coordinate")
    if not all(float(system.N[i, j]) == 1.0 for i, j in zip(rows, columns)):
        raise AssumptionError("a velocity is not the rate of a coordinate")
    return dict(zip(columns, rows))


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
    inputs: Vector = [at_link.u[k] for k in range(sort.inputs)]
    tau = written(sort.force, at_link.q, at_link.v, system.t, values[len(NAMES) :], inputs)
    about = ("sliding" if sort.slides else "turning") + (", further child" if sort.further else "")
    kind = Kind(about, symbols, rows)
    return kind, _joint(sort.slides, dict(zip(NAMES, values)), at_link.q, at_link.v, tau)


def _is_parametric(values: Sequence[Scalar]) -> bool:
    return not all(isinstance(x, float) for x in values)


def _joint(slides: bool, of: dict[str, Scalar], q: ca.SX, v: ca.SX, tau: Scalar) -> Joint:
    tensor = [[of["I" + "".join(sorted("xyz"[a] + "xyz"[b]))] for b in range(3)] for a in range(3)]
    return Joint(
        slides=slides,
        q=q,
        v=v,
        tau=tau,
        rotor=of["rotor"],
        offset=of["offset"],
        sine=of["sine"],
        cosine=of["cosine"],
        alpha=(of["sin_alpha"], of["cos_alpha"]),
        gamma=(of["sin_gamma"], of["cos_gamma"]),
        place=[of["px"], of["py"], of["pz"]],
        mass=of["m"],
        moment=[of["mx"], of["my"], of["mz"]],
        tensor=tensor,
    )
