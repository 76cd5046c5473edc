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
from derive.joints.rotations import difference, is_zero, matrix
from derive.mechanics.limits import EXACT
from derive.mechanics.links import moved
from derive.mechanics.records import Inertia, Link
from derive.mechanics.templates import Formula, Key

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sort:
    """What makes a kind: the joint, whether the link is a further child, and how its force is
    written."""

    slides: bool
    further: bool
    force: Key
    constants: int
    inputs: int


@dataclass(frozen=True)
class Row:
    """A link's values, in the order of `NAMES` and then those of its force."""

    sort: Sort
    values: tuple[Scalar, ...]
    inputs: tuple[int, ...]


NAMES = (
    "sin_alpha", "cos_alpha", "sin_gamma", "cos_gamma", "px", "py", "pz", "offset", "sine",
    "cosine", "m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "rotor",
)  # fmt: skip


@dataclass(frozen=True)
class Own:
    """What acts at a joint."""

    force: Formula
    rotor: Scalar
    q: ca.SX


def row_of(
    links: Sequence[Link], i: int, frames: Sequence[Array], ground: Array, own: Own, first: bool
) -> Row:
    """Of link i; `first` says whether it is what its parent carries most directly."""
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
        plain(own.rotor), *map(plain, own.force.constants),
    ]  # fmt: skip
    force = own.force
    sort = Sort(slides, not first, force.key, len(force.constants), len(force.inputs))
    return Row(sort, tuple(values), force.inputs)


def _start(link: Link, q: ca.SX, slides: bool) -> Vector:
    """The joint point in the parent's frame where the coordinate is zero."""
    if not slides:
        return link.a
    return [plain(ca.substitute(ca.SX(x), q, 0.0)) for x in link.a]


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
    x = np.array([exact(e) for e in x / np.linalg.norm(x)])
    return np.column_stack([x, np.cross(z, x), z])


def _axis(link: Link) -> Array:
    """Of the joint, in the link's frame."""
    motion = link.motion[0]
    part = motion[:3] if any(not is_zero(x) for x in motion[:3]) else motion[3:]
    return np.array([number(x, f"the axis of {link.name}") for x in part])


def _placed(link: Link) -> Array:
    """Parent ← link where the coordinate is zero."""
    return _numbers(matrix(_at_zero(link.rotation)), f"the orientation of {link.name}")


def _at_zero(rotation: Rotation) -> Rotation:
    return tuple(f if isinstance(f, Still) else Turn(f.axis, 0.0) for f in rotation)


# ---- numbers


def _numbers(rows: Sequence[Sequence[Scalar]], what: str) -> Array:
    return np.array([[number(x, what) for x in row] for row in rows])


def number(x: Scalar, what: str) -> float:
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
