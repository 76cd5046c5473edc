"""Random mechanisms, each a Model made by hand: trees of every joint type, with closures, constraints
and loads that their random configuration meets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from derive.expressions.tree import (
    ONE,
    ZERO,
    Call,
    Expression,
    Name,
    Number,
    Power,
    Product,
    Rate,
    Sum,
)
from derive.joints import joint_type
from derive.model.constraint_records import Distance, Holonomic, Nonholonomic, OnSurface, Rolling
from derive.model.load_records import (
    Armature,
    BallSpring,
    Bushing,
    Force,
    JointDamper,
    JointFriction,
    JointSpring,
    PointSpring,
    Torque,
)
from derive.model.records import (
    GROUND,
    Body,
    Choice,
    Closure,
    Coordinate,
    InitialValue,
    Input,
    Joint,
    Model,
    Placement,
    Span,
    Velocity,
)
from hamel.verify.reference.outcome import reference, state_of

HERE = Span(1, 1)
TREE = (
    "revolute",
    "prismatic",
    "screw",
    "cylindrical",
    "universal",
    "ball",
    "planar",
    "free",
    "free quaternion",
    "fixed",
    "ball euler",
)
LOOPS = {
    "revolute": 5,
    "prismatic": 5,
    "screw": 5,
    "cylindrical": 4,
    "universal": 4,
    "ball": 3,
    "planar": 3,
    "fixed": 6,
}
MEETINGS = {
    "distance": 1,
    "on_surface": 1,
    "sphere": 3,
    "disk": 3,
    "torus": 3,
    "gear": 1,
    "moving": 1,
    "servo": 1,
}
LOADS = (
    "bushing",
    "friction",
    "armature",
    "joint spring",
    "joint damper",
    "point spring",
    "force",
    "torque",
    "input",
)
EVERY_LOAD = (*LOADS, "ball spring")  # those above are drawn by seeds that tests know


def number(x: float) -> Expression:
    return ZERO if x == 0 else ONE if x == 1 else Number(float(x))


def vector(x) -> tuple:
    return tuple(number(float(e)) for e in x)


def vector_rows(rows) -> list:
    return [vector(row) for row in rows]


def any_axis(rng: np.random.Generator) -> np.ndarray:
    """One of x, y, z, −x, −y, −z half of the time: exact zeros take other branches than oblique
    axes."""
    if rng.random() < 0.5:
        return np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def across(rng: np.random.Generator, axis: np.ndarray) -> np.ndarray:
    """A unit vector at right angles."""
    x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    y, a = np.cross(axis, x), rng.uniform(0, 2 * np.pi)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return x if rng.random() < 0.5 else np.cos(a) * x + np.sin(a) * y


def any_rotation(rng: np.random.Generator) -> np.ndarray:
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q * np.linalg.det(Q)


def placement(position, rotation=None) -> Placement:
    return Placement(
        vector(position), None if rotation is None else tuple(vector(row) for row in rotation)
    )


def any_placement(rng: np.random.Generator) -> Placement:
    """At the origin, moved, or moved and turned."""
    kind = rng.integers(3)
    if kind == 0:
        return placement(np.zeros(3))
    return placement(rng.uniform(-0.4, 0.4, 3), any_rotation(rng) if kind == 2 else None)


def any_body(rng: np.random.Generator, name: str) -> Body:
    """Inertia of three or more point masses, so that it can exist; some are about axes of the
    body."""
    points, masses = rng.uniform(-0.3, 0.3, (5, 3)), rng.uniform(0.1, 1.0, 5)
    points -= masses @ points / masses.sum()
    I = sum(m * ((r @ r) * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, points))
    if rng.random() < 0.3:
        I = np.diag(np.diag(I))
    com = rng.uniform(-0.3, 0.3, 3) * rng.integers(2, size=3)
    entries = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
    return Body(name, number(masses.sum()), vector(com), tuple(map(number, entries)), HERE)


@dataclass
class Parts:
    """A mechanism while it grows."""

    rng: np.random.Generator
    bodies: list = field(default_factory=list)
    joints: list = field(default_factory=list)
    coordinates: list = field(default_factory=list)
    velocities: list = field(default_factory=list)
    closures: list = field(default_factory=list)
    constraints: list = field(default_factory=list)
    loads: list = field(default_factory=list)
    inputs: list = field(default_factory=list)
    initial: tuple = ()

    def model(self) -> Model:
        return Model(
            name="random", description="", file="", text="", plane="", gravity=vector((0.3, -0.5, -9.81)), parameters=(),
            coordinates=tuple(self.coordinates), velocities=tuple(self.velocities), definitions=(), bodies=tuple(self.bodies),
            joints=tuple(self.joints), closures=tuple(self.closures), constraints=tuple(self.constraints),
            loads=tuple(self.loads), inputs=tuple(self.inputs), outputs=(), choices=(Choice("auto", "auto", (), HERE),),
            initial=self.initial, steady_motions=(), kinetic=None, potential=None,
        )  # fmt: skip

    def grow(self, kind: str, parent: int) -> None:
        """One more body, on a joint of the given kind to an earlier body (0 is the ground)."""
        name, i = kind.split()[0], len(self.bodies)
        orientation = {"free": "zyx", "free quaternion": "quaternion"}.get(kind, "")
        if kind in ("free", "ball euler"):
            orientation = str(self.rng.choice(["zyx", "zxy", "xyz", "zxz"]))
        table = joint_type(name, orientation)
        axis = np.array([0.0, 0.0, 1.0]) if name == "planar" else any_axis(self.rng)
        label = f"j{i}"
        coordinates = [
            Coordinate(f"q{i}_{k}", slot.unit, label, HERE)
            for k, slot in enumerate(table.coordinates)
        ]
        velocities = [
            Velocity(f"{label}.{slot.suffix}", slot.unit, label, "", HERE)
            if slot.suffix
            else Velocity(f"der({coordinate.name})", slot.unit, label, coordinate.name, HERE)
            for slot, coordinate in zip(table.velocities, coordinates)
        ]
        self.coordinates += coordinates
        self.velocities += velocities
        self.bodies.append(any_body(self.rng, f"b{i}"))
        self.joints.append(
            Joint(
                label, name, f"b{parent - 1}" if parent else GROUND, f"b{i}", any_placement(self.rng), any_placement(self.rng),
                vector(axis), tuple(c.name for c in coordinates), tuple(v.name for v in velocities), orientation, HERE,
                pitch=number(self.rng.uniform(-0.5, 0.5)) if name == "screw" else ZERO,
                axis2=vector(across(self.rng, axis)) if name == "universal" else None,
            )
        )  # fmt: skip

    def pose(self) -> None:
        """Start from a random configuration; closures are put where it meets them."""
        q = self.rng.uniform(-0.8, 0.8, len(self.coordinates))
        for i, coordinate in enumerate(self.coordinates):
            if coordinate.unit == "1" and self.coordinates[i - 1].unit != "1":
                q[i : i + 4] = self.rng.normal(size=4)
                q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
        self.initial = tuple(
            InitialValue(c.name, number(x), False, HERE) for c, x in zip(self.coordinates, q)
        )
        ref = reference(self.model())
        self.q, self.frames = q, state_of(ref, 0.0, q, np.zeros(len(self.velocities))).frames

    def seen_from(self, body: str, origin: np.ndarray, rotation: np.ndarray) -> Placement:
        """A frame given in the ground, as a placement on a body."""
        frame = self.frames[body]
        return placement(frame.rotation.T @ (origin - frame.origin), frame.rotation.T @ rotation)

    def close(self, kind: str, bodies: tuple[str, str]) -> None:
        """A joint between two bodies, at a random place of the first."""
        rng, first = self.rng, self.frames[bodies[0]]
        position, rotation, axis = rng.uniform(-0.4, 0.4, 3), any_rotation(rng), any_axis(rng)
        at = placement(position, rotation)
        origin, turned = first.origin + first.rotation @ position, first.rotation @ rotation
        other = self.seen_from(bodies[1], origin, turned)
        axis2 = vector(across(rng, axis)) if kind == "universal" else None
        pitch = number(rng.uniform(0.1, 0.5)) if kind == "screw" else ZERO
        name = f"c{len(self.closures)}"
        self.closures.append(
            Closure(name, kind, bodies, (at, other), vector(axis), HERE, axis2, pitch)
        )

    def meet(self, kind: str, bodies: tuple[str, str]) -> None:
        """A constraint that the random configuration satisfies."""
        rng, name = self.rng, f"k{len(self.constraints)}"
        frames = [self.frames[body] for body in bodies]
        points = rng.uniform(-0.4, 0.4, (2, 3))
        ground = [frame.origin + frame.rotation @ point for frame, point in zip(frames, points)]
        if kind == "distance":
            length = number(float(np.linalg.norm(ground[1] - ground[0])))
            self.constraints.append(
                Distance(name, bodies, (vector(points[0]), vector(points[1])), length, HERE)
            )
        elif kind == "on_surface":
            inside = frames[1].rotation.T @ (ground[0] - frames[1].origin)
            surface = ellipsoid(rng.uniform(0.5, 2.0, 3), inside)
            self.constraints.append(
                OnSurface(name, bodies[0], vector(points[0]), bodies[1], surface, HERE)
            )
        elif kind == "gear":
            plain = [i for i, x in enumerate(self.coordinates) if x.unit != "1"]
            if not plain:
                return  # quaternions alone: nothing to gear
            pair = rng.choice(plain, 2)  # one against itself is held where it is
            ratio = float(rng.uniform(1.5, 2.5))
            terms = [
                Name(self.coordinates[pair[0]].name),
                Product((number(-ratio), Name(self.coordinates[pair[1]].name))),
            ]
            rest = number(float(ratio * self.q[pair[1]] - self.q[pair[0]]))
            self.constraints.append(Holonomic(name, Sum((*terms, rest)), (), HERE))
        elif kind in ("moving", "servo"):
            self.constraints.extend(self.formula(kind, name))
        else:
            self.constraints.append(self.rolling(kind, name, bodies[0], points[0]))

    def formula(self, kind: str, name: str) -> Iterator[Holonomic | Nonholonomic]:
        """A formula that is nonlinear in the coordinates and knows the time: of positions, or of
        rates.

        q₁ + ½ sin q₂ − q₂²/4 − a sin ω t = 0 with q from where they are, or q̇₁ + ω sin(q₁ + t) q̇₂
        = 0.

        Rates are not driven: other rows may tie the same ones, and then nothing could meet both.
        """
        plain = [i for i, x in enumerate(self.coordinates) if x.unit != "1"]
        if len(plain) < 2:
            return
        i, j = self.rng.choice(plain, 2, replace=False)
        first, second, t = Name(self.coordinates[i].name), Name(self.coordinates[j].name), Name("t")
        a, omega = number(self.rng.uniform(0.1, 0.4)), number(self.rng.uniform(0.5, 2.0))
        if kind == "servo":
            turned = Call("sin", (Sum((first, t)),))
            yield Nonholonomic(
                name, Sum((Rate(first.name), Product((omega, turned, Rate(second.name))))), (), HERE
            )
            return
        p, q = Sum((first, number(-self.q[i]))), Sum((second, number(-self.q[j])))
        bent = (
            Product((number(0.5), Call("sin", (q,)))),
            Product((number(-0.25), Power(q, Number(2.0)))),
        )
        driven = Product((number(-1.0), a, Call("sin", (Product((omega, t)),))))
        yield Holonomic(name, Sum((p, *bent, driven)), (), HERE)

    def rolling(self, kind: str, name: str, body: str, centre: np.ndarray) -> Rolling:
        """On a plane that the body touches in the random configuration."""
        rng, frame = self.rng, self.frames[body]
        normal, axis, radius, tube = (
            any_axis(rng),
            any_axis(rng),
            rng.uniform(0.2, 0.5),
            rng.uniform(0.02, 0.1),
        )
        e = frame.rotation @ axis
        down = -(normal - (normal @ e) * e)
        reach = {
            "sphere": -radius * normal,
            "disk": radius * down / np.linalg.norm(down),
            "torus": radius * down / np.linalg.norm(down) - tube * normal,
        }[kind]
        touch = frame.origin + frame.rotation @ centre + reach
        wide = number(tube) if kind == "torus" else ZERO
        return Rolling(
            name, body, vector(centre), number(radius), vector(axis), vector(touch), vector(normal), HERE, shape=kind, tube=wide
        )  # fmt: skip

    def load(self, kind: str, bodies: tuple[str, str]) -> None:
        rng, name = self.rng, f"l{len(self.loads)}"
        points = tuple(vector(rng.uniform(-0.3, 0.3, 3)) for _ in range(2))
        velocity = str(rng.choice([v.name for v in self.velocities]))
        a, b, c = (number(x) for x in rng.uniform(0.2, 2.0, 3))
        self.loads.append(
            {
                "bushing": lambda: Bushing(
                    name, bodies, (any_placement(rng), any_placement(rng)), *vector_rows(rng.uniform(0.5, 2, (4, 3))), HERE
                ),
                "friction": lambda: JointFriction(name, velocity, a, b, c, HERE),
                "armature": lambda: Armature(name, velocity, a, HERE),
                "joint spring": lambda: JointSpring(name, str(rng.choice([x.name for x in self.coordinates])), a, b, HERE),
                "ball spring": lambda: self.ball_spring(name, (a, b, c)) or JointSpring(name, self.coordinates[0].name, a, b, HERE),
                "joint damper": lambda: JointDamper(name, velocity, a, HERE),
                "point spring": lambda: PointSpring(name, bodies, points, a, b, c, HERE),
                "force": lambda: Force(name, bodies[0], points[0], (a, b, c), str(rng.choice(["body", "ground"])), HERE),
                "torque": lambda: Torque(name, bodies[0], (a, b, c), str(rng.choice(["body", "ground"])), HERE),
                "input": lambda: None,
            }[kind]()
        )  # fmt: skip
        if self.loads[-1] is None:
            self.loads.pop()
            self.inputs.append(Input(f"u{len(self.inputs)}", velocity, "", "", HERE, gear=b))

    def ball_spring(
        self, name: str, stiffness: tuple[Expression, Expression, Expression]
    ) -> BallSpring | None:
        """In the last ball joint; None without one."""
        for joint in reversed(dict.fromkeys(x.owner for x in self.coordinates)):
            q = [x.name for x in self.coordinates if x.owner == joint]
            w = [x.name for x in self.velocities if x.owner == joint]
            if (len(q), len(w)) == (4, 3):
                return BallSpring(
                    name, joint, (q[0], q[1], q[2], q[3]), (w[0], w[1], w[2]), stiffness, HERE
                )
        return None


def ellipsoid(weights: np.ndarray, through: np.ndarray) -> Expression:
    """Σ wᵢ xᵢ² − the value that makes it pass through a point."""
    squares = [Product((number(w), Power(Name(x), Number(2.0)))) for w, x in zip(weights, "xyz")]
    return Sum((*squares, number(-float(weights @ through**2))))


def mechanism(tree, loops=(), meetings=(), loads=(), seed: int = 0) -> Model:
    """`tree`: (joint, parent) pairs, the others (kind, ends); bodies are counted modulo what is
    there.

    Closures and constraints are left out that would leave no freedom.
    """
    parts = Parts(np.random.default_rng(seed))
    for kind, parent in tree:
        parts.grow(kind, parent % (len(parts.bodies) + 1))
    if not parts.velocities:
        parts.grow("revolute", 0)
    parts.pose()
    freedom = len(parts.velocities) - 1
    for add, rows, wanted in ((parts.close, LOOPS, loops), (parts.meet, MEETINGS, meetings)):
        for kind, ends in wanted:
            pair = between(parts, ends, rows[kind])
            if pair and rows[kind] <= freedom:
                add(kind, pair)
                freedom -= rows[kind]
    for kind, ends in loads:
        parts.load(kind, between(parts, ends, 0) or (parts.bodies[-1].name, GROUND))
    return parts.model()


def between(parts: Parts, ends: tuple[int, int], rows: int) -> tuple[str, str] | None:
    """Two bodies, the first no ground, with more freedom between them than the rows take."""
    names = [GROUND, *(body.name for body in parts.bodies)]
    first, second = names[1 + ends[0] % (len(names) - 1)], names[ends[1] % len(names)]
    if first == second:
        second = GROUND
    return (first, second) if free_between(parts, first, second) > rows else None


def free_between(parts: Parts, first: str, second: str) -> int:
    carrier = {joint.child: joint for joint in parts.joints}

    def path(body: str) -> set[str]:
        return {body} | path(carrier[body].parent) if body in carrier else set()

    return sum(len(carrier[body].velocities) for body in path(first) ^ path(second))
