"""The numbers of a link in a loop: its frame with z on the joint axis, its placement
Rz(γ) Rx(α) Rz(β), and its inertia about the joint point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import difference, is_zero, matrix, product, transpose
from derive.mechanics.limits import EXACT
from derive.mechanics.links import moved
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.templates import Formula, Key, Shared

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """What a joint is like, in the link's frame: the axes of a twist that its velocities are along,
    which coordinate is an angle (−1 none), whether its orientation is a matrix of formulas, and the
    axis behind its placement along which each coordinate moves the origin (−1 none)."""

    axes: tuple[int, ...]
    angle: int
    turned: bool
    shifts: tuple[int, ...]

    @property
    def about(self) -> str:
        """In a word or two."""
        if len(self.axes) > 1:
            return f"{len(self.axes)} degrees of freedom"
        return "turning" if self.angle >= 0 else "sliding"


@dataclass(frozen=True)
class Sort:
    """What makes a kind: the joint, whether the link is a further child, and how its forces, rates
    and orientation are written."""

    shape: Shape
    further: bool
    keys: tuple[Key, ...]
    constants: tuple[int, ...]  # of each formula
    inputs: tuple[int, ...]
    push: Key | None  # what acts on the link by itself, whose constants and inputs come last


@dataclass(frozen=True)
class Row:
    """A link's values, in the order of `NAMES`, rotors, and then those of its formulas."""

    sort: Sort
    values: tuple[Scalar, ...]
    inputs: tuple[int, ...]


NAMES = (
    "sin_alpha", "cos_alpha", "sin_gamma", "cos_gamma", "px", "py", "pz", "offset", "sin_beta",
    "cos_beta", "m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz",
)  # fmt: skip


@dataclass(frozen=True)
class Own:
    """What belongs to a joint: its coordinates, what acts, and of a joint of several velocities the
    rates of the coordinates and an orientation that is no single angle, as formulas; and what acts
    on its link by itself."""

    q: tuple[int, ...]
    formulas: tuple[Formula, ...]
    rotors: tuple[Scalar, ...]
    push: Shared | None = None


def row_of(
    system: System, i: int, frames: Sequence[Array], ground: Array, own: Own, first: bool
) -> Row:
    """Of link i; `first` says whether it is what its parent carries most directly."""
    links = system.links
    link, F = links[i], frames[i]
    P = frames[link.parent] if link.parent >= 0 else ground
    # the frame of a link with several velocities is turned towards none of its children
    further = not first or (link.parent >= 0 and len(links[link.parent].columns) > 1)
    placed = P.T @ placement(link) @ F
    alpha, beta, gamma = _angles(placed, not further)
    behind = links[link.parent].b if link.parent >= 0 else [0.0, 0.0, 0.0]
    q = [system.q[k] for k in own.q]
    start, moves = _origin(link, q)
    arm = _within(P, difference(start, behind))
    shape = _shape(link, F, q, P @ placed, moves)
    offset = 0.0
    if shape.angle >= 0 and len(shape.axes) == 1:  # the turn before it is about the same axis
        offset, beta = float(np.arctan2(*beta)), (0.0, 1.0)
    body = _inertia(link, F)
    values: list[Scalar] = [
        *alpha, *gamma, *arm, offset, *beta, body.mass, *body.moment,
        *(body.tensor[a][b] for a in range(3) for b in range(a, 3)),
        *map(plain, own.rotors), *(plain(x) for of in own.formulas for x in of.constants),
        *map(plain, own.push.constants if own.push else ()),
    ]  # fmt: skip
    keys = tuple(of.key for of in own.formulas)
    counts = tuple(len(of.constants) for of in own.formulas)
    inputs = tuple(len(of.inputs) for of in own.formulas)
    push = own.push.key if own.push else None
    sort = Sort(shape, further, keys, counts, inputs, push)
    taken = [k for of in own.formulas for k in of.inputs]
    return Row(sort, tuple(values), (*taken, *(own.push.inputs if own.push else ())))


def _origin(link: Link, q: Sequence[ca.SX]) -> tuple[Vector, Array]:
    """The joint point in the parent's frame where the coordinates are zero, and by column how each
    of them moves it."""
    a = ca.SX(ca.vertcat(*link.a))
    symbols = ca.vertcat(*q)
    if not ca.depends_on(a, symbols):
        return link.a, np.zeros((3, len(q)))
    slopes = ca.jacobian(a, symbols)
    if not slopes.is_constant():
        raise AssumptionError(f"{link.name} does not move along straight lines")
    start = ca.substitute(a, symbols, ca.SX.zeros(len(q)))
    return [plain(x) for x in ca.vertsplit(start)], np.array(ca.DM(slopes))


def _shape(link: Link, F: Array, q: Sequence[ca.SX], placed: Array, moves: Array) -> Shape:
    """Of the joint; `placed` is parent ← frame at zero, `moves` where its coordinates move the
    origin, in the parent's axes."""
    if len(link.columns) == 1:
        slides = all(is_zero(x) for x in link.motion[0][:3])
        return Shape((5,), -1, False, (2,)) if slides else Shape((2,), 0, False, (-1,))
    axes = tuple(_one_of(np.kron(np.eye(2), F.T) @ twist, link) for twist in twists(link))
    place = _joint_factor(link)
    factor = link.rotation[place] if place >= 0 else None
    angle = -1
    if isinstance(factor, Turn):
        angle = _angle(factor, link.rotation[place + 1 :], F, q, link)
    along = placed.T @ moves
    shifts = tuple(_one_of(x, link) if np.any(x) else -1 for x in along.T)
    return Shape(axes, angle, isinstance(factor, Still), shifts)


def _angle(factor: Turn, behind: Rotation, F: Array, q: Sequence[ca.SX], link: Link) -> int:
    """Which coordinate the frame is turned by about its z."""
    joint = _numbers(matrix(behind), f"the orientation of {link.name}") @ F
    along = (joint.T @ np.array(factor.axis))[2]
    slopes = ca.jacobian(ca.SX(factor.angle), ca.vertcat(*q)) * along
    found = [k for k in range(len(q)) if not is_zero(slopes[k])]
    if len(found) != 1 or abs(number(slopes[found[0]], "an angle") - 1.0) > EXACT:
        raise AssumptionError(f"{link.name} does not turn at right angles to where it moves")
    return found[0]


def _one_of(x: Array, link: Link) -> int:
    """Which axis of a frame a unit vector is along."""
    (places,) = np.nonzero(np.abs(x) > EXACT)
    if len(places) != 1 or abs(x[places[0]] - 1.0) > EXACT:
        raise AssumptionError(f"the axes of {link.name} are not at right angles")
    return int(places[0])


def _within(frame: Array, x: Vector) -> Vector:
    """Components along the columns of a frame."""
    return [_sum([(float(c), e) for c, e in zip(column, x)]) for column in frame.T]


def _sum(terms: Sequence[tuple[float, Scalar]]) -> Scalar:
    total: Scalar = 0.0
    for c, x in terms:
        if c and not is_zero(x):
            total = total + c * x
    return plain(total)


def _inertia(link: Link, frame: Array) -> Inertia:
    """About the joint point, along the frame."""
    about = moved(link.inertia, (), [-x for x in link.b])
    seen = moved(about, (Still(frame.T.tolist()),), [0.0, 0.0, 0.0])
    tensor: Matrix = [[plain(x) for x in row] for row in seen.tensor]
    return Inertia(plain(seen.mass), [plain(x) for x in seen.moment], tensor)


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
    return exact(sine / length), exact(cosine / length)


# ---- frames


def frames_of(links: Sequence[Link], order: Sequence[int]) -> tuple[list[Array], Array]:
    """Link ← frame for each link, and ground ← frame: z is on the axis of a joint with one
    velocity, and each velocity of another joint is along an axis."""
    own = {i: _principal(links[i]) for i in order if len(links[i].columns) > 1}
    axes = [own[i][:, 2] if i in own else _axis(link) for i, link in enumerate(links)]
    first: dict[int, int] = {}
    for i in reversed(order):
        first[links[i].parent] = i
    for n, i in enumerate(order):
        if n + 1 < len(order) and links[order[n + 1]].parent == i:
            first[i] = order[n + 1]
    first[-1] = order[0]

    def frame(i: int, z: Array) -> Array:
        if i in own:
            return own[i]
        if i not in first:
            return _frame(z, z)
        child = links[first[i]]
        return _frame(z, placement(child) @ axes[first[i]])

    return [frame(i, z) for i, z in enumerate(axes)], frame(-1, np.array([0.0, 0.0, 1.0]))


def _frame(z: Array, following: Array) -> Array:
    """Columns x, y, z with x perpendicular to both axes; some x where they are parallel."""
    x = np.cross(z, following)
    if np.linalg.norm(x) < EXACT:
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    for _ in range(2):  # what rounding leaves along z is large where the axes are nearly parallel
        x = x / np.linalg.norm(x)
        x = x - z * (x @ z)
    x = np.array([exact(e) for e in x / np.linalg.norm(x)])
    return np.column_stack([x, np.cross(z, x), z])


def _principal(link: Link) -> Array:
    """Columns along which the velocities of a joint are, right-handed."""
    found: list[Array] = []
    for twist in twists(link):
        direction = twist[:3] + twist[3:]
        if not any(np.allclose(direction, known, atol=EXACT) for known in found):
            found.append(direction)
    if len(found) == 2:
        found.append(np.cross(found[0], found[1]))
    frame = np.column_stack(found)
    if frame.shape != (3, 3) or np.abs(frame.T @ frame - np.eye(3)).max() > EXACT:
        raise AssumptionError(f"the axes of {link.name} are not at right angles")
    return frame if np.linalg.det(frame) > 0.0 else frame[:, [1, 0, 2]]


def twists(link: Link) -> list[Array]:
    """By velocity the relative twist at the joint point, angular first, in the link's axes; each
    turns or slides."""
    found = [
        np.array([number(x, f"the axis of {link.name}") for x in motion]) for motion in link.motion
    ]
    if any(np.any(twist[:3]) and np.any(twist[3:]) for twist in found):
        raise AssumptionError(f"{link.name} turns and slides at once")
    return found


def _axis(link: Link) -> Array:
    """Of a joint with one velocity, in the link's frame."""
    (twist,) = twists(link)
    return twist[:3] + twist[3:]


def orientation(link: Link, frame: Array) -> Matrix | None:
    """What the joint turns the frame by, where that is no single angle."""
    place = _joint_factor(link)
    if place < 0 or isinstance(link.rotation[place], Turn):
        return None
    behind = matrix(link.rotation[place + 1 :])
    joint = _numbers(behind, f"the orientation of {link.name}") @ frame  # joint's axes ← frame
    exactly: Matrix = [[exact(x) for x in row] for row in joint.tolist()]
    return product(product(transpose(exactly), matrix((link.rotation[place],))), exactly)


def placement(link: Link) -> Array:
    """Parent ← link where the joint does not turn."""
    place = _joint_factor(link)
    still = tuple(f for k, f in enumerate(link.rotation) if k != place)
    return _numbers(matrix(still), f"the orientation of {link.name}")


def _joint_factor(link: Link) -> int:
    """Which factor of the rotation coordinates are in; −1 none."""
    found = [k for k, f in enumerate(link.rotation) if isinstance(f, Turn)]
    if len(link.columns) > 1:
        found += [k for k, f in enumerate(link.rotation) if isinstance(f, Still) and not _fixed(f)]
    if len(found) > 1:
        raise AssumptionError(f"the orientation of {link.name} is no angle and no quaternion")
    return found[0] if found else -1


def _fixed(factor: Still) -> bool:
    return all(not isinstance(x, ca.SX) or x.is_constant() for row in factor.matrix for x in row)


# ---- numbers


def _numbers(rows: Sequence[Sequence[Scalar]], what: str) -> Array:
    return np.array([[number(x, what) for x in row] for row in rows])


def number(x: Scalar, what: str) -> float:
    """The number that `what` is. Raises AssumptionError where parameters are in it."""
    if isinstance(x, ca.SX) and not x.is_constant():
        raise AssumptionError(f"{what} is a parameter; `--constants` bakes it in")
    return float(x)


def exact(x: float) -> float:
    """An integer where rounding alone keeps it from being one."""
    nearest = float(round(x))
    return nearest if abs(x - nearest) < EXACT else float(x)


def plain(x: Scalar) -> Scalar:
    """A float where it is a number."""
    return float(x) if isinstance(x, ca.SX) and x.is_constant() else x
