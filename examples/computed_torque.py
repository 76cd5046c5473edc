"""Computed torque on a closed loop, in C: a four-bar's crank follows a given motion.

The controller is computed_torque.c: it calls `inverse_dynamics_u` of the generated module and
nothing of hamel. Run it in the repository: python examples/computed_torque.py
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import hamel

HERE = Path(__file__).resolve().parent
MODEL = HERE.parent / "models" / "four_bar.yaml"


def program(folder: Path, compiler: Sequence[str] = ("cc",)) -> Path:
    """The controller with the module, compiled."""
    functions = ["default", "inverse_dynamics_u"]
    built = hamel.build(MODEL, out=folder / "four_bar", choice="crank", functions=functions)
    target = folder / "computed_torque"
    sources = [HERE / "computed_torque.c", built.folder / "four_bar.c"]
    flags = ["-std=c99", "-O2", f"-I{built.folder}", "-lm", "-o", str(target)]
    subprocess.run([*compiler, *map(str, sources), *flags], check=True)
    return target


def largest_error(folder: Path, compiler: Sequence[str] = ("cc",)) -> float:
    """Of the crank (rad) in the last of five seconds, from an error of 0.2 rad."""
    controller = program(folder, compiler)
    said = subprocess.run([str(controller)], check=True, capture_output=True, text=True)
    return float(said.stdout)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        error = largest_error(Path(folder))
        print(f"largest error of the crank in the last second: {error:.1e} rad")


if __name__ == "__main__":
    main()
