"""Moving about in the configuration space: q̇ from v, q ⊕ d, q₁ ⊖ q₀, and unit quaternions made so
again.

d is a displacement over the generalized velocities (d = v Δt for a small step). Coordinates that
are no quaternion move along their own rates, q ⊕ d = q + N(q) d. A unit quaternion moves by the
exponential map of its body-frame rotation vector, q ⊕ d = q ∘ (cos |d|/2, sin(|d|/2) d/|d|), and q₁
⊖ q₀ is the logarithm of q̄₀ ∘ q₁, the shorter way round. So q₀ ⊕ (q₁ ⊖ q₀) = q₁ up to the sign of
quaternions, and d/ds (q ⊕ s v) = N v at s = 0. Source: Solà, Deray, Atchuthan, A micro Lie theory
for state estimation in robotics, arXiv 1812.01537, with the retraction q + N d where the
coordinates are a vector space.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.expressions.scalars import Vector
from derive.formulations.limits import TINY
from derive.formulations.records import Argument, Function, Request, Result
from derive.joints.ball import quaternion_rates
from derive.joints.rotations import dot
from derive.mechanics.elimination.solve import scalars, small_inverse
from derive.mechanics.records import System


def is_plain(system: System) -> bool:
    """Whether q̇ = v, N = 1: coordinates and generalized velocities are the same things, and q ⊕ d
    is a sum."""
    return system.q.numel() == system.v.numel() and ca.is_equal(
        system.N, ca.SX.eye(system.v.numel()), 1
    )


def configuration(system: System) -> tuple[Request, ...]:
    """The four functions; they belong in every module whose coordinates are not simply integrals of
    v."""
    if not system.v.numel():
        return ()
    functions = [
        Request("qdot", "rates q̇ = N(q) v of the coordinates, from (q, v)", lambda: _qdot(system)),
        Request(
            "integrate",
            "q ⊕ d: the configuration a displacement d over v away, from (q, d)",
            lambda: _integrate(system),
        ),
        Request(
            "difference",
            "q₁ ⊖ q₀: the displacement over v from q₀ to q₁, from (q₀, q₁)",
            lambda: _difference(system),
        ),
    ]
    if system.quaternions:
        functions.append(
            Request(
                "normalise",
                "q with every quaternion brought to length one",
                lambda: _normalise(system),
            )
        )
    return tuple(functions)


def _qdot(system: System) -> Function:
    about = "rates q̇ = N(q) v of the coordinates, from (q, v)"
    return _function(
        "qdot",
        about,
        "qdot",
        system.qdot,
        [(system.q, _q(system)), (system.v, _v(system))],
        _rates(system),
    )


def _integrate(system: System) -> Function:
    """q ⊕ d: q + N d for plain coordinates, q ∘ exp(d/2) for quaternions, still of length 1."""
    d = _symbols("d_", [v.name for v in system.model.velocities])
    # exact for coordinates in a vector space, of first order for Euler angles; quaternions follow
    # below
    moved = ca.substitute(system.q + ca.mtimes(system.N, system.v), system.v, d)
    entries: Vector = [moved[i] for i in range(moved.numel())]
    for start, columns in _turns(system):
        entries[start : start + 4] = _turned(
            _part(system.q, range(start, start + 4)), _part(d, columns)
        )
    about = "q ⊕ d: the configuration a displacement d over v away, from (q, d)"
    labels = (d, tuple(f"d {v.name}" for v in system.model.velocities))
    return _function(
        "integrate", about, "q", ca.vertcat(*entries), [(system.q, _q(system)), labels], _q(system)
    )


def _difference(system: System) -> Function:
    """q₁ ⊖ q₀ with N at q₀: rotation vectors of quaternions, N⁻¹ (q₁ − q₀) of all else, block by
    block."""
    other = _symbols("to_", [c.name for c in system.model.coordinates])
    d: Vector = [0.0] * system.v.numel()
    for start, columns in _turns(system):
        quaternion = range(start, start + 4)
        for column, value in zip(
            columns, _rotation_vector(_part(system.q, quaternion), _part(other, quaternion))
        ):
            d[column] = value
    steps = other - system.q
    for rows, columns in _blocks(system):
        inverse, _ = small_inverse(scalars(system.N[rows, columns]))
        step = _part(steps, rows)
        for column, line in zip(columns, inverse):
            d[column] = dot(line, step)
    about = "q₁ ⊖ q₀: the displacement over v from q₀ to q₁, from (q₀, q₁)"
    slots = [(system.q, _q(system)), (other, tuple(f"to {name}" for name in _q(system)))]
    return _function(
        "difference", about, "d", ca.vertcat(*d), slots, tuple(f"d {name}" for name in _v(system))
    )


def _normalise(system: System) -> Function:
    entries = _part(system.q, range(system.q.numel()))
    for start in system.quaternions:
        part = entries[start : start + 4]
        length = ca.sqrt(ca.sumsqr(ca.vertcat(*part)))
        entries[start : start + 4] = [x / length for x in part]
    about = "q with every quaternion brought to length one"
    return _function(
        "normalise", about, "q", ca.vertcat(*entries), [(system.q, _q(system))], _q(system)
    )


def _function(
    name: str,
    about: str,
    result: str,
    value: ca.SX,
    slots: Sequence[tuple[ca.SX, tuple[str, ...]]],
    labels: tuple[str, ...],
) -> Function:
    taken = Argument(
        "x", ca.vertcat(*(s for s, _ in slots)), tuple(n for _, names in slots for n in names), ()
    )
    return Function(name, about, Result(result, ca.densify(value), labels, ()), x=taken)


def _q(system: System) -> tuple[str, ...]:
    return tuple(c.name for c in system.model.coordinates)


def _v(system: System) -> tuple[str, ...]:
    return tuple(v.name for v in system.model.velocities)


def _rates(system: System) -> tuple[str, ...]:
    return tuple(f"der({name})" for name in _q(system))


def _symbols(prefix: str, names: Sequence[str]) -> ca.SX:
    return ca.vertcat(*(ca.SX.sym(prefix + name) for name in names))


def _part(column: ca.SX, indices: Sequence[int]) -> Vector:
    return [column[i] for i in indices]


def _turns(system: System) -> list[tuple[int, list[int]]]:
    """Where each quaternion starts in q, and its angular velocity's indices in v."""
    columns = _columns(system)
    return [
        (i, sorted({j for row in range(i, i + 4) for j in columns[row]}))
        for i in system.quaternions
    ]


def _columns(system: System) -> list[set[int]]:
    """By coordinate the velocities that its rate is made of."""
    result: list[set[int]] = [set() for _ in range(system.q.numel())]
    for row, column in zip(*system.N.sparsity().get_triplet()):
        result[row].add(column)
    return result


def _blocks(system: System) -> list[tuple[list[int], list[int]]]:
    """Rows and columns of the square blocks of N that have no quaternion in them."""
    turned = {row for start in system.quaternions for row in range(start, start + 4)}
    groups: dict[int, tuple[set[int], set[int]]] = {}  # by velocity the group that it is in
    for row, own in enumerate(_columns(system)):
        if row in turned:
            continue
        rows, columns = {row}, set(own)
        for group in {id(groups[j]): groups[j] for j in own if j in groups}.values():
            rows |= group[0]
            columns |= group[1]
        groups |= dict.fromkeys(columns, (rows, columns))
    found = {id(group): group for group in groups.values()}.values()
    return sorted((sorted(rows), sorted(columns)) for rows, columns in found)


def _turned(q: Vector, d: Vector) -> Vector:
    """q ∘ exp(d/2)."""
    angle = ca.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + TINY)
    share = ca.sin(0.5 * angle) / angle
    still, along = ca.cos(0.5 * angle), quaternion_rates(q, [2.0 * share * x for x in d])
    return [still * a + b for a, b in zip(q, along)]


def _rotation_vector(start: Vector, end: Vector) -> Vector:
    """2 log(q̄₀ ∘ q₁), the shorter way."""
    a, b, c, d = start
    w, x, y, z = end
    real = a * w + b * x + c * y + d * z
    turn = [
        a * x - b * w - c * z + d * y,
        a * y + b * z - c * w - d * x,
        a * z - b * y + c * x - d * w,
    ]
    size = ca.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + TINY)
    # q and −q are the same rotation: |real| takes the one less than half a turn away
    share = 2.0 * ca.copysign(ca.atan2(size, ca.fabs(real)), real) / size
    return [share * e for e in turn]
