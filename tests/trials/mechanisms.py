"""Random mechanisms through the front door: written as YAML, built by `hamel build`, judged by
mechanics that share nothing with hamel.

Each mechanism is a tree of joints in a random pose; closures and constraints are put where the pose
meets them. From positions and rotations of the bodies alone (`Mechanism.frames`) follow by
differences: the constraints' Jacobian A and its rank, the velocities and accelerations along a
short motion of the generated module, and with them d'Alembert's principle: for every admissible
virtual velocity  Σ m a·δv + Ḣ·δω = power of all forces.
"""

from __future__ import annotations

import itertools
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import environment
import numpy as np
from environment import Ends, Outcome, Record, complaint, python

Array = np.ndarray
Frame = tuple[Array, Array]  # rotation, origin
# coordinates of each joint; their order, and that of what follows, belongs to the seeds
SIZES = {
    "revolute": 1, "prismatic": 1, "screw": 1, "cylindrical": 2, "universal": 2, "ball": 4,
    "planar": 3, "free": 7, "fixed": 0,
}  # fmt: skip
BY_ANGLES = "ball by angles"  # every other ball turns by Euler angles
SPACE, PLANE = tuple(SIZES), ("revolute", "prismatic", "planar")
SIZES[BY_ANGLES] = 3
SPACE_LOOPS = tuple(kind for kind in SPACE if kind != "free")
PLANE_LOOPS = ("revolute", "prismatic", "fixed")
MEETINGS = ("distance", "point_on_surface", "no_slip", "rolling", "coupling", "prescribed")
ONE = ("revolute", "prismatic", "screw")
SECTIONS = ("bodies", "joints", "closures", "constraints", "loads")
AROUND = (-2, -1, 1, 2)
STEP = 1e-3  # s, between the points of the motion that is differentiated
CLOSE = 2e-6  # of fourth-order differences over STEP; a wrong sign or term errs by 1e-2 and more
SINGULAR = 1e-4  # σ_min/σ_max of A below which a refusal for a singular position is true
AGREE = 1e-4  # m, between motions of one second with different enforcement, rtol 1e-9
FEW = ("dynamics", "energy", "power")  # functions of a module that are compared
RATES = ("tangent", "feedback", "baumgarte")  # enforcements
LIMIT = 600.0  # seconds for one mechanism


def rotation(axis: Array, angle: float) -> Array:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rpy(angles: Array) -> Array:
    x, y, z = (rotation(np.eye(3)[i], angle) for i, angle in enumerate(angles))
    return z @ y @ x


def of_quaternion(w: float, x: float, y: float, z: float) -> Array:
    length = np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def after(a: Frame, b: Frame) -> Frame:
    return a[0] @ b[0], a[1] + a[0] @ b[1]


def inverse(a: Frame) -> Frame:
    return a[0].T, -a[0].T @ a[1]


def skew(Q: Array) -> Array:
    return np.array([Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]]) / 2


def slope(values: Sequence[Any], h: float) -> Array:
    """The derivative in the middle of values at -2, -1, 1 and 2 times h, to fourth order."""
    return np.tensordot(np.array([1, -8, 8, -1]) / (12 * h), np.array(values), 1)


def across(axis: Array) -> Array:
    """A unit vector at right angles."""
    x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return x / np.linalg.norm(x)


@dataclass
class Joint:
    kind: str
    parent: int  # -1: the ground
    before: Frame
    behind: Frame
    axis: Array
    axis2: Array
    pitch: float
    first: int  # of its coordinates

    def moved(self, q: Array) -> Frame:
        """The child's frame seen from the parent's, both at the joint."""
        a, zero, one = self.axis, np.zeros(3), np.eye(3)
        match self.kind:
            case "revolute":
                return rotation(a, q[0]), zero
            case "prismatic":
                return one, q[0] * a
            case "screw":
                return rotation(a, q[0]), self.pitch * q[0] / (2 * np.pi) * a
            case "cylindrical":
                return rotation(a, q[0]), q[1] * a
            case "universal":
                return rotation(a, q[0]) @ rotation(self.axis2, q[1]), zero
            case "ball":
                return of_quaternion(*q), zero
            case "ball by angles":
                return rpy(q[::-1]), zero  # zyx: about axes that turn along
            case "planar":
                return rotation(one[2], q[2]), np.array([q[0], q[1], 0])
            case "free":
                return of_quaternion(*q[3:]), q[:3]
        return one, zero


Residual = Callable[[list[Frame], Array, float], Array]  # of frames, q, t
Rate = Callable[
    [list[Frame], Array, Array, Array], Array
]  # of frames, v, ω of the bodies' origins, q̇
Power = Callable[["Motion"], Array]  # of every virtual velocity


@dataclass
class Motion:
    """A short motion of the module about one instant, and the admissible virtual velocities
    there."""

    frames: list[Frame]
    q: Array
    rates: Array
    origins: Array  # virtual velocities of the bodies' origins, (virtual, body, 3)
    turns: Array
    virtual: Array  # of q


@dataclass
class Mechanism:
    """While it grows; `text` is what hamel gets."""

    rng: np.random.Generator
    planar: bool
    name: str
    joints: list[Joint] = field(default_factory=list)
    masses: list[tuple[float, Array, Array]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    pose: Array = field(default_factory=lambda: np.zeros(0))
    lines: dict[str, dict] = field(default_factory=lambda: {name: {} for name in SECTIONS})
    residuals: list[Residual] = field(default_factory=list)
    rates: list[Rate] = field(default_factory=list)
    powers: list[Power] = field(default_factory=list)
    gravity: Array = field(default_factory=lambda: np.zeros(3))

    # ---- forms of the file -----------------------------------------------------------------------

    def vector(self, x: Array) -> list[float]:
        return [float(e) for e in x[: 2 if self.planar else 3]]

    def place(self, at: Frame) -> dict:
        turned = (
            {"angle": float(np.arctan2(at[0][1, 0], at[0][0, 0]))}
            if self.planar
            else {"matrix": at[0].tolist()}
        )
        return {"position": self.vector(at[1])} | turned

    @property
    def text(self) -> str:
        guess = dict(zip(self.names, map(float, self.pose), strict=True))
        plane = {"plane": "xy"} if self.planar else {}
        sizes = {"amplitude": "0.2 rad", "stroke": "0.2 m", "rate": "1.5 rad/s"}
        start = {"gravity": self.vector(self.gravity), "parameters": sizes}
        lines = {k: v for k, v in self.lines.items() if v} | {"initial": {"guess": guess}}
        return json.dumps({"model": self.name} | plane | start | lines, indent=1)

    # ---- random parts ----------------------------------------------------------------------------

    def axes(self, kind: str, axis: Array, axis2: Array, pitch: float) -> dict:
        """What the file says of the axes of a joint or closure."""
        turning = self.planar and kind != "prismatic"
        none = turning or kind in ("ball", BY_ANGLES, "free", "planar", "fixed")
        entry: dict = {} if none else {"axis": self.vector(axis)}
        more = {"universal": {"axis2": self.vector(axis2)}, "screw": {"pitch": pitch}}
        return entry | more.get(kind, {})

    def any_frame(self) -> Frame:
        point = self.rng.uniform(-0.4, 0.4, 3) * (np.array([1, 1, 0]) if self.planar else 1)
        if self.rng.random() < 0.4:
            return np.eye(3), point
        angles = self.rng.uniform(-1, 1, 3) * (np.array([0, 0, 1]) if self.planar else 1)
        return rpy(angles), point

    def any_axis(self, kind: str) -> Array:
        if kind == "planar" or (self.planar and kind != "prismatic"):
            return np.array([0, 0, 1.0])
        x = self.rng.normal(size=3) * (np.array([1, 1, 0]) if self.planar else 1)
        if self.rng.random() < 0.5:
            return np.eye(3)[int(self.rng.integers(2 if self.planar else 3))]
        return x / np.linalg.norm(x)

    def grow(self, kind: str, parent: int) -> None:
        """One more body on a joint."""
        rng, i = self.rng, len(self.joints)
        size, by_angles = SIZES[kind], kind == "ball" and i % 2 == 1
        axis, before, behind = self.any_axis(kind), self.any_frame(), self.any_frame()
        pitch, first = float(rng.uniform(-0.5, 0.5)), len(self.names)
        named = BY_ANGLES if by_angles else kind
        joint = Joint(named, parent, before, behind, axis, across(axis), pitch, first)
        self.joints.append(joint)
        q = rng.uniform(-0.8, 0.8, size)
        if kind in ("ball", "free"):
            quaternion = rng.normal(size=4)
            q[-4:] = q[-4:] if by_angles else quaternion / np.linalg.norm(quaternion)
        q = q[:3] if by_angles else q
        self.pose = np.append(self.pose, q)
        own = (
            kind in ONE and rng.random() < 0.1
        )  # the coordinate is left out: it has the joint's name
        names = [f"J{i}"] if own else [f"q{i}_{k}" for k in range(len(q))]
        self.names += names
        self.lines["bodies"][f"b{i}"] = self._body()
        self.lines["joints"][f"J{i}"] = self._joint(joint, f"b{i}", [] if own else names)

    def _body(self) -> dict:
        points, masses = self.rng.uniform(-0.3, 0.3, (5, 3)), self.rng.uniform(0.1, 1.0, 5)
        com = masses @ points / masses.sum() * (np.array([1, 1, 0]) if self.planar else 1)
        points = points - masses @ points / masses.sum()
        I = sum(
            m * ((r @ r) * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, points, strict=True)
        )
        self.masses.append((float(masses.sum()), com, I))
        six = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
        inertia = float(I[2, 2]) if self.planar else [float(x) for x in six]
        return {"mass": float(masses.sum()), "com": self.vector(com), "inertia": inertia}

    def _joint(self, joint: Joint, child: str, names: list[str]) -> dict:
        entry: dict = {
            "type": joint.kind,
            "parent": "ground" if joint.parent < 0 else f"b{joint.parent}",
            "child": child,
        }
        entry["at"] = {"parent": self.place(joint.before), "child": self.place(joint.behind)}
        entry |= self.axes(joint.kind, joint.axis, joint.axis2, joint.pitch)
        if joint.kind == "free":
            return entry | {"position": names[:3], "orientation": {"quaternion": names[3:]}}
        if joint.kind == BY_ANGLES:
            turned = {"euler": "zyx", "angles": names}
            return entry | {"type": "ball", "orientation": turned}
        if not names:
            return entry
        return entry | ({"coordinate": names[0]} if joint.kind in ONE else {"coordinates": names})

    # ---- its own mechanics -----------------------------------------------------------------------

    def frames(self, q: Array) -> list[Frame]:
        done: list[Frame] = []
        ground = (np.eye(3), np.zeros(3))
        for joint in self.joints:
            moved = joint.moved(q[joint.first : joint.first + SIZES[joint.kind]])
            parent = ground if joint.parent < 0 else done[joint.parent]
            done.append(after(after(after(parent, joint.before), moved), inverse(joint.behind)))
        return done

    def of(self, frames: list[Frame], body: int) -> Frame:
        return (np.eye(3), np.zeros(3)) if body < 0 else frames[body]

    def residual(self, q: Array, t: float = 0.0) -> Array:
        frames = self.frames(q)
        return np.concatenate([np.zeros(0), *(r(frames, q, t) for r in self.residuals)])

    def along(self, q: Array, rates: Array) -> tuple[list[Array], float]:
        """Coordinates about q along q̇, and the time between them."""
        h = STEP / max(1.0, float(np.abs(rates).max(initial=0)))
        return [q + k * h * rates for k in AROUND], h

    def twists(self, q: Array, rates: Array) -> tuple[Array, Array]:
        """Velocities of the bodies' origins and angular velocities, by differences along q̇."""
        places, h = self.along(q, rates)
        frames = [self.frames(place) for place in places]
        origins = slope([[p for _, p in frame] for frame in frames], h)
        turned = slope([[R for R, _ in frame] for frame in frames], h)
        spins = [skew(D @ R.T) for D, (R, _) in zip(turned, self.frames(q), strict=True)]
        return origins, np.array(spins)

    def constraint_rates(self, q: Array, rates: Array) -> Array:
        """Of holonomic rows at constant t, and of the others, along q̇."""
        places, h = self.along(q, rates)
        moved = slope([self.residual(place) for place in places], h)
        v, omega = self.twists(q, rates)
        others = [rate(self.frames(q), v, omega, rates) for rate in self.rates]
        return np.concatenate([moved, *others])

    def tangents(self, q: Array) -> Array:
        """q̇ of every freedom of the tree: unit vectors, and three for each quaternion."""
        columns: list[Array] = []
        for joint in self.joints:
            size = SIZES[joint.kind]
            block = np.eye(size)
            if joint.kind in ("ball", "free"):
                w, x, y, z = q[joint.first + size - 4 : joint.first + size]
                G = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
                block = np.block(
                    [[np.eye(size - 4), np.zeros((size - 4, 3))], [np.zeros((4, size - 4)), G]]
                )
            for column in block.T:
                columns.append(np.zeros(len(q)))
                columns[-1][joint.first : joint.first + size] = column
        return np.array(columns)

    def rank(self, q: Array) -> tuple[int, int, float]:
        """Freedoms, rank of A, and the least of its singular values that count, relative to the
        largest. Rows of lengths near 1 that are nothing but rounding do not count."""
        columns = self.tangents(q)
        A = np.array([self.constraint_rates(q, column) for column in columns]).T
        sizes = np.linalg.svd(A, compute_uv=False) if A.size else np.zeros(0)
        counted = sizes[sizes > max(1e-8 * sizes[0], 1e-12)] if sizes.size else sizes
        return len(columns), len(counted), float(counted[-1] / counted[0]) if counted.size else 1.0

    def can_drift(self) -> bool:
        """Whether there are position constraints that say something."""
        if not self.residuals:
            return False
        count = len(self.residual(self.pose))
        columns = [self.constraint_rates(self.pose, x)[:count] for x in self.tangents(self.pose)]
        return bool(np.linalg.norm(columns) > 1e-8)

    # ---- what is put into the pose ---------------------------------------------------------------

    def close(self, kind: str, one: int, other: int) -> None:
        name, frames = f"C{len(self.lines['closures'])}", self.frames(self.pose)
        axis = self.any_axis(kind)
        first = self.any_frame()
        second = after(inverse(self.of(frames, other)), after(self.of(frames, one), first))
        axis2, pitch = across(axis), float(self.rng.uniform(0.1, 0.5))
        self.lines["closures"][name] = {
            "type": kind,
            "between": [self.called(one), self.called(other)],
            "at": [self.place(first), self.place(second)],
        } | self.axes(kind, axis, axis2, pitch)

        def residual(frames: list[Frame], q: Array, t: float) -> Array:
            R1, p1 = after(self.of(frames, one), first)
            R2, p2 = after(self.of(frames, other), second)
            return loop(kind, R1.T @ (p2 - p1), R1.T @ R2, axis, axis2, pitch)

        self.residuals.append(residual)

    def called(self, body: int) -> str:
        return "ground" if body < 0 else f"b{body}"

    def meet(self, kind: str, one: int, other: int) -> None:
        name = f"K{len(self.lines['constraints'])}"
        entry = getattr(self, f"_{kind}")(one, other)
        if entry:
            self.lines["constraints"][name] = {"type": kind} | entry

    def any_points(self) -> tuple[Array, Array]:
        return self.any_frame()[1], self.any_frame()[1]

    def _distance(self, one: int, other: int) -> dict:
        a, b = self.any_points()

        def between(frames: list[Frame]) -> float:
            ends = [
                R @ x + p for x, (R, p) in ((a, self.of(frames, one)), (b, self.of(frames, other)))
            ]
            return float(np.linalg.norm(ends[1] - ends[0]))

        length = between(self.frames(self.pose))
        self.residuals.append(lambda frames, q, t: np.array([between(frames) - length]))
        return {
            "between": [self.called(one), self.called(other)],
            "at": [self.vector(a), self.vector(b)],
            "length": length,
        }

    def _point_on_surface(self, one: int, other: int) -> dict:
        a, _ = self.any_points()
        weights = self.rng.uniform(0.5, 2, 3) * (np.array([1, 1, 0]) if self.planar else 1)

        def value(frames: list[Frame]) -> float:
            (R, p), (S, o) = self.of(frames, one), self.of(frames, other)
            return float(weights @ (S.T @ (R @ a + p - o)) ** 2)

        rest = value(self.frames(self.pose))
        self.residuals.append(lambda frames, q, t: np.array([value(frames) - rest]))
        terms = " + ".join(
            f"{w!r}*{x}^2" for w, x in zip(map(float, weights), "xy" if self.planar else "xyz")
        )
        return {
            "body": self.called(one),
            "at": self.vector(a),
            "surface": f"{terms} - {rest!r} m^2",
            "of": self.called(other),
        }

    def _no_slip(self, one: int, other: int) -> dict:
        a, _ = self.any_points()
        direction = self.any_axis("prismatic")

        def rate(frames: list[Frame], v: Array, omega: Array, rates: Array) -> Array:
            R = frames[one][0]
            return np.array([(R @ direction) @ (v[one] + np.cross(omega[one], R @ a))])

        self.rates.append(rate)
        return {"body": self.called(one), "at": self.vector(a), "direction": self.vector(direction)}

    def _rolling(self, one: int, other: int) -> dict | None:
        """A sphere, or a disk, on a plane that it touches in the pose."""
        if self.planar:
            return None
        a, _ = self.any_points()
        normal, spin, radius = (
            self.any_axis("ball"),
            self.any_axis("ball"),
            float(self.rng.uniform(0.2, 0.5)),
        )
        disk = bool(self.rng.random() < 0.5)

        def touch(frames: list[Frame]) -> Array:
            """From the origin of the body to the point that touches."""
            R, e = frames[one][0], frames[one][0] @ spin
            down = -(normal - (normal @ e) * e)
            return R @ a + radius * (down / np.linalg.norm(down) if disk else -normal)

        start = self.frames(self.pose)
        origin = start[one][1] + touch(start)
        self.residuals.append(
            lambda frames, q, t: np.array([normal @ (frames[one][1] + touch(frames) - origin)])
        )
        self.rates.append(
            lambda frames, v, omega, rates: v[one] + np.cross(omega[one], touch(frames))
        )
        shape = (
            {"disk": {"radius": radius, "axis": self.vector(spin)}}
            if disk
            else {"sphere": {"radius": radius}}
        )
        plane = {"normal": self.vector(normal), "origin": self.vector(origin)}
        return {"body": self.called(one), "at": self.vector(a), "shape": shape, "plane": plane}

    def _hinged(self) -> list[Joint]:
        return [joint for joint in self.joints if joint.kind in ONE]

    def _coupling(self, one: int, other: int) -> dict | None:
        hinged = [j for j in self._hinged() if j.kind == "revolute"]
        if len(hinged) < 2:
            return None
        i, j = (joint.first for joint in hinged[:2])
        ratio = float(self.rng.uniform(1.5, 2.5))
        offset = float(self.pose[i] - ratio * self.pose[j])
        self.residuals.append(lambda frames, q, t: np.array([q[i] - ratio * q[j] - offset]))
        return {"coordinates": [self.names[i], self.names[j]], "ratio": ratio, "offset": offset}

    def _prescribed(self, one: int, other: int) -> dict | None:
        hinged = self._hinged()
        if not hinged or self.lines["constraints"] or self.lines["closures"]:
            return None  # other rows may tie the same coordinate, and then nothing could meet both
        i, slides = hinged[0].first, hinged[0].kind == "prismatic"
        start = float(self.pose[i])
        self.residuals.append(lambda frames, q, t: np.array([q[i] - start - 0.2 * np.sin(1.5 * t)]))
        unit, size = ("m", "stroke") if slides else ("rad", "amplitude")
        motion = f"{start!r} {unit} + {size}*sin(rate*t)"
        return {"coordinate": self.names[i], "motion": motion}

    def load(self, kind: str, body: int) -> None:
        name, x = f"F{len(self.lines['loads'])}", [float(e) for e in self.rng.uniform(-2, 2, 3)]
        hinged = self._hinged()
        if kind in ("spring", "damper") and hinged:
            self._at_joint(kind, name, hinged[-1].first)
        elif kind in ("force", "torque"):
            self._on_body(kind, name, body, np.array(x))

    def _at_joint(self, kind: str, name: str, i: int) -> None:
        k = float(self.rng.uniform(0.2, 2))
        spring = kind == "spring"
        entry = {"stiffness": k, "rest": 0.3} if spring else {"coefficient": k}
        self.lines["loads"][name] = {"type": kind, "coordinate": self.names[i]} | entry
        self.powers.append(
            lambda m: -k * ((m.q[i] - 0.3) if spring else m.rates[i]) * m.virtual[:, i]
        )

    def _on_body(self, kind: str, name: str, body: int, x: Array) -> None:
        turned, at = bool(self.rng.random() < 0.5), self.any_points()[0]
        x = x * (
            np.array([0, 0, 1])
            if self.planar and kind == "torque"
            else np.array([1, 1, 0])
            if self.planar
            else 1
        )
        entry: dict = {
            "type": kind,
            "body": self.called(body),
            "frame": "body" if turned else "ground",
        }
        entry |= {"at": self.vector(at)} if kind == "force" else {}
        self.lines["loads"][name] = entry | {
            "components": float(x[2]) if self.planar and kind == "torque" else self.vector(x)
        }

        def power(m: Motion) -> Array:
            R = m.frames[body][0]
            y = R @ x if turned else x
            return (
                m.turns[:, body] @ y
                if kind == "torque"
                else m.origins[:, body] @ y + m.turns[:, body] @ np.cross(R @ at, y)
            )

        self.powers.append(power)


def loop(kind: str, d: Array, Q: Array, axis: Array, axis2: Array, pitch: float) -> Array:
    """What a closure keeps at zero: d is the second frame's origin and Q its rotation, seen from
    the first."""
    u = across(axis)
    w = np.cross(axis, u)
    sides, tilt = np.array([u @ d, w @ d]), np.array([u @ Q @ axis, w @ Q @ axis])
    match kind:
        case "revolute":
            return np.concatenate([d, tilt])
        case "prismatic":
            return np.concatenate([sides, skew(Q)])
        case "screw":
            angle = np.arctan2(w @ Q @ u - u @ Q @ w, u @ Q @ u + w @ Q @ w)
            left = axis @ d - pitch * angle / (2 * np.pi)
            left -= pitch * np.round(left / pitch)  # whole turns are no angle's
            return np.concatenate([sides, tilt, [left]])
        case "cylindrical":
            return np.concatenate([sides, tilt])
        case "universal":
            return np.concatenate([d, [axis @ Q @ axis2]])
        case "planar":
            return np.concatenate([[axis @ d], tilt])
        case "fixed":
            return np.concatenate([d, skew(Q)])
    return d


def mechanism(seed: int) -> Mechanism:
    """The same one for the same seed: one to four bodies, closures and constraints that leave a
    freedom."""
    rng = np.random.default_rng(seed)
    made = Mechanism(rng, planar=seed % 4 == 0, name=f"random{seed}")
    kinds = PLANE if made.planar else SPACE
    for i in range(int(rng.choice([1, 2, 2, 3, 3, 4]))):
        made.grow(str(rng.choice(kinds)), int(rng.integers(-1, i)) if i else -1)
    if not len(made.pose):
        made.grow("revolute", -1)
    made.gravity = rng.uniform(-9, 9, 3) * (np.array([1, 1, 0]) if made.planar else 1)
    bodies = len(made.joints)
    closures = PLANE_LOOPS if made.planar else SPACE_LOOPS
    for add, wanted in ((made.close, closures), (made.meet, MEETINGS)):
        for kind in rng.choice(
            wanted, int(rng.choice([0, 1, 1, 2] if add == made.meet else [0, 1, 1]))
        ):
            one, other = int(rng.integers(bodies)), int(rng.integers(-1, bodies))
            _try(made, add, str(kind), one, other)
    for kind in rng.choice(["spring", "damper", "force", "torque"], int(rng.integers(0, 3))):
        made.load(str(kind), int(rng.integers(bodies)))
    return made


def _try(made: Mechanism, add: Callable, kind: str, one: int, other: int) -> None:
    """Add a closure or constraint, unless no freedom would be left or it holds two bodies that
    cannot move apart."""
    if one == other:
        other = -1
    counts = {name: len(rows) for name, rows in made.lines.items()}
    before, residuals, rates = made.rank(made.pose), len(made.residuals), len(made.rates)
    add(kind, one, other)
    total, rank, _ = made.rank(made.pose)
    if rank in (before[1], total):  # nothing new, or nothing left
        del made.residuals[residuals:], made.rates[rates:]
        for name, rows in made.lines.items():
            for key in list(rows)[counts[name] :]:
                del rows[key]


# ---- what hamel makes of it ----------------------------------------------------------------------

# In one fresh process: the module is built and imported; a motion about t = 0 from the pose, q̇ of
# every quasi-velocity; then simulations, by the module itself where it has the enforcement.
PROBE = """
import json, sys, warnings, numpy as np
import hamel
sys.path.insert(0, ".")
asked = json.loads(sys.argv[1])
answer = {"ends": {}, "warnings": []}
def shown(message, category, *place, **more):
    if not str(message).startswith("m.yaml"):  # hamel's own begin with the file
        answer["warnings"].append(f"{category.__name__}: {message}")
warnings.showwarning = shown
def told(error):
    code = 2 if isinstance(error, FloatingPointError) else getattr(error, "exit_code", 70)
    return f"{code} {type(error).__name__}: {error}"
def finished():
    print(json.dumps(answer)); sys.exit()
try:
    hamel.build("m.yaml", out="module", functions=asked["functions"])
except Exception as error:
    answer["refused"] = told(error); finished()
import module
q, names, h = np.array(asked["q"]), asked["names"], asked["step"]
order = [module.states.index(n) for n in names]
rest = [i for i in range(module.nx) if i not in order]
u = np.zeros(module.nu)
f = lambda t, x: module.dynamics(t, x, u)
def state(w):
    x = np.empty(module.nx); x[order] = q; x[rest] = w; return x
def step(t, x, h):
    a = f(t, x); b = f(t + h/2, x + h/2*a); c = f(t + h/2, x + h/2*b); d = f(t + h, x + h*c)
    return x + h/6*(a + 2*b + 2*c + d)
answer |= {"dof": len(rest), "backend": module.backend}
try:
    w = np.random.default_rng(1).uniform(-1, 1, len(rest))
    drift = f(0.0, state(np.zeros(len(rest))))[order]
    # near where the choice is singular a w of one is so fast that it is there within a step
    x = state(w / max(1.0, np.abs(f(0.0, state(w))[order] - drift).max(initial=0.0)))
    answer["virtual"] = [(f(0.0, state(e))[order] - drift).tolist() for e in np.eye(len(rest))]
    answer["rates"] = f(0.0, x)[order].tolist()
    motion = {0: x}
    for k in range(4):
        motion[k + 1] = step(k*h, motion[k], h); motion[-k - 1] = step(-k*h, motion[-k], -h)
    answer["motion"] = [motion[k][order].tolist() for k in range(-4, 5)]
    energies = [module.energy(k*h, motion[k], u) for k in (-2, -1, 1, 2)]
    answer["energy"] = [np.asarray(e).tolist() for e in energies]
    answer["power"] = float(np.sum(module.power(0.0, x, u)))
except FloatingPointError as error:
    answer["stopped"] = str(error)
start = None
def by_hamel(name):
    global start
    found = hamel.simulate("m.yaml", enforcement=name, time=1.0, rtol=1e-9)
    if all(state in found.motion for state in module.states):
        start = [float(found.motion[state][0]) for state in module.states]
    return dict(found.final)
def by_module(name):
    motion = module.simulate([0.0, 1.0], start, u, rtol=1e-9, enforcement=name)
    return dict(zip(module.states, motion.x[-1].tolist()))
for number, name in enumerate(asked["enforcements"]):
    own = number and start and name in module.enforcements
    try:
        found = by_module(name) if own else by_hamel(name)
        answer["ends"][f"{name}, by the module" if own else name] = found
    except Exception as error:
        answer["ends"][name] = told(error)
finished()
"""


def judged(made: Mechanism, answer: dict) -> Iterator[str]:
    """What the module says that mechanics does not."""
    total, rank, least = made.rank(made.pose)
    if answer["dof"] != total - rank:
        yield f"{answer['dof']} degrees of freedom, {total} - {rank} by the singular values"
    if "stopped" in answer:
        if least > SINGULAR:
            yield f"stops at a regular position (σ_min/σ_max = {least:.1g}): {answer['stopped']}"
        return
    yield from _against_principle(made, answer)


def _against_principle(made: Mechanism, answer: dict) -> Iterator[str]:
    q, virtual = made.pose, np.array(answer["virtual"]).reshape(-1, len(made.pose))
    slipped = [
        made.constraint_rates(q, column) / max(1.0, np.abs(column).max()) for column in virtual
    ]
    worst = float(np.abs(slipped).max(initial=0))
    if worst > CLOSE:
        yield f"a virtual velocity breaks a constraint by {worst:.1g}"
    drift = max(
        float(np.abs(made.residual(np.array(x), k * STEP)).max(initial=0))
        for k, x in zip(range(-4, 5), answer["motion"], strict=True)
    )
    if drift > CLOSE:
        yield f"the motion leaves the constraints by {drift:.1g}"
    error = unbalanced(made, answer, virtual) if len(virtual) else 0.0
    if error > CLOSE:
        yield f"d'Alembert's principle is off by {error:.1g}"
    energies = np.array(answer["energy"])[:, :2].sum(axis=1)
    rate = slope(energies, STEP)
    scale = 1 + np.abs(energies).max() + abs(answer["power"])
    still = not any(
        entry.get("type") == "prescribed" for entry in made.lines["constraints"].values()
    )
    if still and abs(rate - answer["power"]) > 10 * CLOSE * scale:
        yield f"power {answer['power']:.6g}, but the energy changes at {rate:.6g}"


def unbalanced(made: Mechanism, answer: dict, virtual: Array) -> float:
    """The error of d'Alembert's principle relative to what its terms could be, whatever their
    directions: in free fall they vanish."""
    frames = [made.frames(np.array(x)) for x in answer["motion"]]
    origins, turns = map(
        np.array, zip(*(made.twists(made.pose, column) for column in virtual), strict=True)
    )
    motion = Motion(frames[4], made.pose, np.array(answer["rates"]), origins, turns, virtual)
    terms = [-power(motion) for power in made.powers]
    size = sum(float(np.abs(term).max(initial=0)) for term in terms)
    for i, (mass, com, I) in enumerate(made.masses):
        R = np.array([f[i][0] for f in frames])
        centres = np.array([f[i][0] @ com + f[i][1] for f in frames])
        second = np.array([-1, 16, -30, 16, -1]) / (12 * STEP**2) @ centres[2:7]
        moved = origins[:, i] + np.cross(turns[:, i], R[4] @ com)
        couple = slope([_momentum(R, k, I) for k in (2, 3, 5, 6)], STEP)
        terms += [mass * moved @ (second - made.gravity), turns[:, i] @ couple]
        force = mass * (np.linalg.norm(second) + np.linalg.norm(made.gravity))
        size += float(np.abs(moved).max(initial=0)) * float(force)
        size += float(np.abs(turns[:, i]).max(initial=0)) * float(np.linalg.norm(couple))
    size += 1e-9
    return float(np.abs(np.sum(terms, axis=0)).max(initial=0)) / size


def _momentum(R: Array, k: int, I: Array) -> Array:
    """Angular momentum about the centre of mass, R a row of rotations STEP apart."""
    spin = skew(slope([R[k + j] for j in AROUND], STEP) @ R[k].T)
    return R[k] @ I @ R[k].T @ spin


def simulated(made: Mechanism, answer: dict) -> Iterator[str]:
    """The ends of the motions with different enforcement: on the constraints, and at one place."""
    places = {}
    for name, end in answer["ends"].items():
        if isinstance(end, str):
            if not (_told(end) or _true_stop(made, answer, end)):
                yield f"simulate with {name}: {end.splitlines()[0]}"
            continue
        q = np.array([end[n] for n in made.names])
        places[name] = np.array([p for _, p in made.frames(q)])
        drift = float(np.abs(made.residual(q, 1.0)).max(initial=0))
        if drift > AGREE:
            yield f"simulate with {name} leaves the constraints by {drift:.1g}"
    for one, other in itertools.combinations(places, 2):
        apart = float(np.abs(places[one] - places[other]).max())
        if apart > AGREE:
            yield f"after 1 s {one} and {other} are {apart:.1g} m apart"


def _told(end: str) -> bool:
    """A refusal that says what it is: an enforcement that does not fit."""
    return end.startswith("2 ") and "does not fit" in end


def _true_stop(made: Mechanism, answer: dict, end: str) -> bool:
    """A refused motion may end at a singular position: then the others that went on have come near
    to one."""
    reached = [
        np.array([e[n] for n in made.names])
        for e in answer["ends"].values()
        if not isinstance(e, str)
    ]
    return end.startswith("2 ") and any(made.rank(q)[2] < SINGULAR for q in (made.pose, *reached))


def fits(made: Mechanism, seed: int) -> list[str]:
    """Three that the system can have, the first by `hamel.simulate` and the others by the module
    itself; without constraints there is none but `none`."""
    if not made.residuals and not made.rates:
        return ["none", "none"]
    return [RATES[seed % 3], "projection", "none"]


def refusal(made: Mechanism, said: str) -> str:
    """A refusal is true at a singular pose, by the singular values of our own A."""
    least = made.rank(made.pose)[2]
    if said[:2] in ("1 ", "2 ") and least < SINGULAR:
        return ""
    return f"refused at σ_min/σ_max = {least:.1g}: {said}"


def tried(seed: int) -> Ends:
    """Build one, load it, simulate it, all in one fresh process, and judge it."""
    made = mechanism(seed)
    folder = Path(environment.tempfile.mkdtemp(dir=environment.HOME))
    (folder / "m.yaml").write_text(made.text)
    asked = {
        "q": made.pose.tolist(),
        "names": made.names,
        "step": STEP,
        "enforcements": fits(made, seed),
        # all functions take three times as long
        "functions": None if seed % 10 == 0 else [*FEW, *(["project"] if made.can_drift() else [])],
    }
    outcome = python(PROBE, [json.dumps(asked)], folder, LIMIT)
    shutil.rmtree(folder)
    end, wrong = _end(made, outcome)
    if wrong:
        texts = environment.ROOT / "build" / "trials" / "mechanisms"
        texts.mkdir(parents=True, exist_ok=True)
        (texts / f"{made.name}.yaml").write_text(made.text)
    return [end], [f"random mechanism {seed}: {words}" for words in wrong]


def _end(made: Mechanism, outcome: Outcome) -> tuple[str, list[str]]:
    """What became of it, and what is wrong."""
    if wrong := complaint(outcome, ()):
        return "mechanism broken", [wrong]
    answer = json.loads(outcome.out.splitlines()[-1])
    if "refused" in answer:
        wrong = refusal(made, answer["refused"])
        return f"mechanism refused {answer['refused'][:1]}", [wrong] if wrong else []
    return "mechanism", list(_faults(made, answer))


def _faults(made: Mechanism, answer: dict) -> Iterator[str]:
    yield from answer["warnings"]
    if answer["backend"] == "numpy":
        yield "the compiled code is not used"
    yield from judged(made, answer)
    yield from simulated(made, answer)


def tried_all(record: Record, count: int) -> None:
    record.all(tried, ((f"mechanism {seed}", seed) for seed in range(count)))
