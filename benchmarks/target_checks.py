"""Every target on request with every kind of model, each checked by its tool against the module: one
table, and build/targets.json with a row {"target", "model", "tool", "worst", "passed"} for each.

worst is the largest error in terms of its tolerance: 1 is the most that passes. A target that does
not fit a model has to say so; then the tool of the row is the reason, and worst is null. Of a model
one module is made for all targets that take it; of a thousand links a second one without loops.

Run by `make targets`; `python benchmarks/target_checks.py casadi cpp` runs some of them.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from growth import planar
from rich.console import Console

from codegen.emit import on_request
from codegen.program import Program
from codegen.targets import ON_REQUEST
from derive.diagnostics import HamelError
from derive.formulations.records import Equations
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for
from hamel.build.targets import target_checks
from hamel.records import as_json
from hamel.show import table
from hamel.verbs.verify import target_subject
from hamel.verify.records import CheckResult
from hamel.verify.targets import Subject, TargetCheck

HOME = Path(__file__).parent.parent
STATES, LINKS, STATES_OF_CHAIN = 20, 1000, 2
SINGLE = ("cortex-m",)  # in float32 alone
# what is said besides: instructions and stack of `dynamics`, flash and stack of a controller
COSTS = ("values on M7", "flash of the controller on M7", "stack of the controller on M7")


@dataclass(frozen=True)
class Kind:
    """A kind of model: its file below models/ (none: a chain of LINKS), the choice, and whether
    targets that take straight lines alone have a module of their own."""

    what: str
    file: str
    choice: str | None = None
    functions: tuple[str, ...] | None = None
    apart: bool = False
    states: int = STATES


KINDS = (
    Kind("tree", "cart_pole"),
    Kind("closed loop", "four_bar", "crank"),
    Kind("rolling body", "rolling_disk"),
    Kind("charts", "four_bar", "crank+rocker"),
    Kind("no inputs", "chaplygin_sleigh"),
    Kind("first-order states", "gallery/muscle_activation"),
    Kind("states and events", "gallery/dc_motor"),
    Kind("table", "gallery/cam"),
    Kind("pieces and events", "gallery/bungee"),
    Kind("1,000 links", "", None, ("dynamics", "energy"), True, STATES_OF_CHAIN),
)


@dataclass(frozen=True)
class Row:
    target: str
    model: str
    tool: str
    worst: float | None
    passed: bool


@dataclass
class Trial:
    """The targets of one kind of model in one kind of number, and what became of each."""

    kind: Kind
    real: str
    targets: tuple[str, ...]
    rows: list[Row] = field(default_factory=list)

    def run(self, equations: Equations) -> list[Row]:
        straight = [target.name for target in on_request(self.targets) if target.straight]
        apart = straight if self.kind.apart else []
        for names in (apart, [name for name in self.targets if name not in apart]):
            if names:
                self._together(equations, names)
        return self.rows

    def _together(self, equations: Equations, names: Sequence[str]) -> None:
        """One module for all of them that take it."""
        try:
            program = program_for(equations, self._options(names))
            names = self._fitting(program, names)
            checked = replace(program, targets=names)
            with target_subject(equations, checked, self.kind.states, 0) as subject:
                for check in target_checks(names):
                    self._say(check.target, *_outcome(check, subject))
        except HamelError as error:
            for name in names:
                self._say(name, " ".join(str(error).split()), None, False)

    def _options(self, names: Sequence[str]) -> BuildOptions:
        return BuildOptions(functions=self.kind.functions, targets=tuple(names), real=self.real)

    def _fitting(self, program: Program, names: Sequence[str]) -> tuple[str, ...]:
        """Those that take the program; the reason of each other."""
        reasons = {target.name: target.refusal(program) for target in on_request(names)}
        for name, reason in reasons.items():
            if reason:
                self._say(name, reason, None, True)
        return tuple(name for name, reason in reasons.items() if not reason)

    def _say(self, target: str, tool: str, worst: float | None, passed: bool) -> None:
        real = "" if self.real == "float64" else f", {self.real}"
        file = self.kind.file.rpartition("/")[2] or "chain"
        row = Row(target, f"{file} ({self.kind.what}{real})", tool, worst, passed)
        self.rows.append(row)
        print(f"{row.target}, {row.model}: {_word(row)}", file=sys.stderr, flush=True)


def _outcome(check: TargetCheck, subject: Subject) -> tuple[str, float | None, bool]:
    """Tool, worst and passed."""
    try:
        results = list(check.run(subject))
    except HamelError as error:
        return " ".join(str(error).split()), None, False
    idle = [result.name for result in results if result.name.startswith("not run")]
    costs = [result.about for result in results if result.name in COSTS]
    worst = max(map(_share, results))
    return ", ".join([check.tool, *idle, *costs]), worst, all(result.passed for result in results)


def _share(check: CheckResult) -> float:
    """Of its tolerance; of a check that tolerates nothing, what it counts."""
    return float(check.value / check.tolerance if check.tolerance else check.value)


def trials(kind: Kind, wanted: Sequence[str]) -> Iterator[Trial]:
    """In float64 all that compute so; in float32 those that do nothing else, and of the tree
    all."""
    yield Trial(kind, "float64", tuple(name for name in wanted if name not in SINGLE))
    tried = wanted if kind is KINDS[0] else [name for name in wanted if name in SINGLE]
    yield Trial(kind, "float32", tuple(tried))


def rows(kind: Kind, wanted: Sequence[str]) -> Iterator[Row]:
    """All targets of one kind of model."""
    asked = [trial for trial in trials(kind, wanted) if trial.targets]
    if not asked:
        return
    with tempfile.TemporaryDirectory() as base:
        file = HOME / "models" / f"{kind.file}.yaml"
        if not kind.file:
            file = Path(base) / "chain.yaml"
            file.write_text(planar(LINKS), "utf-8")
        equations = equations_of(file, kind.choice)
        for trial in asked:
            yield from trial.run(equations)


def main(names: list[str]) -> int:
    """0 where every target fits and agrees, or says why it does not fit."""
    warnings.simplefilter("ignore", RuntimeWarning)
    wanted = [target.name for target in on_request(names)] or [t.name for t in ON_REQUEST]
    start = time.perf_counter()
    unordered = [row for kind in KINDS for row in rows(kind, wanted)]
    done = sorted(unordered, key=lambda row: wanted.index(row.target))
    shown = [
        (r.target, r.model, "–" if r.worst is None else f"{r.worst:.1g}", _word(r), r.tool)
        for r in done
    ]
    console = Console()
    table(console, ("target", "model", "worst", "", "tool"), shown, right=range(2, 3))
    place = HOME / "build" / "targets.json"
    place.parent.mkdir(exist_ok=True)
    place.write_text(json.dumps([_plain(row) for row in done], indent=1) + "\n", "utf-8")
    passed = sum(row.passed for row in done)
    took = f"{time.perf_counter() - start:.0f} s"
    console.print(f"{passed} of {len(done)} passed in {took}; {place.relative_to(HOME)}")
    return 0 if passed == len(done) else 4


def _plain(row: Row) -> dict[str, Any]:
    return as_json(asdict(row))


def _word(row: Row) -> str:
    if not row.passed:
        return "FAILED"
    return "passed" if row.worst is not None else "refused"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
