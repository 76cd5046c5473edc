"""make robots: every URDF of the PyPI package example-robot-data, imported and compared with
Pinocchio.

Mass matrix, bias, forward dynamics, derivatives, frames and regressors at random states, relative to the largest entry. Each robot
with its root link fixed and with a free root. Where joints mimic others, Pinocchio's tree is
projected on the independent joints here.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import numpy as np
from robot_regressors import NAMES, regressors
from robot_regressors import TOLERANCE as LINEAR
from robot_slopes import slopes

from codegen.passes import program
from derive.diagnostics import HamelError
from derive.expressions.evaluate import number
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model.load_records import JointFriction
from derive.model.records import Model
from derive.robots import RobotFile
from derive.robots.reading import UNPHYSICAL, Imported, imported
from derive.states import system
from derive.states.sampling import states

STATES = 20
SLOPES = 3  # of these, where frames and derivatives are compared as well
TOLERANCE = 1e-9
ILL_CONDITIONED = 1e8  # condition of the scaled mass matrix from which a state is drawn again
COUNTED = 60  # velocities up to which the operations of dynamics are counted
OUT = Path("build/robots.json")
OWN = Path(__file__).resolve().parent.parent / "tests/robots"


@dataclass
class Report:
    """`verdict`: agreed, refused, wrong, or failed (an error that is nobody's fault but ours)."""

    robot: str
    base: str
    verdict: str
    reason: str = ""
    velocities: int = 0
    mimics: int = 0
    redrawn: int = 0
    waived: bool = False  # an inertia that no body can have was taken as it is
    errors: dict[str, float] = field(default_factory=dict)
    operations: int | None = None
    seconds: dict[str, float] = field(default_factory=dict)


def compared(root: Path, file: Path, floating: bool) -> Report:
    """One robot, one kind of base."""
    report = Report(str(file.relative_to(root)), "free" if floating else "fixed", "agreed")
    try:
        try:
            _compare(RobotFile(file, floating, exact=True), report)
        except HamelError as error:
            if not any(problem.hint == UNPHYSICAL for problem in error.diagnostics):
                raise
            report.waived = True
            _compare(RobotFile(file, floating, exact=True, unphysical=True), report)
    except HamelError as error:
        report.verdict, report.reason = (
            "refused",
            error.diagnostics[0].headline().replace(str(file), file.name),
        )
    except Exception as error:  # the table is to be finished
        report.verdict, report.reason = "failed", f"{type(error).__name__}: {error}"[:300]
    return report


def _compare(robot: RobotFile, report: Report) -> None:
    file = Path(robot)
    with _timed(report, "import"):
        found = imported(robot)
    with _timed(report, "mechanics"):
        mechanics = system(found.model, "all")
    with _timed(report, "formulation"):
        derived = equations(mechanics)
    report.velocities, report.mimics = mechanics.v.numel(), len(mechanics.rows)
    if mechanics.v.numel() <= COUNTED:
        with _timed(report, "passes"):
            report.operations = program(derived, ["dynamics"]).kernels[0].operations["total"]
    peer = Peer(file, robot.floating, found)
    ours = {name: _function(derived, name) for name in ("mass", "bias", "dynamics", "state")} | {
        "S": _span(derived)
    }
    with _timed(report, "slopes"):
        beside = slopes(derived, peer, found.joints, ours["S"])
    with _timed(report, "regressors"):
        linear = regressors(derived, peer, file, robot.floating)
    rng, drawn = np.random.default_rng(1), np.random.default_rng(2)
    for k in range(STATES):
        x, u, s = _check_state(peer, ours, derived, rng, report)
        if k < SLOPES:
            beside.check(peer, s, x, u, partial(_note, report))
        linear.check(peer, s, drawn, partial(_note, report))
    allowed = {name: LINEAR if name in NAMES else TOLERANCE for name in report.errors}
    worst = max(report.errors, key=lambda name: report.errors[name] / allowed[name])
    if not report.errors[worst] <= allowed[worst]:
        report.verdict, report.reason = "wrong", f"{worst} differs by {report.errors[worst]:.1e}"


class _timed:
    def __init__(self, report: Report, stage: str) -> None:
        self.report, self.stage = report, stage

    def __enter__(self) -> None:
        self.start = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        self.report.seconds[self.stage] = time.perf_counter() - self.start


def _span(derived: Equations) -> ca.Function:
    """S = ∂v/∂w."""
    v = next(function for function in derived.functions if function.name == "velocity").result.value
    x = next(slot for slot in derived.arguments if slot.name == "x").symbols
    S = ca.jacobian(v, x)[:, derived.system.q.numel() :]
    return ca.Function("S", [slot.symbols for slot in derived.arguments], [ca.densify(S)])


def _function(derived: Equations, name: str) -> ca.Function:
    chosen = next(function for function in derived.functions if function.name == name)
    slots = [
        chosen.x if slot.name == "x" and chosen.x is not None else slot
        for slot in derived.arguments
    ]
    return ca.Function(name, [slot.symbols for slot in slots], [ca.densify(chosen.result.value)])


@dataclass
class State:
    """In Pinocchio's order, and q and v in ours."""

    pin_q: np.ndarray
    pin_v: np.ndarray
    q: np.ndarray
    v: np.ndarray


class Peer:
    """Pinocchio's model of the same file, and the way from its joints to ours."""

    def __init__(self, file: Path, floating: bool, found: Imported) -> None:
        import pinocchio

        self.pin: Any = pinocchio
        self.model = pinocchio.buildModelFromUrdf(
            str(file), *([pinocchio.JointModelFreeFlyer()] if floating else [])
        )
        self.data = self.model.createData()
        self.joints = list(zip(self.model.names, self.model.joints))[1:]
        base = next(joint.name for joint in found.model.joints if joint.parent == "ground")
        self.ours = {name: found.joints.get(name, base) for name, _ in self.joints}
        self.places = {c.name: i for i, c in enumerate(found.model.coordinates)}
        owners = [v.owner for v in found.model.velocities]
        self.columns = np.array(
            [i for name, _ in self.joints for i, o in enumerate(owners) if o == self.ours[name]]
        )
        self.mimics = mimics(file)
        self.friction = np.zeros(self.model.nv)
        rubbing = frictions(file)
        self.width = np.ones(self.model.nv)
        widths = friction_widths(found.model)
        for name, joint in self.joints:
            self.friction[joint.idx_v] = rubbing.get(name, 0.0)
            self.width[joint.idx_v] = widths.get(self.ours[name], 1.0)
        self.G = self._independent()

    def _independent(self) -> np.ndarray:
        """v = G · velocities of the joints that move by themselves (Pinocchio's order)."""
        start = {name: joint.idx_v for name, joint in self.joints}
        G = np.eye(self.model.nv)
        for name in self.mimics:
            if name in start:
                master, factor, _ = self._master(name)
                G[start[name]] = 0.0
                if master in start:
                    G[start[name], start[master]] = factor
        return G[
            :,
            [
                i
                for i in range(self.model.nv)
                if not any(start.get(name) == i for name in self.mimics)
            ],
        ]

    def _master(self, name: str) -> tuple[str, float, float]:
        """q = factor · q_master + offset with a master that mimics nothing."""
        factor, offset = 1.0, 0.0
        while name in self.mimics:
            name, k, c = self.mimics[name]
            offset, factor = offset + factor * c, factor * k
        return name, factor, offset

    def state(self, rng: np.random.Generator) -> State:
        """A random state that the mimicking joints share in."""
        reach = {
            name: 0.5 if joint.shortname().startswith("JointModelP") else np.pi
            for name, joint in self.joints
        }
        position = {name: rng.uniform(-most, most) for name, most in reach.items()}
        for name in self.mimics:
            master, factor, offset = self._master(name)
            position[name] = factor * position.get(master, 0.0) + offset
        pin_q, q = np.zeros(self.model.nq), np.zeros(len(self.places))
        for name, joint in self.joints:
            self._put(name, joint, position[name], pin_q, q, rng)
        pin_v = self.G @ rng.normal(size=self.G.shape[1])
        v = np.zeros(self.model.nv)
        v[self.columns] = pin_v
        return State(pin_q, pin_v, q, v)

    def _put(
        self,
        name: str,
        joint: Any,
        value: float,
        pin_q: np.ndarray,
        q: np.ndarray,
        rng: np.random.Generator,
    ) -> None:
        own = self.ours[name]
        if joint.nv == 6:
            place, turn = rng.normal(size=3), rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            pin_q[joint.idx_q : joint.idx_q + 7] = [*place, *turn[1:], turn[0]]  # x, y, z, w
            first = self.places[f"{own}_x"]
            q[first : first + 7] = [*place, *turn]
        else:
            pin_q[joint.idx_q : joint.idx_q + joint.nq] = (
                value if joint.nq == 1 else [np.cos(value), np.sin(value)]
            )
            q[self.places[own]] = value

    def regular_state(self, rng: np.random.Generator, report: Report) -> State:
        """A state at which accelerations are determined to better than the tolerance; others are
        drawn again and counted.

        Robots with links whose inertia is zero have poses at which M is as good as singular.
        """
        while True:
            s = self.state(rng)
            M = self.G.T @ self.mass(s) @ self.G
            scale = 1 / np.sqrt(np.maximum(np.diag(M), 1e-300))
            if (
                np.linalg.cond(M * np.outer(scale, scale)) < ILL_CONDITIONED
                or report.redrawn >= STATES
            ):
                return s
            report.redrawn += 1

    def mass(self, s: State) -> np.ndarray:
        M = np.triu(self.pin.crba(self.model, self.data, s.pin_q))
        return M + np.triu(M, 1).T

    def bias(self, s: State) -> np.ndarray:
        return np.asarray(self.pin.nonLinearEffects(self.model, self.data, s.pin_q, s.pin_v))

    def acceleration(self, s: State, force: np.ndarray) -> np.ndarray:
        """By `aba`; where joints mimic others, on the independent joints. Pinocchio leaves damping
        and friction to its user."""
        total = (
            force
            - np.asarray(self.model.damping) * s.pin_v
            - self.friction * np.tanh(s.pin_v / self.width)
        )
        if not self.mimics:
            return np.asarray(self.pin.aba(self.model, self.data, s.pin_q, s.pin_v, total))
        G = self.G
        return G @ np.linalg.solve(G.T @ self.mass(s) @ G, G.T @ (total - self.bias(s)))


def mimics(file: Path) -> dict[str, tuple[str, float, float]]:
    """Joint → master, multiplier, offset, read without hamel."""
    found = {}
    for joint in ElementTree.parse(file).getroot().findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed":
            numbers = float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))
            found[joint.get("name", "")] = (mimic.get("joint", ""), *numbers)
    return found


def friction_widths(model: Model) -> dict[str, float]:
    """Joint → the width that the importer gave its dry friction: a choice, told in the model."""
    owners = {velocity.name: velocity.owner for velocity in model.velocities}
    return {
        owners[load.velocity]: number(load.smoothing, {})
        for load in model.loads
        if isinstance(load, JointFriction)
    }


def frictions(file: Path) -> dict[str, float]:
    """Joint → Coulomb friction, read without hamel."""
    joints = ElementTree.parse(file).getroot().findall("joint")
    found = {joint.get("name", ""): joint.find("dynamics") for joint in joints}
    return {
        name: float(dynamics.get("friction", 0.0))
        for name, dynamics in found.items()
        if dynamics is not None
    }


def _check_state(
    peer: Peer,
    ours: dict[str, ca.Function],
    derived: Equations,
    rng: np.random.Generator,
    report: Report,
) -> tuple[np.ndarray, np.ndarray, State]:
    s = peer.regular_state(rng, report)
    u = rng.normal(size=len(derived.system.model.inputs)) * 10.0
    force = np.zeros(peer.model.nv)
    drives = {given.velocity: u[i] for i, given in enumerate(derived.system.model.inputs)}
    applied = np.array([drives.get(v.name, 0.0) for v in derived.system.model.velocities])
    force = applied[peer.columns]
    x = np.asarray(ours["state"](0.0, np.concatenate([s.q, s.v]), u, [])).ravel()
    into = np.ix_(peer.columns, peer.columns)
    M, h = np.asarray(ours["mass"](0.0, x, u, [])), np.asarray(ours["bias"](0.0, x, u, [])).ravel()
    rates = np.asarray(ours["dynamics"](0.0, x, u, [])).ravel()[len(s.q) :]
    vdot = np.asarray(ours["S"](0.0, x, u, [])) @ rates  # couplings are constant: S does not turn
    _note(report, "mass", M[into], peer.mass(s))
    _note(report, "bias", h[peer.columns], peer.bias(s))
    _note(report, "dynamics", vdot[peer.columns], peer.acceleration(s, force))
    return x, u, s


def _note(report: Report, name: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    size = float(np.max(np.abs(theirs))) or 1.0  # where theirs is zero, ours has to be as well
    error = (
        float(np.max(np.abs(ours - theirs))) / size
        if np.all(np.isfinite(ours - theirs))
        else np.inf
    )
    report.errors[name] = max(report.errors.get(name, 0.0), error)


class Mujoco:
    """MuJoCo's model of the same file: its own order of joints; free bodies move with velocities in
    the ground frame."""

    def __init__(self, file: Path, found: Imported) -> None:
        import mujoco

        self.mj: Any = mujoco
        self.model = (
            _without_geometry(file)
            if file.suffix == ".urdf"
            else mujoco.MjModel.from_xml_path(str(file))
        )
        off = mujoco.mjtDisableBit
        acts = not self.model.opt.disableflags & (off.mjDSBL_CONSTRAINT | off.mjDSBL_FRICTIONLOSS)
        self.friction = self.model.dof_frictionloss * acts
        self.model.opt.disableflags |= (
            off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_CLAMPCTRL
        )
        # what `hamel import` says it leaves out: clamped forces, the medium around the bodies
        self.model.actuator_forcelimited[:] = self.model.jnt_actfrclimited[:] = 0
        self.model.opt.density = self.model.opt.viscosity = 0.0
        self.data = mujoco.MjData(self.model)
        theirs = [self.model.joint(i) for i in range(self.model.njnt)]
        ours = [joint.name for joint in found.model.joints if joint.type != "fixed"]
        named = all(joint.name for joint in theirs)  # else they stand in the order of the file
        self.joints = [
            (joint, found.joints[joint.name] if named else own) for joint, own in zip(theirs, ours)
        ]
        self.model_of_ours = found.model
        self.width = np.ones(self.model.nv)
        widths = friction_widths(found.model)
        for joint, own in self.joints:
            self.width[joint.dofadr[0]] = widths.get(own, 1.0)

    def _slots(self, joint: Any, own: str) -> tuple[list[int], list[int]]:
        """Indices in our q and v of a joint of MuJoCo."""
        model = self.model_of_ours
        return (
            [i for i, c in enumerate(model.coordinates) if c.owner == own],
            [i for i, v in enumerate(model.velocities) if v.owner == own],
        )

    def put(self, q: np.ndarray, v: np.ndarray, u: np.ndarray, z: np.ndarray) -> None:
        """Our state and inputs into MuJoCo's data, with friction as the importer smooths it; then
        everything is evaluated. Activations z stand in the order of the file."""
        for joint, own in self.joints:
            places, columns = self._slots(joint, own)
            self.data.qpos[joint.qposadr[0] : joint.qposadr[0] + len(places)] = q[places]
            rates = v[columns]
            if len(columns) == 6:
                rates = np.concatenate([_rotation(q[places[3:]]) @ rates[:3], rates[3:]])
            self.data.qvel[joint.dofadr[0] : joint.dofadr[0] + len(columns)] = rates
        self.data.qfrc_applied[:] = -self.friction * np.tanh(self.data.qvel / self.width)
        self.data.act[:] = z
        if self.model.nu:
            self.data.ctrl[:] = u
        else:  # a URDF has no actuators
            drives = [given.velocity for given in self.model_of_ours.inputs]
            force = [
                u[drives.index(w.name)] if w.name in drives else 0.0
                for w in self.model_of_ours.velocities
            ]
            self.data.qfrc_applied[:] += self.theirs(q, np.zeros_like(v), np.array(force))
        self.mj.mj_forward(self.model, self.data)

    def theirs(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """Our acceleration in MuJoCo's velocities."""
        result = np.zeros(self.model.nv)
        for joint, own in self.joints:
            places, columns = self._slots(joint, own)
            a, w = vdot[columns], v[columns]
            if len(columns) == 6:
                a = np.concatenate(
                    [_rotation(q[places[3:]]) @ (a[:3] + np.cross(w[3:], w[:3])), a[3:]]
                )
            result[joint.dofadr[0] : joint.dofadr[0] + len(columns)] = a
        return result

    def mass(self) -> np.ndarray:
        M = np.zeros((self.model.nv, self.model.nv))
        self.mj.mj_fullM(self.model, self.data, M)
        return M

    def rows(self) -> np.ndarray:
        """The Jacobian of the equality constraints."""
        rows = [
            i
            for i in range(self.data.nefc)
            if self.data.efc_type[i] == self.mj.mjtConstraint.mjCNSTR_EQUALITY
        ]
        J = np.zeros((self.data.nefc, self.model.nv))
        if self.data.nefc:
            J = np.array(self.data.efc_J).reshape(self.data.nefc, self.model.nv)
        return J[rows]


def _without_geometry(file: Path) -> Any:
    import mujoco

    root = ElementTree.parse(file).getroot()
    for link in root.findall("link"):
        for child in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(child)
    for extra in [child for child in root if child.tag not in ("link", "joint")]:
        root.remove(extra)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def against_mujoco(file: Path) -> Report:
    """Accelerations of one robot beside MuJoCo's; loops are soft there, so M v̇ = forces + Jᵀ λ is
    checked."""
    report = Report(file.name, "", "agreed")
    found = imported(file)
    mechanics = system(found.model, "all")
    derived = equations(mechanics)
    report.velocities, report.mimics = mechanics.v.numel(), len(mechanics.rows)
    ours = {name: _function(derived, name) for name in ("dynamics", "state")} | {
        "S": _span(derived)
    }
    peer, rng = Mujoco(file, found), np.random.default_rng(2)
    sample = states(mechanics, STATES, rng) if mechanics.rows else None
    for k in range(STATES if sample is None else len(sample.t)):  # fewer where few are closed
        q = rng.normal(size=mechanics.q.numel()) if sample is None else sample.q[k]
        for start in mechanics.quaternions:
            q[start : start + 4] /= np.linalg.norm(q[start : start + 4])
        v, u, z = (rng.normal(size=x.numel()) for x in (mechanics.v, mechanics.u, mechanics.z))
        _mujoco_state(peer, ours, q, (v, u, z), report)
    if not report.errors:
        report.verdict, report.reason = "failed", "no state satisfies its constraints"
        return report
    worst = max(report.errors.values())
    if not worst <= TOLERANCE:
        report.verdict, report.reason = "wrong", f"accelerations differ by {worst:.1e}"
    return report


def _mujoco_state(
    peer: Mujoco,
    ours: dict[str, ca.Function],
    q: np.ndarray,
    given: tuple[np.ndarray, np.ndarray, np.ndarray],
    report: Report,
) -> None:
    v, u, z = given
    x = np.asarray(ours["state"](0.0, np.concatenate([q, v, z]), u, [])).ravel()
    w = slice(len(q), len(x) - len(z))

    def span(x: np.ndarray) -> np.ndarray:
        """The columns of S that belong to the quasi-velocities."""
        return np.asarray(ours["S"](0.0, x, u, []))[:, : w.stop - w.start]

    S = span(x)
    v = S @ x[w]
    rates = np.asarray(ours["dynamics"](0.0, x, u, [])).ravel()
    turning = _directional(span, x, rates)
    vdot = S @ rates[w] + turning @ x[w]
    peer.put(q, v, u, z)
    if len(z):
        _note(report, "activation", rates[w.stop :], np.array(peer.data.act_dot))
    accelerations = peer.theirs(q, v, vdot)
    if not len(peer.rows()):
        return _note(report, "dynamics", accelerations, np.array(peer.data.qacc_smooth))
    force = peer.mass() @ (accelerations - peer.data.qacc_smooth)
    multipliers = np.linalg.lstsq(peer.rows().T, force, rcond=None)[0]
    _note(report, "reaction", peer.rows().T @ multipliers, force)


def _directional(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, along: np.ndarray
) -> np.ndarray:
    """Derivative of a function along a direction; zero where it does not change."""
    step = 1e-6 / max(1.0, float(np.max(np.abs(along))))
    return (function(x + step * along) - function(x - step * along)) / (2 * step)


def robots() -> Path:
    """Where example-robot-data put its robots, beside the other packages of this Python."""
    for folder in sys.path:
        place = Path(folder) / "cmeel.prefix/share/example-robot-data/robots"
        if place.is_dir():
            return place
    raise SystemExit("example-robot-data is not installed: use `make robots`")


def reports(root: Path, wanted: str) -> Iterator[Report]:
    files = [file for file in sorted(root.rglob("*.urdf")) if wanted in str(file)]
    with ProcessPoolExecutor(max_workers=2, mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(compared, root, file, floating)
            for file in files
            for floating in (False, True)
        ]
        for job in jobs:
            yield job.result()


def line(r: Report) -> str:
    """One row of the table."""
    errors = " ".join(f"{name} {error:.0e}" for name, error in r.errors.items())
    seconds = " ".join(f"{name} {s:.2f}" for name, s in r.seconds.items())
    size = f"{r.velocities:3d} v" + (f", {r.mimics} mimic" if r.mimics else "")
    errors += ", with an inertia of no body" if r.waived else ""
    errors += f", {r.redrawn} singular states drawn again" if r.redrawn else ""
    return f"{r.verdict:8} {r.robot:60} {r.base:5} {size:14} {r.operations or '':>6} {r.reason or errors}  [{seconds} s]"


def main(arguments: list[str]) -> int:
    found = []
    for report in reports(robots(), arguments[0] if arguments else ""):
        found.append(report)
        print(line(report), flush=True)
    for file in (
        sorted(OWN.glob("*.xml")) + sorted(OWN.glob("arm.urdf"))
        if len(arguments) == 0 or "mujoco" in arguments
        else []
    ):
        found.append(against_mujoco(file))
        print(line(found[-1]), flush=True)
    for base in ("fixed", "free"):
        verdicts = [report.verdict for report in found if report.base == base]
        counts = {
            verdict: verdicts.count(verdict) for verdict in ("agreed", "refused", "wrong", "failed")
        }
        print(
            f"{base} base: {len(verdicts)} robots, "
            + ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
        )
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps([asdict(report) for report in found], indent=1) + "\n")
    return int(any(report.verdict in ("wrong", "failed") for report in found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
