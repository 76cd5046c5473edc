"""A snake robot that finds its way by sampling: model predictive path integral control (G.
Williams, A. Aldrich, E. A. Theodorou, 2017) with 4,096 rollouts per tick.

Each tick, torques are drawn about the plan, all motions go side by side through the compiled
integrator, and the plan becomes their mean, weighted by exp(−cost/λ). Rollouts of one tick need an
answer in milliseconds, so they run in lanes and threads of this process; a cluster is for studies.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hamel

MODELS = Path(__file__).resolve().parent.parent / "models"
ROLLOUTS, HORIZON, KNOTS, SPREAD, COLD = 4096, 1.2, 6, 0.25, 0.02
TICK = HORIZON / KNOTS
GOAL = np.array([0.6, 0.4])


class Controller:
    """Torques at the knots of a horizon, held in between."""

    def __init__(self, module, rollouts=ROLLOUTS, seed=0):
        self.module, self.rollouts = module, rollouts
        self.rng = np.random.default_rng(seed)
        self.plan = np.zeros((KNOTS, module.nu))

    def costs(self, x, torques):
        """Of every rollout from x: distance to the goal on the way and at the end, and torque."""
        m, k = self.module, len(torques)
        state, cost = np.tile(x, (k, 1)), 1e-2 * np.sum(torques**2, axis=(1, 2))
        for knot in range(KNOTS):
            motions = m.simulate(
                (0.0, TICK), state, torques[:, knot], integrator="rk4", step_size=TICK / 4,
                times=np.array([TICK]), enforcement="none", threads=os.cpu_count() or 1,
            )  # fmt: skip
            state = motions.x[:, -1]
            away = np.linalg.norm(state[:, :2] - GOAL, axis=1)
            cost += away * (3.0 if knot == KNOTS - 1 else 0.3)
            cost += 0.05 * np.sum(np.maximum(np.abs(state[:, 3:5]) - 1.2, 0.0) ** 2, axis=1)
        return np.where(np.isfinite(cost), cost, np.inf)

    def __call__(self, x):
        """The torques of the next tick."""
        drawn = self.plan + SPREAD * self.rng.standard_normal(
            (self.rollouts, KNOTS, self.module.nu)
        )
        drawn[0] = self.plan
        cost = self.costs(x, drawn)
        weights = np.exp(-(cost - cost.min()) / COLD)
        self.plan = np.tensordot(weights / weights.sum(), drawn, axes=1)
        first = self.plan[0].copy()
        self.plan = np.vstack([self.plan[1:], self.plan[-1:]])
        return first


def driven(module, seconds=6.0, rollouts=ROLLOUTS):
    """Distances to the goal, tick by tick, and the seconds of each tick."""
    control, x = Controller(module, rollouts), np.zeros(module.nx)
    x[3:5] = 0.4, -0.3  # hinges off the straight line, where torques move nothing
    away, took = [], []
    for _ in range(round(seconds / TICK)):
        begin = time.perf_counter()
        u = control(x)
        took.append(time.perf_counter() - begin)
        x = module.simulate((0.0, TICK), x, u, integrator="rk4", step_size=TICK / 8).x[-1]
        away.append(float(np.linalg.norm(x[:2] - GOAL)))
    return np.array(away), np.array(took)


def snake(place):
    """The module; its heading is good wherever the links are."""
    built = hamel.build(MODELS / "snake3.yaml", choice="head", integrators=["rk4"], out=place)
    return hamel.load(built.folder)


def main(seconds="6"):
    with tempfile.TemporaryDirectory() as place:
        away, took = driven(snake(Path(place) / "snake3"), float(seconds))
    print(f"from {np.linalg.norm(GOAL):.2f} m to {away[-1]:.2f} m in {len(away) * TICK:g} s")
    print(f"{ROLLOUTS} rollouts of {HORIZON:g} s: {1e3 * np.median(took):.0f} ms per tick")


if __name__ == "__main__":
    main(*sys.argv[1:])
