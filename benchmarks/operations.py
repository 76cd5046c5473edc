"""The table of docs/operations.md: how many operations ours take, and what others published.

    python benchmarks/operations.py

prints the rows as they have to stand in the page; a test counts them again.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from codegen.passes import program
from derive.formulations import equations
from derive.model import load
from derive.states import system

ROOT = Path(__file__).resolve().parent.parent
ARMS = ROOT / "benchmarks" / "operations"
MODELS, EXAMPLES = ROOT / "models", ROOT / "examples"


@dataclass(frozen=True)
class Case:
    """`constants`: "all" parameters are numbers, or none is."""

    title: str
    model: Path
    function: str = "inverse_dynamics"
    constants: str = "all"


CASES = (
    Case("RX90, all ten numbers of every link", ARMS / "rx90.yaml"),
    Case("RX90, symmetric links", ARMS / "rx90_symmetric.yaml"),
    Case("Stanford arm", MODELS / "stanford_arm.yaml"),
    Case("Puma 560", ARMS / "puma_560.yaml"),
    Case("six revolute joints, all symbols", ARMS / "six_joints.yaml", constants=""),
    Case("Panda, inverse dynamics", EXAMPLES / "panda.yaml"),
    Case("Panda, forward dynamics", EXAMPLES / "panda.yaml", "dynamics"),
    Case("Panda, v̇ with ∂v̇/∂q, ∂v̇/∂v and M⁻¹", EXAMPLES / "panda.yaml", "derivatives"),
    Case("Whipple bicycle, inverse dynamics", MODELS / "bicycle.yaml"),
    Case("Whipple bicycle, solved", MODELS / "bicycle.yaml", "dynamics"),
    Case("Whipple bicycle, solved, all symbols", MODELS / "bicycle.yaml", "dynamics", ""),
    Case("rolling disk, inverse dynamics", MODELS / "rolling_disk.yaml"),
    Case("rolling disk, solved", MODELS / "rolling_disk.yaml", "dynamics"),
    Case("rolling torus, solved", MODELS / "rolling_torus.yaml", "dynamics"),
)


def counted(case: Case) -> tuple[int, int, int]:
    """Multiplications with divisions, additions, and functions (sine, cosine, root, …)."""
    found = equations(system(load(str(case.model)), case.constants or ()))
    n = program(found, [case.function]).kernels[0].operations
    functions = n["total"] - n["multiply"] - n["divide"] - n["add"]
    return n["multiply"] + n["divide"], n["add"], functions


def row(case: Case) -> str:
    products, sums, functions = counted(case)
    return f"| {case.title} | {products:,} + {sums:,} + {functions} |"


def main() -> int:
    for case in CASES:
        print(row(case), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
