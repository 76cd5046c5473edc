"""Forward dynamics of a tree as loops: which links are of one kind, in what order they stand, and
what stands in the tables. The formulas are those of `derive.mechanics.recursion`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations.limits import MOST_KINDS, MOST_PARAMETRIC
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import difference, is_zero, matrix, plus
from derive.mechanics.limits import EXACT
from derive.mechanics.links import moved
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.recursion import Joint, Kind, Recursion, sweeps
from derive.mechanics.templates import Formula, Key, check_own, formulas, written
from derive.model.load_records import Exhaust

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Sort:
    """What makes a kind: the joint, whether the link is a further child, and how its force is
    written."""

    slides: bool
    further: bool
    force: Key
    constants: int
    inputs: int


@dataclass(frozen=True)
class _Row:
    """A link's values, in the order of `_NAMES` and then those of its force."""

    sort: _Sort
    values: tuple[Scalar, ...]
    inputs: tuple[int, ...]


_NAMES = (
    "sin_alpha", "cos_alpha", "sin_gamma", "cos_gamma", "px", "py", "pz", "offset", "sine",
    "cosine", "m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "rotor",
)  # fmt: skip


def recursion(system: System, otherwise: str = "") -> Recursion:
    """The loops for v̇ of a tree of turning and sliding links. Raises AssumptionError, with the
    reason, for what has other joints, is closed, or has forces that act between joints; and with
    `otherwise`, where that is said."""
    _check(system)
    if otherwise:
        raise AssumptionError(otherwise)
    links, q, v = system.links, ca.SX.sym("q"), ca.SX.sym("v")
    order = _order(links)
    frames, ground = _frames(links, order)
    coordinates = _coordinates(system)
    force = system.Q - system.h_extra
    acting = formulas(force, system.t, system.q, system.v, system.u, system.p)
    rotors = ca.diag(system.M_extra)
    rows: list[_Row] = []
    place = {i: k for k, i in enumerate(order)} | {-1: -1}
    for i in order:
        (j,) = links[i].columns
        check_own(acting[j], coordinates[j], j, links[i].name)
        own = _Own(acting[j], rotors[j], system.q[coordinates[j]])
        rows.append(_row(links, i, frames, ground, own, place[i] == place[links[i].parent] + 1))
    kinds, kinds_of, rows_of, joints = _kinds(system, rows, q, v)
    gravity = ground.T @ np.array([_number(x, "gravity") for x in system.gravity])
    loops, row = sweeps(joints, [_exact(x) for x in gravity])
    return Recursion(
        parents=tuple(place[links[i].parent] for i in order),
        kinds_of=kinds_of,
        rows_of=rows_of,
        coordinates=tuple(coordinates[links[i].columns[0]] for i in order),
        velocities=tuple(links[i].columns[0] for i in order),
        inputs_of=tuple(x.inputs for x in rows),
        kinds=kinds,
        angles=tuple(None if x.slides else plus(x.q, x.offset) for x in joints),
        sweeps=loops,
        t=system.t,
        q=q,
        v=v,
        row=row,
        p=system.p,
    )


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


# ---- frames


def _number(x: Scalar, what: str) -> float:
    if isinstance(x, ca.SX) and not x.is_constant():
        raise AssumptionError(f"{what} is a parameter; `--constants` bakes it in")
    return float(x)


def _numbers(rows: Sequence[Sequence[Scalar]], what: str) -> Array:
    return np.array([[_number(x, what) for x in row] for row in rows])


def _axis(link: Link) -> Array:
    """Of the joint, in the link's frame."""
    motion = link.motion[0]
    part = motion[:3] if any(not is_zero(x) for x in motion[:3]) else motion[3:]
    return np.array([_number(x, f"the axis of {link.name}") for x in part])


def _at_zero(rotation: Rotation) -> Rotation:
    return tuple(f if isinstance(f, Still) else Turn(f.axis, 0.0) for f in rotation)


def _placed(link: Link) -> Array:
    """Parent ← link where the coordinate is zero."""
    return _numbers(matrix(_at_zero(link.rotation)), f"the orientation of {link.name}")


def _frames(links: Sequence[Link], order: Sequence[int]) -> tuple[list[Array], Array]:
    """Link ← frame with z on the axis, for each link, and ground ← frame."""
    axes = [_axis(link) for link in links]
    first: dict[int, int] = {}
    for i in reversed(order):
        first[links[i].parent] = i
    for n, i in enumerate(order):
        if n + 1 < len(order) and links[order[n + 1]].parent == i:
            first[i] = order[n + 1]
    first[-1] = order[0]

    def frame(i: int, z: Array) -> Array:
        if i not in first:
            return _frame(z, z)
        child = links[first[i]]
        return _frame(z, _placed(child) @ axes[first[i]])

    return [frame(i, z) for i, z in enumerate(axes)], frame(-1, np.array([0.0, 0.0, 1.0]))


def _frame(z: Array, following: Array) -> Array:
    """Columns x, y, z with x perpendicular to both axes; some x where they are parallel."""
    x = np.cross(z, following)
    if np.linalg.norm(x) < EXACT:
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    for _ in range(2):  # what rounding leaves along z is large where the axes are nearly parallel
        x = x / np.linalg.norm(x)
        x = x - z * (x @ z)
    x = np.array([_exact(e) for e in x / np.linalg.norm(x)])
    return np.column_stack([x, np.cross(z, x), z])


def _exact(x: float) -> float:
    nearest = float(round(x))
    return nearest if abs(x - nearest) < EXACT else float(x)


# ---- tables


@dataclass(frozen=True)
class _Own:
    """What acts at a joint."""

    force: Formula
    rotor: Scalar
    q: ca.SX


def _row(
    links: Sequence[Link], i: int, frames: Sequence[Array], ground: Array, own: _Own, first: bool
) -> _Row:
    link, F = links[i], frames[i]
    P = frames[link.parent] if link.parent >= 0 else ground
    slides = all(is_zero(x) for x in link.motion[0][:3])
    alpha, beta, gamma = _angles(P.T @ _placed(link) @ F, first)
    behind = links[link.parent].b if link.parent >= 0 else [0.0, 0.0, 0.0]
    arm = _within(P, difference(_start(link, own.q, slides), behind))
    turned = (0.0, *beta) if slides else (float(np.arctan2(*beta)), 0.0, 1.0)
    body = _inertia(link, F)
    values: list[Scalar] = [
        *alpha, *gamma, *arm, *turned, body.mass, *body.moment,
        *(body.tensor[a][b] for a in range(3) for b in range(a, 3)),
        _plain(own.rotor), *map(_plain, own.force.constants),
    ]  # fmt: skip
    force = own.force
    sort = _Sort(slides, not first, force.key, len(force.constants), len(force.inputs))
    return _Row(sort, tuple(values), force.inputs)


def _plain(x: Scalar) -> Scalar:
    """A float where it is a number."""
    return float(x) if isinstance(x, ca.SX) and x.is_constant() else x


def _start(link: Link, q: ca.SX, slides: bool) -> Vector:
    """The joint point in the parent's frame where the coordinate is zero."""
    if not slides:
        return link.a
    return [_plain(ca.substitute(ca.SX(x), q, 0.0)) for x in link.a]


def _within(frame: Array, x: Vector) -> Vector:
    """Components along the columns of a frame."""
    return [_sum([(float(c), e) for c, e in zip(column, x)]) for column in frame.T]


def _sum(terms: Sequence[tuple[float, Scalar]]) -> Scalar:
    total: Scalar = 0.0
    for c, x in terms:
        if c and not is_zero(x):
            total = total + c * x
    return _plain(total)


def _inertia(link: Link, frame: Array) -> Inertia:
    """About the joint point, along the frame."""
    about = moved(link.inertia, (), [-x for x in link.b])
    seen = moved(about, (Still(frame.T.tolist()),), [0.0, 0.0, 0.0])
    tensor: Matrix = [[_plain(x) for x in row] for row in seen.tensor]
    return Inertia(_plain(seen.mass), [_plain(x) for x in seen.moment], tensor)


def _angles(R: Array, first: bool) -> tuple[tuple[float, float], ...]:
    """Sine and cosine of α, β, γ with R = Rz(γ) Rx(α) Rz(β); no γ for a first child."""
    sine, cosine = -R[1, 2], R[2, 2]
    gamma = (0.0, 1.0)
    if not first and np.hypot(R[0, 2], R[1, 2]) > EXACT:
        gamma = _pair(R[0, 2], -R[1, 2])
        sine = np.hypot(R[0, 2], R[1, 2])
    turned = np.array([[gamma[1], gamma[0]], [-gamma[0], gamma[1]]]) @ R[:2, :2]
    return _pair(sine, cosine), _pair(-turned[0, 1], turned[0, 0]), gamma


def _pair(sine: float, cosine: float) -> tuple[float, float]:
    length = float(np.hypot(sine, cosine))
    return _exact(sine / length), _exact(cosine / length)


def _kinds(
    system: System, rows: Sequence[_Row], q: ca.SX, v: ca.SX
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
            rows_of[n] = distinct.setdefault(_key(values), (len(distinct), values))[0]
        table = [values for _, values in distinct.values()]
        kind, joint = _kind(system, sort, table, q, v)
        kinds.append(kind)
        joints.append(joint)
    of = {sort: k for k, sort in enumerate(sorts)}
    return (
        tuple(kinds),
        tuple(of[row.sort] for row in rows),
        tuple(rows_of[n] for n in range(len(rows))),
        joints,
    )


def _key(values: Sequence[Scalar]) -> tuple[object, ...]:
    return tuple([x if isinstance(x, float) else str(x) for x in values])


def _kind(
    system: System, sort: _Sort, table: Sequence[tuple[Scalar, ...]], q: ca.SX, v: ca.SX
) -> tuple[Kind, Joint]:
    """Columns that hold one number become that number."""
    keys = [_key(values) for values in table]
    varies = [
        k
        for k, x in enumerate(table[0])
        if not isinstance(x, float) or any(key[k] != keys[0][k] for key in keys)
    ]
    if len(table) > MOST_PARAMETRIC and any(_is_parametric(values) for values in table):
        raise AssumptionError(
            f"parameters make {len(table)} links differ; `--constants` bakes them in"
        )
    symbols = ca.SX.sym("k", len(varies))
    place = {k: n for n, k in enumerate(varies)}
    values: list[Scalar] = [symbols[place[k]] if k in place else x for k, x in enumerate(table[0])]
    inputs = ca.SX.sym("u", sort.inputs)
    tau = written(
        sort.force, q, v, system.t, values[len(_NAMES) :], [inputs[k] for k in range(sort.inputs)]
    )
    about = ("sliding" if sort.slides else "turning") + (", further child" if sort.further else "")
    kind = Kind(about, symbols, inputs, tuple(tuple(row[k] for k in varies) for row in table))
    return kind, _joint(sort.slides, dict(zip(_NAMES, values)), q, v, tau)


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
