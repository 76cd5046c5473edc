"""Model → System: one page that says in which order the mechanics is written down."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.expressions.counting import cheapest
from derive.expressions.deferred import Deferred
from derive.expressions.one_sided import gradient
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints import joint_type
from derive.joints.rotations import is_zero
from derive.mechanics.analytic import Lagrangian, lagrangian
from derive.mechanics.blocks import blocks
from derive.mechanics.carriers import carried
from derive.mechanics.energies import Energies
from derive.mechanics.events import events
from derive.mechanics.inverse.dynamics import joint_forces_of_motion
from derive.mechanics.inverse.layouts import layouts
from derive.mechanics.limits import DEEP_IN_PLANE, FEW, LONG, MOST_ENTRIES, REGULAR
from derive.mechanics.links import links_and_places, regrouped
from derive.mechanics.loads import Loads, applied, armatures, by_links
from derive.mechanics.measures import with_measures
from derive.mechanics.outputs import outputs
from derive.mechanics.records import Inertia, Link, RowForm, System
from derive.mechanics.recursions.forms import ONE, Form
from derive.mechanics.recursions.motion import (
    REST,
    Numbers,
    Twist,
    joint_part,
    parent_part,
    row_form,
    row_products,
    twist,
    velocity_products,
    with_products,
)
from derive.mechanics.recursions.tree import mass_matrix, path, row_forces
from derive.mechanics.scene import Block, Scene
from derive.mechanics.silent import silenced, without_rounding
from derive.mechanics.states import rates_of_states
from derive.mechanics.symbols import Symbols, quaternions, symbols
from derive.model.load_records import Exhaust
from derive.model.records import Model

REST_NUMBERS: Numbers = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])


def ideal_system(model: Model, constants: Collection[str] | str = ()) -> tuple[System, ca.SX]:
    """The mechanics of a model with its ideal constraints, and the forces C (nv) that do not
    belong to the ideal problem: of nonideal constraints, and of loads that use its reactions.

    `constants` names the parameters to bake in as numbers ("all" for every one). Raises ModelError
    where the kinetic energy is not quadratic in the rates.
    """
    every = tuple(x.name for x in model.parameters)
    baked = every if constants == "all" else tuple(name for name in every if name in constants)
    s = symbols(model, baked)
    links, places = links_and_places(model, s)
    qdot = _qdot(model, s)
    plain = Scene(model, s, qdot, links, places)
    scene = with_measures(plain)
    s = scene.symbols
    parts = blocks(scene)
    loads, reacting = applied(scene)
    extra = _with_rotors(lagrangian(model, s, qdot), armatures(scene), s)
    g: Vector = s.vector(model.gravity) if model.gravity else [0.0, 0.0, 0.0]
    nonideal = _nonideal(scene, parts) + reacting
    return _assembled((plain, scene), baked, parts, (loads, nonideal), extra, g)


def _inertias(links: Sequence[Link]) -> tuple[tuple[Inertia, ...], ...]:
    """As given and regrouped; for many links the regrouped ones alone, which are cheaper but for
    the smallest models."""
    return (
        *([tuple(link.inertia for link in links)] if len(links) <= FEW else []),
        regrouped(links),
    )


def _assembled(
    scenes: tuple[Scene, Scene],
    baked: tuple[str, ...],
    found: list[Block],
    forces: tuple[Loads, ca.SX],
    extra: Lagrangian,
    g: Vector,
) -> tuple[System, ca.SX]:
    """M, h, Q, A, c, β, T and V from the parts, and who balances what: h holds gravity and a
    potential given by formula, Q the springs, so that M v̇ + h = Q + Aᵀ λ counts no force twice."""
    plain, scene = scenes
    model, s, links, nv = scene.model, scene.symbols, scene.links, scene.symbols.v.numel()
    loads, nonideal = forces
    tied = any(block.rows for block in found)
    written = _is_short(links, tied) or not nonideal.is_zero()
    lasting = not any(isinstance(load, Exhaust) for load in model.loads)
    late = not written and not tied and lasting and len(links) >= LONG
    inertias = functools.cache(lambda: _inertias(links))
    seen = functools.cache(lambda: layouts(links))
    M = _mass(links, inertias(), nv) + extra.M if written else ca.SX(nv, nv)
    found, (A, c, beta) = _told(scene, found)
    phi = _stacked(x for block in found for x in block.phi)
    assembly = _stacked(x for block in found for x in block.closing)
    excess = _stacked(x for block in found for x in block.excess)
    # q̇ is linear in v, so its Jacobian is N itself
    N = ca.jacobian(scene.qdot, s.v)
    # −∂V/∂q is conjugate to q̇, and q̇ = N v: over v it is −Nᵀ ∂V/∂q
    Q = loads.force - ca.mtimes(N.T, gradient(loads.sloped, s.q))
    of = Energies(scene, loads, extra, g, rates_of_states(scene), late)

    def bias() -> ca.SX:
        forces = joint_forces_of_motion(seen(), _entries(s.v), [0.0] * nv, g)
        return _column(forces) + extra.h

    def term(make: Callable[[], ca.SX], size: int = 1) -> ca.SX | Deferred[ca.SX]:
        return Deferred(make, size) if late else make()

    measured = outputs(scene)
    result = System(
        model=model,
        symbols=s,
        constants=baked,
        t=s.t,
        q=s.q,
        v=s.v,
        u=s.u,
        p=s.p,
        parameters=s.defaults,
        qdot=scene.qdot,
        N=N,
        M=M,
        h=term(functools.cache(bias), nv),
        Q=Q,
        phi=phi,
        assembly=assembly,
        excess=excess,
        A=A,
        c=c,
        beta=beta,
        T=term(lambda: of.kinetic),
        V=term(lambda: of.potential),
        energy=term(lambda: of.balanced),
        homogeneous=extra.missing.is_zero(),
        power=term(lambda: of.power),
        outputs=measured,
        events=events(scene, measured),
        rows=tuple(row for block in found for row in block.rows),
        links=links,
        carried=Deferred(lambda: carried(scene, g)),
        inertias=Deferred(inertias),
        layouts=Deferred(seen),
        places=tuple(scene.places.items()),
        blocks=tuple(block.ways for block in found),
        written=written,
        definite=not written or _is_definite(M, s),
        quaternions=quaternions(model),
        M_extra=extra.M,
        M_given=extra.given,
        h_extra=extra.h,
        gravity=g,
        names=(),
        assumptions=model.notes,
        z=s.z,
        zdot=of.zdot,
        pushed=functools.cache(lambda: by_links(with_measures(plain.at_links()))),
    )
    return result, nonideal


def _stacked(entries: Iterable[ca.SX]) -> ca.SX:
    """One under the other, also where there are none."""
    given = list(entries)
    return ca.vertcat(*given) if given else ca.SX(0, 1)


def _is_short(links: Sequence[Link], tied: bool) -> bool:
    """Whether M has few entries; that of many links is needed only where they are tied."""
    entries = 0
    above: list[int] = []  # velocities, with those of the link itself
    for link in links:
        own = len(link.columns)
        above.append(own + (above[link.parent] if link.parent >= 0 else 0))
        entries += own * above[-1]
    return entries <= MOST_ENTRIES and (tied or len(links) < LONG)


def _mass(links: Sequence[Link], sets: Sequence[Sequence[Inertia]], nv: int) -> ca.SX:
    return _matrix(cheapest([mass_matrix(links, inertias, nv) for inertias in sets]), nv, nv)


def _with_rotors(extra: Lagrangian, rotors: ca.SX, s: Symbols) -> Lagrangian:
    return replace(extra, M=extra.M + rotors, T=extra.T + 0.5 * ca.bilin(rotors, s.v, s.v))


def _entries(column: ca.SX) -> list[Scalar]:
    return [column[i] for i in range(column.numel())]


def _matrix(rows: Matrix, n: int, m: int) -> ca.SX:
    """Sparse: exact zeros are not stored."""
    result = ca.SX(n, m)
    for i, row in enumerate(rows):
        for j, x in enumerate(row):
            if not is_zero(x):
                result[i, j] = x
    return result


def _qdot(model: Model, s: Symbols) -> ca.SX:
    """N v, joint by joint; a coordinate of the analytic form has its own rate as generalized
    velocity."""
    rates: dict[str, Scalar] = {v.rate_of: s.names[v.name] for v in model.velocities if v.rate_of}
    for joint in model.joints:
        kind = joint_type(joint.type, joint.orientation, s.scalar(joint.pitch))
        if kind.parts:
            continue  # all its generalized velocities are rates of coordinates
        q = [s.names[name] for name in joint.coordinates]
        v = [s.names[name] for name in joint.velocities]
        rates |= dict(zip(joint.coordinates, kind.rates(q, v, s.vector(joint.axis))))
    return ca.vertcat(*[rates[c.name] for c in model.coordinates])


def inertial_forces(system: System, vdot: ca.SX) -> ca.SX:
    """M v̇ + h of the links alone, (nv × 1), by Newton–Euler: gravity is in it, but neither rotors
    nor the energies that a file gives by formula (M_extra, h_extra)."""
    return _column(
        joint_forces_of_motion(system.layouts, _entries(system.v), _entries(vdot), system.gravity)
    )


def _column(entries: Sequence[Scalar]) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)


def _told(scene: Scene, found: list[Block]) -> tuple[list[Block], tuple[ca.SX, ca.SX, ca.SX]]:
    """The blocks, and A, c and β, without what rounding left of rows that hold identically."""
    A, c, beta = _rows(scene, [row for block in found for row in block.ways[0]])
    cleared = without_rounding(scene, A)
    if cleared is A:
        return found, (A, c, beta)
    kept = silenced(scene, found, cleared)
    _, c, beta = _rows(scene, [row for block in kept for row in block.ways[0]])
    return kept, (cleared, c, beta)


def _rows(scene: Scene, rows: list[RowForm]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """A, c and β = −(d A/dt) v + dc/dt from the rows, over the generalized velocities."""
    nv, numbers = scene.symbols.v.numel(), scene.numbers if rows else []
    needed = {i for row in rows for term in row.terms for i in path(scene.links, term.link)}
    speeds, rates = _twist_forms(scene, numbers, needed)
    joints: dict[int, Form] = {j: {("v", j): 1.0} for j in range(nv)}
    A, c, beta = ca.SX(len(rows), nv), ca.SX.zeros(len(rows)), ca.SX.zeros(len(rows))
    for i, row in enumerate(rows):
        A[i, :] = _coefficients(scene, row, row_form(row, speeds, joints))
        moving = row_form(row, rates, joints).get(ONE, 0.0)
        c[i] = row.value
        # all of the row's rate but A v̇, on the other side
        beta[i] = row.rate - moving - row_products(row, numbers)
    return A, c, beta


def _coefficients(scene: Scene, row: RowForm, form: Form) -> ca.SX:
    """A row of A (1 × nv) from its form; where it speaks of many velocities by Jᵀ, the forces at
    the joints of a unit force along the row, which is handed down from link to link, where that
    takes fewer operations."""
    nv = scene.symbols.v.numel()
    known = [[form.get(("v", j), 0.0) for j in range(nv)]]
    if len(form) > DEEP_IN_PLANE:
        held = row_forces(row, scene.links, nv)
        known.append([held[j] if ("v", j) in form else 0.0 for j in range(nv)])
    return _matrix([cheapest(known)], 1, nv)


def _twist_forms(
    scene: Scene, numbers: list[Numbers], needed: set[int]
) -> tuple[dict[int, Twist], dict[int, Twist]]:
    """Twists and their rates over the generalized velocities, for the links that some row speaks of
    and what carries them."""
    speeds: dict[int, Twist] = {}
    rates: dict[int, Twist] = {}
    for i in sorted(needed):
        link = scene.links[i]
        above = (speeds[link.parent], rates[link.parent]) if link.parent >= 0 else (REST, REST)
        parent = numbers[link.parent] if link.parent >= 0 else REST_NUMBERS
        joint = joint_part(link, [{("v", j): 1.0} for j in link.columns])
        products = velocity_products(link, parent, [scene.symbols.v[j] for j in link.columns])
        speeds[i] = twist(link, parent_part(link, above[0]), joint)
        rates[i] = twist(link, with_products(parent_part(link, above[1]), products), joint)
    return speeds, rates


def _nonideal(scene: Scene, found: list[Block]) -> ca.SX:
    """The constraints' own generalised forces, given conjugate to q̇, carried over to v."""
    force = ca.SX.zeros(scene.symbols.q.numel())
    for block in found:
        if block.nonideal:
            # conjugate to q̇: power C · q̇ = C · N v makes it Nᵀ C over v
            force = force + ca.vertcat(*block.nonideal)
    return ca.mtimes(ca.jacobian(scene.qdot, scene.symbols.v).T, force)


def _is_definite(M: ca.SX, s: Symbols) -> bool:
    """Whether M has a Cholesky factor at a few random configurations with the default
    parameters."""
    if not M.size1():
        return True
    function = ca.Function("M", [s.t, s.q, s.p], [M])
    rng, p = np.random.default_rng(0), s.defaults
    trees = _uncoupled(M)
    drawn = (function(0.0, rng.normal(size=s.q.numel()), p) for _ in range(4))
    least = [min(_smallest_ratio(x[tree, tree].full()) for tree in trees) for x in drawn]
    return min(least) > REGULAR


def _uncoupled(M: ca.SX) -> list[list[int]]:
    """Velocities that share kinetic energy, those of one tree: no others are coupled by M."""
    count, order, starts = M.sparsity().scc()
    return [sorted(order[starts[k] : starts[k + 1]]) for k in range(count)]


def _smallest_ratio(M: np.ndarray) -> float:
    """Smallest eigenvalue of M scaled to a unit diagonal; 0 where a diagonal entry vanishes."""
    diagonal = np.diag(M)
    if not np.all(np.isfinite(M)) or np.any(diagonal <= 0):
        return 0.0
    scale = 1 / np.sqrt(diagonal)
    return float(np.linalg.eigvalsh(M * np.outer(scale, scale))[0])
