"""Functions of a tree as loops: which links are of one kind, in what order they stand, and what
stands in the tables. The formulas are those of `derive.mechanics.loops`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations.factors import factored
from derive.formulations.limits import MOST_KINDS, MOST_PARAMETRIC
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import difference, is_zero, matrix, plus
from derive.mechanics.limits import EXACT
from derive.mechanics.links import moved
from derive.mechanics.loops.forward_dynamics import forward_dynamics
from derive.mechanics.loops.inverse_dynamics import inverse_dynamics
from derive.mechanics.loops.products import Along, Weights, adjoint_product, forward_product
from derive.mechanics.loops.records import Joint, Kind, Read, Recursion, Sweep
from derive.mechanics.loops.sweeps import Rows
from derive.mechanics.records import Inertia, Link, System
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


def recursion(system: System, function: str = "dynamics", otherwise: str = "") -> Recursion:
    """The loops of a function of a tree of turning and sliding links. Raises AssumptionError, with
    the reason, for what has other joints, is closed, or has forces that act between joints; and
    with `otherwise`, where that is said."""
    _check(system)
    if otherwise:
        raise AssumptionError(otherwise)
    way = WAYS[function]
    links, order = system.links, _order(system.links)
    frames, ground = _frames(links, order)
    coordinates = _coordinates(system)
    acting = formulas(way.force(system), system.t, system.q, system.v, system.u, system.p)
    rotors = ca.diag(system.M_extra)
    rows: list[_Row] = []
    place = {i: k for k, i in enumerate(order)} | {-1: -1}
    for i in order:
        (j,) = links[i].columns
        check_own(acting[j], coordinates[j], j, links[i].name)
        own = _Own(acting[j], rotors[j], system.q[coordinates[j]])
        rows.append(_row(links, i, frames, ground, own, place[i] == place[links[i].parent] + 1))
    at_link = _AtLink.with_inputs(max(len(row.inputs) for row in rows))
    factors = _Factors(system)
    kinds, kinds_of, rows_of, joints = _kinds(system, rows, at_link, factors)
    gravity = ground.T @ np.array([_number(x, "gravity") for x in system.gravity])
    loops, row = way.sweeps(joints, [_exact(x) for x in gravity], at_link)
    places = _Places(
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
        factors=_column(factors.symbols),
        formulas=tuple(factors.formulas),
    )


# ---- the functions


@dataclass(frozen=True)
class _AtLink:
    """What stands for the numbers of the link at hand: its state, its inputs, of which kinds take
    the first ones, and what a function is given besides."""

    q: ca.SX
    v: ca.SX
    u: ca.SX
    rate: ca.SX
    dq: ca.SX
    dv: ca.SX
    du: ca.SX
    y_q: ca.SX
    y_v: ca.SX

    @classmethod
    def with_inputs(cls, inputs: int) -> _AtLink:
        """With as many inputs as a link has at most."""
        names = ("q", "v", "u", "rate", "dq", "dv", "du", "y_q", "y_v")
        sizes = {"u": inputs, "du": inputs}
        return cls(*(ca.SX.sym(name, sizes.get(name, 1)) for name in names))

    @property
    def reads(self) -> tuple[Read, ...]:
        """Of the state and the inputs."""
        return (
            Read("q", self.q, "x", "coordinate"),
            Read("v", self.v, "x", "velocity"),
            *(Read(f"u{k}", self.u[k], "u", f"input{k}") for k in range(self.u.numel())),
        )


@dataclass(frozen=True)
class _Places:
    """By link its coordinate, velocity and inputs, among those of the system."""

    size: int  # of q, and of v
    size_of_u: int
    coordinates: tuple[int, ...]
    velocities: tuple[int, ...]
    of_inputs: tuple[tuple[int, ...], ...]

    @property
    def state(self) -> dict[str, tuple[int, ...]]:
        """In x, and in what is laid out like it."""
        return self.like_state("coordinate", "velocity", 0)

    def like_state(self, q: str, v: str, first: int) -> dict[str, tuple[int, ...]]:
        """In (q, v) that begins there."""
        return {q: _from(self.coordinates, first), v: _from(self.velocities, first + self.size)}

    def inputs(self, name: str, first: int) -> dict[str, tuple[int, ...]]:
        """In u that begins there; where a link has less of them, any."""
        most = max(map(len, self.of_inputs))
        return {
            f"{name}{k}": tuple(first + (own[k] if k < len(own) else 0) for own in self.of_inputs)
            for k in range(most)
        }


def _from(places: tuple[int, ...], first: int) -> tuple[int, ...]:
    return tuple(first + place for place in places)


_Made = tuple[tuple[Sweep, ...], Rows]


@dataclass(frozen=True)
class _Way:
    """A function: what acts at the joints, its sweeps, and what it reads and gives besides."""

    force: Callable[[System], ca.SX]
    sweeps: Callable[[list[Joint], Vector, _AtLink], _Made]
    reads: Callable[[_AtLink], tuple[Read, ...]]
    indices: Callable[[_Places], dict[str, tuple[int, ...]]]


def _all_forces(system: System) -> ca.SX:
    return system.Q - system.h_extra


def _forces_without_inputs(system: System) -> ca.SX:
    idle = ca.substitute(system.Q, system.u, ca.SX.zeros(system.u.numel()))
    return idle - system.h_extra


def _forces_of_a_potential(system: System) -> ca.SX:
    return -system.h_extra


WAYS: dict[str, _Way] = {
    "dynamics": _Way(
        _all_forces,
        lambda joints, gravity, own: forward_dynamics(joints, gravity),
        lambda own: (),
        lambda at: {},
    ),
    "bias": _Way(
        _forces_of_a_potential,
        lambda joints, gravity, own: inverse_dynamics(joints, gravity, 0.0),
        lambda own: (),
        lambda at: {"force": at.velocities},
    ),
    "inverse_dynamics": _Way(
        _forces_without_inputs,
        lambda joints, gravity, own: inverse_dynamics(joints, gravity, own.rate),
        lambda own: (Read("a", own.rate, "x", "rate"),),
        lambda at: {"force": at.velocities, "rate": _from(at.velocities, 2 * at.size)},
    ),
    "dynamics_forward": _Way(
        _all_forces,
        lambda joints, gravity, own: forward_product(
            joints, gravity, Along(own.q, own.v, own.u, own.dq, own.dv, own.du)
        ),
        lambda own: (
            Read("dq", own.dq, "x", "coordinate_change"),
            Read("dv", own.dv, "x", "velocity_change"),
            *(Read(f"du{k}", own.du[k], "x", f"input_change{k}") for k in range(own.du.numel())),
        ),
        lambda at: (
            at.like_state("coordinate_change", "velocity_change", 2 * at.size)
            | at.inputs("input_change", 4 * at.size)
        ),
    ),
    "dynamics_adjoint": _Way(
        _all_forces,
        lambda joints, gravity, own: adjoint_product(
            joints, gravity, Weights(own.q, own.v, own.u, own.y_q, own.y_v)
        ),
        lambda own: (
            Read("y_q", own.y_q, "x", "coordinate_weight"),
            Read("y_v", own.y_v, "x", "velocity_weight"),
        ),
        lambda at: (
            at.like_state("coordinate_weight", "velocity_weight", 2 * at.size)
            | at.inputs("slope", 2 * at.size)
        ),
    ),
}


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
    system: System, rows: Sequence[_Row], at_link: _AtLink, factors: _Factors
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


def _key(values: Sequence[Scalar]) -> tuple[object, ...]:
    return tuple([x if isinstance(x, float) else str(x) for x in values])


def _kind(
    system: System,
    sort: _Sort,
    table: Sequence[tuple[Scalar, ...]],
    at_link: _AtLink,
    factors: _Factors,
) -> tuple[Kind, Joint]:
    """Columns that hold one number become that number."""
    parametric = any(_is_parametric(values) for values in table)
    if len(table) > MOST_PARAMETRIC and parametric:
        columns, values = factors.apart(table)
    else:
        columns, values = _together(table)
    symbols = _column([symbol for symbol, _ in columns])
    rows = tuple(zip(*(column for _, column in columns))) if columns else ((),) * len(table)
    inputs: Vector = [at_link.u[k] for k in range(sort.inputs)]
    tau = written(sort.force, at_link.q, at_link.v, system.t, values[len(_NAMES) :], inputs)
    about = ("sliding" if sort.slides else "turning") + (", further child" if sort.further else "")
    kind = Kind(about, symbols, rows)
    return kind, _joint(sort.slides, dict(zip(_NAMES, values)), at_link.q, at_link.v, tau)


def _column(symbols: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


# symbols of columns that differ from link to link, with them; and what each value of a link is
_Columns = tuple[list[tuple[ca.SX, tuple[Scalar, ...]]], list[Scalar]]


def _together(table: Sequence[tuple[Scalar, ...]]) -> _Columns:
    """Each value a column of its own."""
    columns: list[tuple[ca.SX, tuple[Scalar, ...]]] = []
    values: list[Scalar] = []
    for column in zip(*table):
        keys = {*_key(column)}
        if isinstance(column[0], float) and len(keys) == 1:
            values.append(column[0])
        else:
            symbol = ca.SX.sym(f"k{len(columns)}")
            columns.append((symbol, column))
            values.append(symbol)
    return columns, values


class _Factors:
    """Formulas of parameters that links have in common."""

    def __init__(self, system: System) -> None:
        self._system = system
        self.symbols: list[ca.SX] = []
        self.formulas: list[ca.SX] = []

    def apart(self, table: Sequence[tuple[Scalar, ...]]) -> _Columns:
        """Each value as numbers by link times formulas of parameters.

        Raises AssumptionError where a value is no combination of few formulas.
        """
        columns: list[tuple[ca.SX, tuple[Scalar, ...]]] = []
        values: list[Scalar] = []
        for column in zip(*table):
            made = factored(column, self._system.p, self._system.parameters)
            if made is None:
                raise AssumptionError(
                    f"parameters make {len(table)} links differ; `--constants` bakes them in"
                )
            total: Scalar = 0.0
            for formula, numbers in zip(made.formulas, zip(*made.numbers)):
                number: Scalar = numbers[0]
                if len(set(numbers)) > 1:
                    number = ca.SX.sym(f"k{len(columns)}")
                    columns.append((number, numbers))
                total = _plain(total + number * self._symbol(formula))
            values.append(total)
        return columns, values

    def _symbol(self, formula: Scalar) -> Scalar:
        """What stands for the formula: a symbol, or a number times one that is there."""
        if not isinstance(formula, ca.SX):
            return formula
        for known, symbol in zip(self.formulas, self.symbols):
            both = factored((known, formula), self._system.p, self._system.parameters)
            if both is not None and len(both.formulas) == 1:
                return both.numbers[1][0] * symbol
        self.formulas.append(formula)
        self.symbols.append(ca.SX.sym(f"f{len(self.symbols)}"))
        return self.symbols[-1]


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
