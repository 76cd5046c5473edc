"""A linear-quadratic regulator for the cart and pole: linearised, designed with SciPy, run against
the nonlinear module in C.

Run it in the repository: python examples/lqr_cart_pole.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from scipy.linalg import solve_continuous_are

import hamel
import hamel.records

MODEL = Path(__file__).parent.parent / "models" / "cart_pole.yaml"
STEP, SECONDS = 1e-3, 6.0


def gains(record: hamel.records.Linearized, weights: list[float], effort: float) -> np.ndarray:
    """K of u = −K δx that minimises ∫ Σ weights δx² + effort u² dt, by the Riccati equation."""
    A, B = np.array(record.A), np.array(record.B)
    P = solve_continuous_are(A, B, np.diag(weights), np.array([[effort]]))
    return B.T @ P / effort


def closed_loop(module, K: np.ndarray, x: np.ndarray) -> np.ndarray:
    """States at 1 kHz, the input held over each step, the motion by classical Runge–Kutta steps of
    the compiled dynamics."""
    path = [x]
    for _ in range(round(SECONDS / STEP)):
        u = -K @ x
        k1 = module.dynamics(0.0, x, u)
        k2 = module.dynamics(0.0, x + STEP / 2 * k1, u)
        k3 = module.dynamics(0.0, x + STEP / 2 * k2, u)
        k4 = module.dynamics(0.0, x + STEP * k3, u)
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        path.append(x)
    return np.array(path)


def main() -> np.ndarray:
    """Linearise without the track's dry friction, which has no slope worth the name, then let the
    real pole fall from 10 degrees.

    What is left in the end is a slow swing of a few centimetres: dry friction and an unstable pole,
    held by a linear law.
    """
    record = hamel.linearize(MODEL, at="upright", values={"mu": "0 N"})
    K = gains(record, weights=[10.0, 100.0, 1.0, 1.0], effort=0.1)
    with tempfile.TemporaryDirectory() as folder:
        module = hamel.load(
            hamel.build(MODEL, choice=record.choice, out=Path(folder) / "cart_pole").folder
        )
        assert record.states == module.states
        path = closed_loop(module, K, np.array([0.0, np.radians(10), 0.0, 0.0]))
    print("gains", dict(zip(record.states, K[0].round(3))))
    for k in range(0, len(path), 500):
        print(
            f"t = {k * STEP:4.1f} s   cart {path[k, 0]: .4f} m   "
            f"pole {np.degrees(path[k, 1]): .4f} deg"
        )
    return path


if __name__ == "__main__":
    main()
