"""verify: compare the compiled module of each choice with an independent derivation, at random admissible states."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.model import load
from hamel.pipeline import Constants, mechanics_of, temporary_module
from hamel.records import CheckLine, Verified
from hamel.verify import verification

if TYPE_CHECKING:
    from rich.console import Console

    from derive.formulations.records import Equations
    from derive.mechanics.records import System


def run(path: str | Path, choice: str | None, states: int, seed: int, constants: Constants) -> Verified:
    model = load(path)
    mechanics = mechanics_of(model, constants)
    declared = [each.name for each in model.choices]
    wanted = declared if choice is None else [choice]
    candidates = {name: equations(mechanics, name) for name in wanted}
    candidates |= _usable(mechanics, [name for name in declared if name not in wanted])
    checks = [check for name in wanted for check in _checks(name, candidates, states, seed)]
    return Verified(model.name, all(check.passed for check in checks), tuple(checks), states, seed)


def _usable(mechanics: System, names: list[str]) -> dict[str, Equations]:
    """Choices that were not asked for serve as references, where they are choices at all."""
    found = {}
    for name in names:
        with suppress(AssumptionError):
            found[name] = equations(mechanics, name)
    return found


def _checks(name: str, candidates: dict[str, Equations], states: int, seed: int) -> list[CheckLine]:
    chosen = candidates[name]
    others = tuple(other for key, other in candidates.items() if key != name)
    with temporary_module(chosen) as module:
        found = verification(chosen.system.model, chosen, module, states=states, seed=seed, others=others)
    return [CheckLine(f"{name}: {c.name}", float(c.value), float(c.tolerance), bool(c.passed)) for c in found.checks]


def show(record: Verified, console: Console) -> None:
    """One row per check, one column per choice: the worst relative error met."""
    from hamel.show import number, table

    values = {tuple(check.name.split(": ", 1)): check for check in record.checks}
    choices, names = (list(dict.fromkeys(key[i] for key in values)) for i in (0, 1))
    rows = []
    for name in names:
        found = [values.get((choice, name)) for choice in choices]
        limit = next(check.tolerance for check in found if check)
        rows.append((name, *(_cell(check) for check in found), number(limit)))
    table(console, ("check", *choices, "tolerance"), rows, right=range(1, len(choices) + 2))
    good = sum(check.passed for check in record.checks)
    console.print(f"{record.model}: {good} of {len(record.checks)} checks passed at {record.states} random states per choice")


def _cell(check: CheckLine | None) -> str:
    from hamel.show import number

    if check is None:
        return "–"
    return number(check.value) if check.passed else f"FAILED {number(check.value)}"
