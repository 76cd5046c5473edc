"""The bicycle as a state-space object of python-control (pip install control): A, B, C, D with the
names of states and inputs.

Run it in the repository: python examples/bicycle_state_space.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import hamel
import hamel.records

MODEL = Path(__file__).parent.parent / "models" / "bicycle.yaml"
STATES = ("lean", "steer", "lean_dot", "steer_dot")


def lateral(record: hamel.records.Linearized) -> tuple[np.ndarray, np.ndarray]:
    """A and B of lean and steer: nothing of the rest acts back on them."""
    kept = [record.states.index(name) for name in STATES]
    return np.array(record.A)[np.ix_(kept, kept)], np.array(record.B)[kept, :1]


def state_space(speed: float) -> Any:
    """From steer torque to lean and steer, at a forward speed in m/s."""
    import control

    A, B = lateral(
        hamel.linearize(MODEL, values={"speed": speed}, sweep={"speed": f"{speed}:{speed}:1"})
    )
    C, D = np.eye(2, 4), np.zeros((2, 1))
    return control.ss(
        A, B, C, D, states=list(STATES), inputs=["steer_torque"], outputs=["lean", "steer"]
    )


if __name__ == "__main__":
    print(state_space(5.0))
