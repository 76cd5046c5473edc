"""Nonlinear model predictive control of the cart and pole: CasADi's Opti and IPOPT swing it up from
hanging, on the symbols of the casadi target; the motion is that of the compiled module.

Run it in the repository: python examples/nmpc_cart_pole.py
"""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np

import hamel

MODEL = Path(__file__).parent.parent / "models" / "cart_pole.yaml"
STEP, STEPS = 0.05, 40  # of the horizon, 2 s
SECONDS = 4.0
LIMIT = 10.0  # N
HANGING = np.array([0.0, np.pi, 0.0, 0.0])


def generated(folder: Path) -> ModuleType:
    """The functions of symbols, imported as any file would be."""
    spec = importlib.util.spec_from_file_location(
        "cart_pole_casadi", folder / "cart_pole_casadi.py"
    )
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def step(dynamics: ca.Function, p: np.ndarray) -> ca.Function:
    """The state after a classical Runge-Kutta step with the input held."""
    x, u = ca.MX.sym("x", 4), ca.MX.sym("u")
    k1 = dynamics(0, x, u, p)
    k2 = dynamics(0, x + STEP / 2 * k1, u, p)
    k3 = dynamics(0, x + STEP / 2 * k2, u, p)
    k4 = dynamics(0, x + STEP * k3, u, p)
    return ca.Function("step", [x, u], [x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


class Controller:
    """Solves for the inputs over the horizon, from where the last solution was."""

    def __init__(self, ahead: ca.Function) -> None:
        self.problem = ca.Opti()
        self.x = self.problem.variable(4, STEPS + 1)
        self.u = self.problem.variable(1, STEPS)
        self.start = self.problem.parameter(4)
        self.problem.minimize(self._cost())
        self.problem.subject_to(self.x[:, 0] == self.start)
        self.problem.subject_to(self.x[:, 1:] == ahead.map(STEPS)(self.x[:, :-1], self.u))
        self.problem.subject_to(self.problem.bounded(-LIMIT, self.u, LIMIT))
        self.problem.solver(
            "ipopt", {"expand": True, "print_time": False}, {"print_level": 0, "sb": "yes"}
        )

    def _cost(self) -> ca.MX:
        """1 − cos: an angle of one turn more is as good."""
        s, th, s_dot, th_dot = (self.x[k, :] for k in range(4))
        running = ca.sumsqr(s) + 0.05 * ca.sumsqr(s_dot) + 0.05 * ca.sumsqr(th_dot)
        upright = ca.sum2(1 - ca.cos(th))
        last = 20 * (1 - ca.cos(th[-1])) + s[-1] ** 2 + th_dot[-1] ** 2
        return running + 5 * upright + last + 1e-3 * ca.sumsqr(self.u)

    def __call__(self, x: np.ndarray) -> float:
        """The first input of the best motion from x."""
        self.problem.set_value(self.start, x)
        solution = self.problem.solve()
        self.problem.set_initial(self.x, solution.value(self.x))
        self.problem.set_initial(self.u, solution.value(self.u))
        return float(solution.value(self.u[0]))


def main() -> np.ndarray:
    """Swing up, and stay. The controller's track is smoother than the real one, on which the motion
    runs."""
    with tempfile.TemporaryDirectory() as folder:
        built = hamel.build(MODEL, out=Path(folder) / "cart_pole", targets=["casadi"]).folder
        module, symbols = hamel.load(built), generated(built)
        p = module.defaults.copy()
        p[module.parameters.index("vs")] = 0.1
        control = Controller(step(symbols.function("dynamics"), p))
        motion = module.simulate(
            (0.0, SECONDS),
            HANGING,
            lambda t, x: [control(x)],
            sample=STEP,
            times=np.arange(0.0, SECONDS + STEP / 2, STEP),
        )
    for t, x in list(zip(motion.t, motion.x))[::8]:
        print(f"t = {t:4.1f} s   cart {x[0]: .3f} m   pole {np.degrees(x[1]): 8.2f} deg")
    return motion.x


if __name__ == "__main__":
    main()
