"""The scenes of `make bench`: a model, what of it is evaluated, and who else does it. One generator
per model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import growth
import numpy as np
from derivatives import Slopes
from frames import Hand
from peers import (
    augmented,
    batched,
    kane,
    lanes,
    mujoco,
    ours,
    peak,
    pinocchio,
    python_call,
    with_symforce,
)
from peers.batched import Timed
from peers.casadi_c import Read
from peers.contest import BUILD, ROWS, Contender, Unavailable
from peers.robot import robot
from regressors import Regressor
from robots import Peer, robots
from targets import (
    AUGMENTED,
    AUGMENTED_MX,
    BATCH,
    CHAINS,
    CONTRACTION,
    DERIVATIVES,
    DERIVATIVES_BATCH,
    FRAMES,
    INVERSE,
    LANES,
    MASS,
    PINOCCHIO,
    PYDY,
    REGRESSOR,
    SCALAR,
    THROUGH_CASADI,
)

from derive.model import Model, load
from derive.robots.reading import imported
from derive.states.sampling import States
from models import four_bars

Made = Callable[[], Sequence[Contender]]


@dataclass(frozen=True)
class Scene:
    """`peers`: name → what makes its contenders; `timed`: those with a loop of their own. Both may
    raise Unavailable."""

    function: str
    model: str
    own: Made
    peers: dict[str, Made]
    operations: Mapping[str, int]
    timed: Mapping[str, Callable[[], Timed]] = field(default_factory=dict)
    peak: int = 0  # doubles side by side of the peak to compare with
    best: bool = False  # the best of all peers has a row of its own
    called: Callable[[], tuple[float, float]] | None = None  # from Python: ns of ours and of the C


def same(rows: np.ndarray) -> np.ndarray:
    return rows


def four_bar() -> Iterator[Scene]:
    yield _plane("four_bar", ("crank", "best"), augmented.four_bar(), kane.four_bar)


def snake3() -> Iterator[Scene]:
    yield _plane("snake3", ("best", "head"), augmented.snake3(), kane.snake3)


def _plane(
    name: str, choices: Sequence[str], by: augmented.Lagrangian, by_kane: Callable[[], kane.Kane]
) -> Scene:
    """The fewest operations of some choices against equations with multipliers in the
    coordinates."""
    model = load(Path("models") / f"{name}.yaml")
    subjects = [ours.subject(model, choice) for choice in choices]
    of = min(subjects, key=lambda subject: ours.operations(subject)["total"])
    nq, q, qd = of.states.q.shape[1], of.states.q, of.rates
    inputs, quasi = np.hstack([q, qd, of.states.u]), of.quasi

    def read(rows: np.ndarray) -> np.ndarray:
        return np.asarray(quasi(q.T, qd.T, rows.T)).T

    return Scene(
        SCALAR,
        name,
        lambda: [ours.contender(of, read=lambda rows: rows[:, nq:])],
        {
            AUGMENTED: lambda: [
                *augmented.unrolled(by, inputs, read),
                *augmented.unrolled(by, inputs, read, True),
            ],
            PYDY: lambda: kane.contender(by_kane(), inputs, read),
        },
        ours.operations(of),
    )


def four_bars40() -> Iterator[Scene]:
    """IFToMM A02: all cranks stay parallel; states away from the horizontal, where it is
    singular."""
    n, rng = 40, np.random.default_rng(1)
    angle = np.where(rng.random(ROWS) < 0.5, 1.0, -1.0) * rng.uniform(0.4, np.pi - 0.4, ROWS)
    signs = np.array([1.0, *[-1.0, 1.0] * n])
    model = load(four_bars(n, BUILD / f"models/four_bars{n}.yaml"))
    place = {f"q{i}": 2 * i for i in range(n + 1)} | {f"s{i}": 2 * i - 1 for i in range(1, n + 1)}
    theirs = np.array(
        [place[c.name] for c in model.coordinates]
    )  # the peers' order: crank 0, then rod and crank in turn
    q, v = angle[:, None] * signs, rng.normal(size=(ROWS, 1)) * signs
    given = States(
        np.zeros(ROWS), q[:, theirs], v[:, theirs], np.zeros((ROWS, 0)), np.zeros((ROWS, 0))
    )
    of, by, inputs = ours.subject(model, "crank", given), augmented.four_bars(n), np.hstack([q, v])

    def read(rows: np.ndarray) -> np.ndarray:
        return rows[:, :1]

    def soft() -> Sequence[Contender]:
        return mujoco.contender(
            mujoco.four_bars(n, BUILD / f"models/four_bars{n}.xml"),
            _with_zeros(inputs, q),
            q.shape[1],
            read,
            True,
        )

    def closed() -> Sequence[Contender]:
        open_chain = pinocchio.written(pinocchio.model_of(_in_order(model, place)), f"four_bars{n}")
        closures = [(2 * i, 2 * i + 1, 1, 0, 0, 1, 0, 0) for i in range(1, n + 1)]
        return pinocchio.closed(open_chain, closures, _with_zeros(inputs, q), q.shape[1], read)

    yield Scene(
        SCALAR,
        f"four_bars{n}",
        lambda: [ours.contender(of, read=lambda rows: rows[:, 2 * n + 1 :])],
        {
            AUGMENTED: lambda: [
                *augmented.unrolled(by, inputs, read),
                *augmented.unrolled(by, inputs, read, True),
            ],
            AUGMENTED_MX: lambda: augmented.sparse(by, inputs, read),
            "MuJoCo": soft,
            "Pinocchio lcaba": closed,
        },
        ours.operations(of),
    )


def _in_order(model: Model, place: Mapping[str, int]) -> Model:
    return replace(
        model, joints=tuple(sorted(model.joints, key=lambda joint: place[joint.coordinates[0]]))
    )


def _with_zeros(inputs: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.hstack([inputs, np.zeros_like(q)])


def chain(n: int) -> Iterator[Scene]:
    """A planar pendulum of n links: every peer there is, the best one counts."""
    place = BUILD / f"models/chain{n}.yaml"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(
        growth.planar(n).replace("model: planar", f"model: chain{n}", 1)
    )  # each has files of its own
    model = load(place)
    rng = np.random.default_rng(1)
    q, v = rng.uniform(-np.pi, np.pi, (ROWS, n)), rng.normal(size=(ROWS, n))
    of = ours.subject(
        model, given=States(np.zeros(ROWS), q, v, np.zeros((ROWS, 0)), np.zeros((ROWS, 0)))
    )
    tree = pinocchio.written(pinocchio.model_of(model), f"chain{n}")
    inputs, full = np.hstack([q, v]), _with_zeros(np.hstack([q, v]), q)
    by = augmented.chain(n)
    peers: dict[str, Made] = {
        THROUGH_CASADI: lambda: [
            c for f in ("aba", "aba_world") for c in pinocchio.generated(tree, f, full, n, same)
        ],
        PINOCCHIO: lambda: [pinocchio.own(tree, f, full, n, same) for f in ("aba", "aba_world")],
    }
    shared = (
        (False, True) if n <= 20 else ()
    )  # with angles alone elimination fills in: the cube of n
    peers[AUGMENTED] = lambda: [
        *(c for cse in shared for c in augmented.unrolled(by, inputs, same, cse)),
        *augmented.bodies(n, inputs, same),
    ]
    peers[PYDY] = partial(_by_kane, n, inputs)
    own: Made = partial(_last, of, n)
    yield Scene(SCALAR, f"chain{n}", own, peers, ours.operations(of), best=True)


def _by_kane(n: int, inputs: np.ndarray) -> list[Contender]:
    if n > 10:
        raise Unavailable(
            "left out: KanesMethod takes minutes for as many links, and the matrix solved has no zeros"
        )
    return kane.contender(kane.chain(n), inputs, same)


def _last(of: ours.Subject, n: int) -> list[Contender]:
    return [ours.contender(of, read=lambda rows: rows[:, n:])]


def stanford_arm() -> Iterator[Scene]:
    model = load("models/stanford_arm.yaml")
    of = ours.subject(model, "joints")
    text = pinocchio.written(pinocchio.model_of(model), "stanford_arm")
    yield _dynamics(Tree("stanford_arm", text, of, np.arange(of.states.v.shape[1]), of.states.q))


def _robot(name: str) -> Tree:
    """A robot of example-robot-data, the humanoid with a free root."""
    floating = name == "humanoid"
    file = robot(name, robots())
    found = imported(file, floating)
    peer, rng = Peer(file, floating, found), np.random.default_rng(1)
    drawn = [peer.state(rng) for _ in range(ROWS)]
    q, v, pin_q = (np.array([getattr(s, part) for s in drawn]) for part in ("q", "v", "pin_q"))
    given = States(
        np.zeros(ROWS), q, v, rng.normal(size=(ROWS, len(found.model.inputs))), np.zeros((ROWS, 0))
    )
    text = pinocchio.written(peer.model, name)
    return Tree(name, text, ours.subject(found.model, given=given), peer.columns, pin_q)


@dataclass(frozen=True)
class Tree:
    """A tree of joints in Pinocchio's order of velocities: its own states and ours, and the way
    back from our results."""

    name: str
    text: Path
    of: ours.Subject
    columns: np.ndarray  # where Pinocchio's velocities stand among ours
    q: np.ndarray

    @property
    def nv(self) -> int:
        return len(self.columns)

    @property
    def v(self) -> np.ndarray:
        return self.of.states.v[:, self.columns]

    @property
    def inputs(self) -> np.ndarray:
        """q, v and generalised forces."""
        return np.hstack([self.q, self.v, _applied(self.of)[:, self.columns]])

    def accelerations(self, rows: np.ndarray) -> np.ndarray:
        """Of our rows (q̇, ẇ)."""
        return rows[:, self.of.states.q.shape[1] :][:, self.columns]

    def pinocchio(
        self, functions: Sequence[str], inputs: np.ndarray, size: int, read: Read = same
    ) -> dict[str, Made]:
        own = [
            name for name in functions if name != "crba_world"
        ]  # crba.c is the upper triangle of both
        return {
            THROUGH_CASADI: lambda: [
                c
                for name in functions
                for c in pinocchio.generated(self.text, name, inputs, size, read)
            ],
            PINOCCHIO: lambda: [pinocchio.own(self.text, name, inputs, size, read) for name in own],
        }


def _dynamics(tree: Tree) -> Scene:
    peers = tree.pinocchio(("aba", "aba_world"), tree.inputs, tree.nv)
    return Scene(
        SCALAR,
        tree.name,
        lambda: [ours.contender(tree.of, read=tree.accelerations)],
        peers,
        ours.operations(tree.of),
    )


def panda() -> Iterator[Scene]:
    tree = _robot("panda")
    forward = _dynamics(tree)
    file, made = BUILD / "models/panda.urdf", (tree.inputs, tree.nv, same)
    forward.peers["MuJoCo"] = lambda: mujoco.contender(file, *made)
    forward.peers["SymForce"] = lambda: with_symforce.contender(tree.text, *made)
    yield replace(forward, peak=1)
    yield replace(
        forward,
        function=BATCH,
        own=lambda: [ours.contender(tree.of, batch=True, read=tree.accelerations)],
        peers=forward.peers
        | {LANES: lambda: [c for s in _recursions(tree) for c in lanes.vectors(s, *made)]},
        timed={
            "JAX": lambda: batched.patiently(
                batched.jax, _recursions(tree)[0], tree.inputs, tree.nv
            ),
            "numba": lambda: batched.patiently(
                batched.numba, _recursions(tree)[0], tree.inputs, tree.nv
            ),
            "MuJoCo rollout": lambda: batched.patiently(
                batched.rollout, file, tree.inputs, tree.nv
            ),
        },
        peak=peak.vector_lanes(),
    )
    yield _inverse(tree)
    yield _mass(tree)
    yield _hand(tree, "panda_hand")
    yield _regressor(tree)
    yield from _slopes(tree)
    for name, measure in {
        "one Python call": python_call.one_at_a_time,
        "one Python call, fresh": partial(python_call.one_at_a_time, fresh=True),
        "a Python call of 10,000": python_call.many_at_once,
    }.items():
        yield Scene(name, "panda", list, {}, {}, called=partial(measure, tree.of))


def _hand(tree: Tree, name: str) -> Scene:
    """A frame of the robot file."""
    file = robot(tree.name, robots())
    peer = Peer(file, False, imported(file))
    frame = peer.model.frames[peer.model.getFrameId(name)]
    placement = np.column_stack([frame.placement.rotation, frame.placement.translation])
    hand = Hand(tree.of, tree.text, name, frame.parentJoint, placement, tree.columns, tree.q)
    peers: dict[str, Made] = {PINOCCHIO: hand.theirs}
    return Scene(FRAMES, tree.name, hand.own, peers, ours.operations(tree.of, hand.function))


def _regressor(tree: Tree) -> Scene:
    wanted = np.random.default_rng(2).normal(size=tree.v.shape)
    of = Regressor(tree.of, tree.text, tree.columns, np.hstack([tree.q, tree.v, wanted]))
    peers: dict[str, Made] = {PINOCCHIO: of.theirs}
    return Scene(REGRESSOR, tree.name, of.own, peers, ours.operations(tree.of, REGRESSOR))


def _slopes(tree: Tree) -> Iterator[Scene]:
    """Derivatives, one state and many, and the second-order contraction beside them."""
    slopes = Slopes(tree.of, tree.text, tree.columns, tree.inputs)
    counts = ours.operations(tree.of, DERIVATIVES)
    peers: dict[str, Made] = {PINOCCHIO: slopes.theirs}
    single = tree.name == "panda"  # joints with one velocity
    through = {THROUGH_CASADI: slopes.through_casadi} if single else {}
    yield Scene(DERIVATIVES, tree.name, slopes.own, peers | through, counts)
    if single:
        yield Scene(DERIVATIVES_BATCH, tree.name, lambda: slopes.own(True), peers, counts)
    second = ours.operations(tree.of, CONTRACTION)
    beside: dict[str, Made] = {DERIVATIVES: slopes.beside}
    yield Scene(CONTRACTION, tree.name, slopes.contraction, beside, second)


def humanoid() -> Iterator[Scene]:
    tree = _robot("humanoid")
    yield _dynamics(tree)
    yield from _slopes(tree)


def _recursions(tree: Tree) -> list[Path]:
    return [pinocchio.code(tree.text) / f"{name}.c" for name in ("aba", "aba_world")]


def _inverse(tree: Tree) -> Scene:
    wanted = np.random.default_rng(2).normal(size=tree.v.shape)
    turned = np.empty_like(wanted)
    turned[:, tree.columns] = wanted
    rows = np.hstack([tree.of.states.q, tree.of.states.v, turned])
    peers = tree.pinocchio(("rnea",), np.hstack([tree.q, tree.v, wanted]), tree.nv)
    return Scene(
        INVERSE,
        tree.name,
        lambda: [
            ours.contender(tree.of, INVERSE, rows=rows, read=lambda rows: rows[:, tree.columns])
        ],
        peers,
        ours.operations(tree.of, INVERSE),
    )


def _mass(tree: Tree) -> Scene:
    peers = tree.pinocchio(
        ("crba", "crba_world"), tree.inputs, tree.nv**2, _by_columns(np.arange(tree.nv))
    )
    own = _by_columns(tree.columns)
    return Scene(
        MASS,
        tree.name,
        lambda: [ours.contender(tree.of, MASS, read=own)],
        peers,
        ours.operations(tree.of, MASS),
    )


def _by_columns(columns: np.ndarray) -> Read:
    """The upper triangle of a symmetric matrix as rows; theirs come column by column with zeros or
    nothing below."""

    def read(rows: np.ndarray) -> np.ndarray:
        M = rows.reshape(-1, len(columns), len(columns))
        M = M[:, columns][:, :, columns].swapaxes(1, 2)
        return np.triu(M).reshape(len(rows), -1)

    return read


def _applied(of: ours.Subject) -> np.ndarray:
    """Generalised forces of the inputs."""
    model = of.equations.system.model
    at = {velocity.name: i for i, velocity in enumerate(model.velocities)}
    forces = np.zeros_like(of.states.v)
    for i, given in enumerate(model.inputs):
        forces[:, at[given.velocity]] += of.states.u[:, i]
    return forces


SCENES: dict[str, Callable[[], Iterator[Scene]]] = {
    "four_bar": four_bar,
    "snake3": snake3,
    "stanford_arm": stanford_arm,
    "panda": panda,
    "ur5": lambda: iter([_dynamics(_robot("ur5"))]),
    "humanoid": humanoid,
    "four_bars40": four_bars40,
    **{f"chain{n}": partial(chain, n) for n in CHAINS},
}
