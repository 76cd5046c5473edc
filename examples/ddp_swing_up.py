"""Differential dynamic programming with the exact second derivatives: the cart and pole is swung up
from hanging, then the motion runs under the feedback that the backward pass leaves behind.

One call of `derivatives` gives ẋ and both Jacobians along the whole path; `contraction` gives
Σ yₖ ∂²ẋₖ along every direction at once. Without it the method is iLQR. Source: D. Q. Mayne, Int. J.
Control 3 (1966) 85–95.

Run it in the repository: python examples/ddp_swing_up.py
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

import hamel

MODEL = Path(__file__).parent.parent / "models" / "cart_pole.yaml"
STEP, STEPS = 0.02, 125  # 2.5 s
HANGING = np.array([0.0, np.pi, 0.0, 0.0])
MOST, ENOUGH = 200, 1e-9  # iterations, and the part of the cost that is worth another one
EFFORT = 1e-3
WEIGHTS = np.array([1.0, 0.0, 0.05, 0.05])  # of s², th is weighted by 1 − cos th, der(s)², der(th)²
UPRIGHT = 1.0
LAST = 200.0  # times that, at the end
FAR = 100.0  # m, rad, m/s, rad/s: no path worth looking at
SMOOTH = 0.2  # m/s: the plan is made on a smoother track than the real one


@dataclass
class Plan:
    """States (STEPS + 1), inputs (STEPS), feedback K of u = u_k − K_k (x − x_k), the cost of every
    iteration."""

    x: np.ndarray
    u: np.ndarray
    K: np.ndarray
    costs: list[float]


def cost(x: np.ndarray, u: np.ndarray) -> float:
    """Euler's sum of the running cost and what the end costs."""
    states = UPRIGHT * (1 - np.cos(x[:, 1])) + 0.5 * x**2 @ WEIGHTS
    running = np.sum(states[:-1]) + 0.5 * EFFORT * np.sum(u**2)
    return float(STEP * (running + LAST * states[-1]))


def slopes(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and Hessian of the cost of a state."""
    gradient, hessian = WEIGHTS * x, np.diag(WEIGHTS)
    gradient[1] += UPRIGHT * np.sin(x[1])
    hessian[1, 1] += UPRIGHT * np.cos(x[1])
    return STEP * gradient, STEP * hessian


class Problem:
    """The module's ẋ by Euler's steps: x⁺ = x + h ẋ."""

    def __init__(self, module: ModuleType, exact: bool) -> None:
        self.module, self.exact = module, exact
        self.p = module.defaults.copy()
        self.p[module.parameters.index("vs")] = SMOOTH
        self.nx, self.nu = len(module.states), len(module.inputs)

    def rolled(
        self, plan: Plan, steps: np.ndarray, share: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Forward along the corrected inputs, feedback in; None where that runs away."""
        x, u = [HANGING], []
        for k in range(STEPS):
            u.append(plan.u[k] + share * steps[k] - plan.K[k] @ (x[k] - plan.x[k]))
            if np.max(np.abs(x[k])) > FAR:
                return None
            x.append(x[k] + STEP * self.module.dynamics(0.0, x[k], u[k], self.p))
        return np.array(x), np.array(u)

    def curvature(self, x: np.ndarray, u: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Σ yₖ ∂²ẋₖ/∂(x, u)², a row per direction; zero for iLQR."""
        directions = np.eye(self.nx + self.nu)
        if not self.exact:
            return 0.0 * directions
        rows = [np.concatenate([x, y, d]) for d in directions]
        return self.module.contraction(0.0, np.array(rows), u, self.p)

    def backward(self, plan: Plan, damping: float) -> tuple[np.ndarray, np.ndarray, float] | None:
        """Input corrections, feedback and the promised descent; None where an input's cost does not
        bend upwards."""
        nx = self.nx
        D = self.module.derivatives(0.0, plan.x[:-1], plan.u, self.p)
        fx, fu = np.eye(nx) + STEP * D[:, :, 1 : 1 + nx], STEP * D[:, :, 1 + nx :]
        steps, K, promise = np.zeros_like(plan.u), np.zeros_like(plan.K), 0.0
        Vx, Vxx = (LAST * part for part in slopes(plan.x[-1]))
        for k in reversed(range(STEPS)):
            lx, lxx = slopes(plan.x[k])
            bend = STEP * self.curvature(plan.x[k], plan.u[k], Vx)
            Qx, Qu = lx + fx[k].T @ Vx, STEP * EFFORT * plan.u[k] + fu[k].T @ Vx
            Qxx = lxx + fx[k].T @ Vxx @ fx[k] + bend[:nx, :nx]
            Qux = fu[k].T @ Vxx @ fx[k] + bend[nx:, :nx]
            Quu = STEP * EFFORT * np.eye(self.nu) + fu[k].T @ Vxx @ fu[k] + bend[nx:, nx:]
            Quu = Quu + damping * np.eye(self.nu)
            if np.min(np.linalg.eigvalsh(Quu)) <= 0.0:
                return None
            steps[k], K[k] = -np.linalg.solve(Quu, Qu), np.linalg.solve(Quu, Qux)
            promise += float(Qu @ steps[k])
            Vx = Qx - K[k].T @ Qu
            Vxx = Qxx - K[k].T @ Qux
            Vxx = 0.5 * (Vxx + Vxx.T)
        return steps, K, promise


def optimised(module: ModuleType, exact: bool = True) -> Plan:
    """Until an iteration gains next to nothing; damping goes up where one is no descent."""
    problem, damping = Problem(module, exact), 1e-4
    u = 0.1 * np.sin(np.linspace(0.0, 6.0, STEPS))[:, None]
    plan = Plan(np.zeros((STEPS + 1, 4)), u, np.zeros((STEPS, 1, 4)), [])
    start = problem.rolled(plan, np.zeros_like(u), 0.0)
    assert start is not None  # pushed gently
    plan.x, plan.u = start
    plan.costs.append(cost(plan.x, plan.u))
    while len(plan.costs) < MOST and damping < 1e6:
        found = problem.backward(plan, damping)
        gained = found is not None and _searched(problem, plan, *found)
        if not gained:
            damping = max(4.0 * damping, 1e-6)
            continue
        damping = 0.25 * damping if damping > 1e-8 else 0.0
        if plan.costs[-2] - plan.costs[-1] < ENOUGH * plan.costs[-1]:
            break
    return plan


def _searched(
    problem: Problem, plan: Plan, steps: np.ndarray, K: np.ndarray, promise: float
) -> bool:
    """Whether a share of the steps brings a tenth of what it promises; the plan then takes it."""
    wanted = Plan(plan.x, plan.u, K, plan.costs)
    for share in 0.5 ** np.arange(8):
        path = problem.rolled(wanted, steps, share)
        if path and cost(*path) < plan.costs[-1] + 0.1 * share * promise:
            (plan.x, plan.u), plan.K = path, K
            plan.costs.append(cost(*path))
            return True
    return False


def main() -> tuple[Plan, Plan, np.ndarray]:
    """Both methods, and the exact one's plan on the module, held by its feedback."""
    with tempfile.TemporaryDirectory() as folder:
        functions = ("default", "derivatives", "contraction")
        built = hamel.build(MODEL, out=Path(folder) / "cart_pole", functions=functions)
        module = hamel.load(built.folder)
        exact, plain = optimised(module), optimised(module, exact=False)
        p = module.defaults.copy()
        p[module.parameters.index("vs")] = SMOOTH

        def held(t: float, x: np.ndarray) -> np.ndarray:
            k = min(round(t / STEP), STEPS - 1)
            return exact.u[k] - exact.K[k] @ (x - exact.x[k])

        end = STEP * STEPS
        motion = module.simulate((0.0, end), HANGING, held, p, sample=STEP)
    for name, plan in (("DDP", exact), ("iLQR", plain)):
        print(f"{name}: {len(plan.costs) - 1} iterations, cost {plan.costs[-1]:.6f}")
    angle = np.degrees(motion.x[-1][1])
    print(f"after {end:g} s: cart {motion.x[-1][0]: .3f} m, pole {angle: .2f} deg")
    return exact, plain, motion.x


if __name__ == "__main__":
    main()
