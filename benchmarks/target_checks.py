"""Every target on request with every kind of model, checked by its tool against the module: one
table, and build/targets.json with a row {"target", "model", "tool", "worst", "passed"} for each.

worst is the largest error in terms of its tolerance: 1 is the most that passes. A target that does
not fit a model has to say so; then the tool of the row is the reason, and worst is null.

Run by `make targets`; `python benchmarks/target_checks.py casadi cpp` runs some of them.
"""

from __future__ import annotations

import json
import sys
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console

from codegen.targets import ON_REQUEST
from derive.diagnostics import AssumptionError, HamelError
from hamel.build.options import BuildOptions
from hamel.records import CheckLine, as_json
from hamel.show import table
from hamel.verbs.verify import run_targets
from hamel.verify.targets import TARGET_CHECKS

HOME = Path(__file__).parent.parent
STATES = 20
# what it is → the file, and how it is built
MODELS = {
    "tree": ("cart_pole", {}),
    "closed loop": ("four_bar", {"choice": "crank"}),
    "rolling body": ("rolling_disk", {}),
    "charts": ("four_bar", {"choice": "crank+rocker"}),
    "no inputs": ("chaplygin_sleigh", {}),
    "float32": ("cart_pole", {"real": "float32"}),
    "closed loop, float32": ("four_bar", {"choice": "crank", "real": "float32"}),
    "rolling body, float32": ("rolling_disk", {"real": "float32"}),
    "charts, float32": ("four_bar", {"choice": "crank+rocker", "real": "float32"}),
    "no inputs, float32": ("chaplygin_sleigh", {"real": "float32"}),
}
SINGLE = ("cortex-m",)  # in float32 alone, which for the others is tried once


@dataclass(frozen=True)
class Row:
    target: str
    model: str
    tool: str
    worst: float | None
    passed: bool


def row(target: str, kind: str) -> Row:
    """One target with one model."""
    name, how = MODELS[kind]
    options = BuildOptions(targets=(target,), **how)
    model = f"{name} ({kind})"
    tool = next(check.tool for check in TARGET_CHECKS if check.target == target)
    try:
        found = run_targets(HOME / "models" / f"{name}.yaml", options, STATES, seed=0)
    except AssumptionError as error:  # it does not fit, and says why
        return Row(target, model, error.diagnostics[0].message, None, True)
    except HamelError as error:
        return Row(target, model, " ".join(str(error).split()), None, False)
    names = [check.name.partition(": ")[2] for check in found.checks]
    tool = ", ".join([tool, *(name for name in names if name.startswith("not run"))])
    return Row(target, model, tool, max(map(_share, found.checks)), found.passed)


def _share(check: CheckLine) -> float:
    """Of its tolerance; of a check that tolerates nothing, what it counts."""
    return check.value / check.tolerance if check.tolerance else check.value


def main(names: list[str]) -> int:
    """0 where every target fits and agrees, or says why it does not fit."""
    warnings.simplefilter("ignore", RuntimeWarning)
    wanted = names or [target.name for target in ON_REQUEST]
    rows = [_said(row(target, kind)) for target in wanted for kind in _kinds(target)]
    shown = [
        (r.target, r.model, "–" if r.worst is None else f"{r.worst:.1g}", _word(r), r.tool)
        for r in rows
    ]
    console = Console()
    table(console, ("target", "model", "worst", "", "tool"), shown, right=range(2, 3))
    place = HOME / "build" / "targets.json"
    place.parent.mkdir(exist_ok=True)
    place.write_text(json.dumps([as_json(asdict(r)) for r in rows], indent=1) + "\n", "utf-8")
    console.print(f"{sum(r.passed for r in rows)} of {len(rows)} passed; {place.relative_to(HOME)}")
    return 0 if all(r.passed for r in rows) else 4


def _said(found: Row) -> Row:
    print(f"{found.target}, {found.model}: {_word(found)}", file=sys.stderr, flush=True)
    return found


def _kinds(target: str) -> list[str]:
    single = [kind for kind in MODELS if kind.endswith("float32")]
    if target in SINGLE:
        return ["tree", *single]
    return [kind for kind in MODELS if kind not in single[1:]]


def _word(found: Row) -> str:
    if not found.passed:
        return "FAILED"
    return "passed" if found.worst is not None else "refused"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
