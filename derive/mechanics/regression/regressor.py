"""Inverse dynamics, linear in its parameters: τ = Y(q, v, v̇) π + what no parameter has.

π are the standard inertial parameters of each rigid group of bodies (inertial_rows.py has their
columns), then the friction and rotors that the file has.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Scalar
from derive.expressions.tree import Expression
from derive.mechanics.records import Inertia, Place, System
from derive.mechanics.recursions.accelerations import accelerations
from derive.mechanics.regression.inertial_rows import in_body, inertial_rows, ten_of
from derive.mechanics.system import ideal_system
from derive.model.load_records import Armature, JointDamper, JointFriction
from derive.model.records import Load

# in Pinocchio's order: mass, first moment, tensor about the body's origin by columns of its upper
# triangle
INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
UNITS = ("kg", *("kg*m",) * 3, *("kg*m^2",) * 6)
# of the ten those that a planar motion can feel, by its plane
PLANAR = {"xy": (0, 1, 2, 9), "xz": (0, 1, 3, 6), "yz": (0, 2, 3, 4)}

COEFFICIENTS: dict[type, tuple[str, ...]] = {
    JointDamper: ("coefficient",),
    JointFriction: ("viscous", "coulomb"),
    Armature: ("inertia",),
}


@dataclass(frozen=True)
class Group:
    """Bodies that are fixed to each other; parameters are in the frame of `body`, which the joint
    carries, and about its origin."""

    body: str
    bodies: tuple[str, ...]
    place: Place


@dataclass(frozen=True)
class Parameter:
    """One entry of π: an inertial number of a group, or a coefficient of a load."""

    name: str
    unit: str
    owner: str  # the group's body, or the load
    kind: str  # of INERTIAL, or the load's key


def groups(system: System) -> tuple[Group, ...]:
    """The groups that move and have mass or inertia, in the order of the links. What the file says
    has none stays without."""
    carriers: dict[int, str] = {}
    members: dict[int, list[str]] = {}
    places = dict(system.places)
    for name, place in system.places:
        if place.link >= 0:
            carriers.setdefault(place.link, name)
            members.setdefault(place.link, []).append(name)
    return tuple(
        Group(carriers[i], tuple(members[i]), places[carriers[i]])
        for i in sorted(carriers)
        if not _is_massless(system.links[i].inertia)
    )


def _is_massless(x: Inertia) -> bool:
    numbers = [x.mass, *(entry for row in x.tensor for entry in row)]
    return all(isinstance(number, float) and number == 0.0 for number in numbers)


def parameters(system: System) -> tuple[Parameter, ...]:
    """The entries of π in order: of each group its ten (in a plane the four it feels), then the
    coefficients of dampers, friction and rotors in the order of the file."""
    places = PLANAR.get(system.model.plane, range(10))
    inertial = [
        Parameter(f"{INERTIAL[k]}_{group.body}", UNITS[k], group.body, INERTIAL[k])
        for group in groups(system)
        for k in places
    ]
    turning = {v.name for v in system.model.velocities if v.unit.startswith("rad")}
    loads = system.model.loads
    return (*inertial, *(x for load in loads for x in _coefficients(system, load, turning)))


def _coefficients(system: System, load: Load, turning: Container[str]) -> Iterator[Parameter]:
    for key in _keys(system, load):
        name = f"{load.name}_{key}" if len(COEFFICIENTS[type(load)]) > 1 else load.name
        yield Parameter(name, _unit(load, key, turning), load.name, key)


def _unit(load: Load, key: str, turning: Container[str]) -> str:
    units = {"coulomb": ("N", "N*m"), "inertia": ("kg", "kg*m^2")}
    return units.get(key, ("N*s/m", "N*m*s"))[getattr(load, "velocity", "") in turning]


def parameter_values(system: System) -> ca.SX:
    """π as the model file has it (np × 1), over p."""
    places = PLANAR.get(system.model.plane, range(10))
    values: list[Scalar] = []
    for group in groups(system):
        ten = ten_of(in_body(system.links[group.place.link].inertia, group.place))
        values += [ten[k] for k in places]
    for load in system.model.loads:
        values += [_value(system, load, key) for key in _keys(system, load)]
    return ca.vertcat(*values) if values else ca.SX(0, 1)


def _keys(system: System, load: Load) -> tuple[str, ...]:
    if not _is_linear(system, load):
        return ()
    keys = COEFFICIENTS[type(load)]
    return keys if _has_dry_friction(load) else tuple(key for key in keys if key != "coulomb")


def _has_dry_friction(load: Load) -> bool:
    """Where the file has none, no smoothing is known: over a guessed one its column is nearly that
    of viscous friction, which it would spoil."""
    return isinstance(load, JointFriction) and load.dry


def _is_linear(system: System, load: Load) -> bool:
    """Whether its coefficients are parameters: formulas of the motion are none."""
    keys = COEFFICIENTS.get(type(load), ())
    values = (ca.SX(_value(system, load, key)) for key in keys)
    return bool(keys) and not any(_moves(value, system) for value in values)


def _moves(value: ca.SX, system: System) -> bool:
    if value.is_constant():
        return False  # of most loads, and a look at all coordinates takes its time
    motion = ca.vertcat(system.t, system.q, system.v, system.u)
    return bool(ca.depends_on(value, motion)) or bool(ca.depends_on(value, system.symbols.qd))


def _value(system: System, load: Load, key: str) -> Scalar:
    formula: Expression = getattr(load, key)
    return system.symbols.scalar(formula)


def regressor(system: System, vdot: ca.SX) -> ca.SX:
    """Y (nv × np, sparse) at v̇."""
    places = PLANAR.get(system.model.plane, range(10))
    v = [system.v[j] for j in range(system.v.numel())]
    rates = [vdot[j] for j in range(vdot.numel())]
    motions = accelerations(system.links, v, rates, system.gravity)
    felt = inertial_rows(system.links, [group.place for group in groups(system)], motions)
    columns = [
        _column(len(v), {j: row[k] for j, row in rows.items()}) for rows in felt for k in places
    ]
    columns += [c for load in system.model.loads for c in _of_load(system, load, vdot)]
    return ca.horzcat(*columns) if columns else ca.SX(len(v), 0)


def _column(size: int, entries: dict[int, Scalar]) -> ca.SX:
    result = ca.SX(size, 1)
    for j, x in entries.items():
        if not (isinstance(x, float) and x == 0.0):
            result[j] = x
    return ca.sparsify(result)


def _of_load(system: System, load: Load, vdot: ca.SX) -> Iterator[ca.SX]:
    """The columns of a damper (v), of friction (v and, where it is dry, tanh(v/smoothing)), or of a
    rotor (v̇)."""
    if not _is_linear(system, load):
        return
    along = _direction(system, getattr(load, "velocity", ""))
    rate = ca.mtimes(along.T, system.v)
    if isinstance(load, Armature):
        yield along * ca.mtimes(along.T, vdot)
        return
    yield along * rate
    if isinstance(load, JointFriction) and load.dry:
        yield along * ca.tanh(rate / system.symbols.scalar(load.smoothing))


def _direction(system: System, velocity: str) -> ca.SX:
    """e with rate = eᵀ v: of a generalized velocity, or of a coordinate whose rate is none."""
    for j, v in enumerate(system.model.velocities):
        if v.name == velocity or (v.rate_of and velocity == f"der({v.rate_of})"):
            return _column(system.v.numel(), {j: ca.SX(1)})
    name = velocity.removeprefix("der(").removesuffix(")")
    return ca.sparsify(system.N[system.model.coordinate_index(name), :].T)


def rest(system: System, vdot: ca.SX) -> ca.SX:
    """What inverse dynamics has beside Y π (nv × 1): springs, forces and the energies that a file
    gives by formula, at u = 0. Raises AssumptionError where forces use reactions: they depend on
    all of π, and not linearly."""
    model = system.model
    others = tuple(load for load in model.loads if not _is_linear(system, load))
    bare, reacting = ideal_system(replace(model, loads=others), system.constants)
    if not reacting.is_zero():
        raise AssumptionError(
            f"{model.name}: a force uses reactions, so inverse dynamics is not linear in masses",
            "leave that force out to get a regressor",
        )
    own = ca.vertcat(bare.t, bare.q, bare.v, bare.u, bare.p)
    still = ca.SX.zeros(system.u.numel())
    value = ca.mtimes(bare.M_extra, vdot) + bare.h_extra - bare.Q
    return ca.substitute(value, own, ca.vertcat(system.t, system.q, system.v, still, system.p))
