"""Nonlinear model predictive control by CasADi's Opti and IPOPT on symbols of the casadi target:
it swings a pole up on its cart, and a four-bar linkage to its highest position, with less torque
than would lift it there. The motion is that of the compiled module.

Run it in the repository: python examples/nmpc_swing_up.py
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np

import hamel

MODELS = Path(__file__).parent.parent / "models"
STEP, STEPS = 0.05, 40  # of the horizon, 2 s
HIGHEST = 1.404615  # rad, where the potential energy of the four-bar is largest


@dataclass(frozen=True)
class Task:
    """A model with one input, and what is asked of it. `start`: near which state it begins, at
    rest; `running` and `last`: costs of states (nx × k) within the horizon and at its end;
    `parameters`: those that the controller takes otherwise than the motion."""

    model: str
    start: tuple[float, ...]
    limit: float
    seconds: float
    running: Callable[[ca.MX], ca.MX]
    last: Callable[[ca.MX], ca.MX]
    parameters: dict[str, float] = field(default_factory=dict)


def from_upright(x: ca.MX) -> ca.MX:
    """1 − cos: an angle of one turn more is as good."""
    return ca.sum2(1 - ca.cos(x[1, :]))


def from_highest(x: ca.MX) -> ca.MX:
    return ca.sum2(1 - ca.cos(x[0, :] - HIGHEST))


CART_POLE = Task(
    model="cart_pole",
    start=(0.0, np.pi, 0.0, 0.0),
    limit=10.0,  # N
    seconds=4.0,
    running=lambda x: (
        5 * from_upright(x)
        + ca.sumsqr(x[0, :])
        + 0.05 * ca.sumsqr(x[2, :])
        + 0.05 * ca.sumsqr(x[3, :])
    ),
    last=lambda x: 20 * from_upright(x) + x[0] ** 2 + x[3] ** 2,
    parameters={"vs": 0.1},  # its track is smoother than the real one
)
FOUR_BAR = Task(
    model="four_bar",
    start=(4.4034, -3.4257, 2.5470, 0.0),  # at its lowest
    limit=3.0,  # N·m; gravity takes 5.6 on the way
    seconds=4.0,
    running=lambda x: 5 * from_highest(x) + 0.02 * ca.sumsqr(x[3, :]),
    last=lambda x: 20 * from_highest(x) + 0.2 * x[3] ** 2,
)


def generated(folder: Path) -> ModuleType:
    """The functions of symbols, imported as any file would be."""
    name = f"{folder.name}_casadi"
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def step(dynamics: ca.Function, p: np.ndarray) -> ca.Function:
    """The state after a classical Runge-Kutta step with the input held."""
    x, u = ca.MX.sym("x", dynamics.size1_in(1)), ca.MX.sym("u")
    k1 = dynamics(0, x, u, p)
    k2 = dynamics(0, x + STEP / 2 * k1, u, p)
    k3 = dynamics(0, x + STEP / 2 * k2, u, p)
    k4 = dynamics(0, x + STEP * k3, u, p)
    return ca.Function("step", [x, u], [x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


class Controller:
    """Solves for the inputs over the horizon, from where the last solution was."""

    def __init__(self, task: Task, ahead: ca.Function) -> None:
        size = len(task.start)
        self.problem = ca.Opti()
        self.x = self.problem.variable(size, STEPS + 1)
        self.u = self.problem.variable(1, STEPS)
        self.start = self.problem.parameter(size)
        effort = 1e-3 * ca.sumsqr(self.u)
        self.problem.minimize(task.running(self.x) + task.last(self.x[:, -1]) + effort)
        self.problem.subject_to(self.x[:, 0] == self.start)
        self.problem.subject_to(self.x[:, 1:] == ahead.map(STEPS)(self.x[:, :-1], self.u))
        self.problem.subject_to(self.problem.bounded(-task.limit, self.u, task.limit))
        self.problem.solver(
            "ipopt", {"expand": True, "print_time": False}, {"print_level": 0, "sb": "yes"}
        )
        self.problem.set_initial(self.x, np.tile(np.array(task.start)[:, None], STEPS + 1))

    def __call__(self, x: np.ndarray) -> float:
        """The first input of the best motion from x."""
        self.problem.set_value(self.start, x)
        solution = self.problem.solve()
        self.problem.set_initial(self.x, solution.value(self.x))
        self.problem.set_initial(self.u, solution.value(self.u))
        return float(solution.value(self.u[0]))


def swing_up(task: Task) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of the motion under the controller."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / task.model
        built = hamel.build(MODELS / f"{task.model}.yaml", out=place, targets=["casadi"]).folder
        module, symbols = hamel.load(built), generated(built)
        p = module.defaults.copy()
        for name, value in task.parameters.items():
            p[module.parameters.index(name)] = value
        control = Controller(task, step(symbols.function("dynamics"), p))
        motion = module.simulate(
            (0.0, task.seconds),
            module.project(0.0, np.array(task.start)) if hasattr(module, "project") else task.start,
            lambda t, x: [control(x)],
            sample=STEP,
            times=np.arange(0.0, task.seconds + STEP / 2, STEP),
        )
    return motion.t, motion.x


def main() -> None:
    """Swing up, and stay."""
    times, states = swing_up(CART_POLE)
    for t, x in list(zip(times, states))[::8]:
        print(f"t = {t:4.1f} s   cart {x[0]: .3f} m   pole {np.degrees(x[1]): 8.2f} deg")
    times, states = swing_up(FOUR_BAR)
    for t, x in list(zip(times, states))[::8]:
        print(f"t = {t:4.1f} s   crank {np.degrees(x[0]): 8.2f} deg   {x[3]: 7.2f} rad/s")


if __name__ == "__main__":
    main()
