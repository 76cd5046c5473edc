"""A Poincaré section: where many double pendulums of one energy pass through q2 = 0 with rising q2.

Run it in the repository: python examples/poincare_section.py [section.svg]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np

import hamel
from hamel.draw import Series, chart

MODEL = Path(__file__).parent.parent / "models" / "double_pendulum.yaml"
SECTION = "  theta2: angle(lower)\n"
EVENT = "events:\n  section: {formula: sin(q2), direction: rising}\n"


def built(folder: Path) -> ModuleType:
    """The model with the section as an event, compiled."""
    path = folder / "double_pendulum.yaml"
    path.write_text(MODEL.read_text("utf-8") + EVENT, "utf-8")
    return hamel.load(hamel.build(path, choice="absolute", out=folder / "module").folder)


def starts(module: ModuleType, energy: float, count: int) -> np.ndarray:
    """States with q2 = 0 and this energy in J above rest, their upper angles spread out."""
    x = np.zeros((count, 4))
    x[:, 0] = np.linspace(-0.6, 0.6, count)
    rest = module.energy(0.0, np.zeros(4))[1]
    left = energy + rest - module.energy(0.0, x)[:, 1]
    x[:, 2:] = 1.0  # both rods turn alike, as fast as the energy that is left allows
    x[:, 2:] *= np.sqrt(left / module.energy(0.0, x)[:, 0])[:, np.newaxis]
    return x


def section(module: ModuleType, x: np.ndarray, time: float) -> list[np.ndarray]:
    """q1 and the rate of q1 where each motion passes, an array of rows for each."""
    motions = module.simulate((0.0, time), x, rtol=1e-10, atol=1e-12)
    events = motions.events.of("section")
    angle = np.remainder(events.x[:, 0] + np.pi, 2 * np.pi) - np.pi
    points = np.stack([angle, events.x[:, 2]], axis=-1)
    return [points[events.row == row] for row in range(len(x))]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        module = built(Path(folder))
        x = starts(module, 8.0, 12)
        rows = section(module, x, 200.0)
    series = [Series(f"motion {k}", points.tolist(), "dots") for k, points in enumerate(rows)]
    text = chart(
        "double pendulum at q2 = 0", "q1 (rad) →", "rate of q1 (rad/s)", series, (False,) * 2
    )
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "section.svg")
    target.write_text(text, "utf-8")
    print(f"{sum(map(len, rows))} passages of {len(rows)} motions in {target}")


if __name__ == "__main__":
    main()
