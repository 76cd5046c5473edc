"""verify: compare the compiled module of each choice with an independent derivation, at random admissible states."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from derive.formulations import equations
from derive.mechanics import system
from derive.model import load
from hamel.pipeline import Constants, temporary_module
from hamel.records import CheckLine, Verified
from hamel.verify import verification

if TYPE_CHECKING:
    from rich.console import Console

    from derive.formulations.records import Equations


def run(path: str | Path, choice: str | None, states: int, seed: int, constants: Constants) -> Verified:
    candidates = _candidates(path, choice, constants)
    wanted = candidates if choice is None else {choice: candidates[choice]}
    checks = [check for name in wanted for check in _checks(name, candidates, states, seed)]
    model = next(iter(candidates.values())).system.model.name
    return Verified(model, all(check.passed for check in checks), tuple(checks), states, seed)


def _candidates(path: str | Path, choice: str | None, constants: Constants) -> dict[str, Equations]:
    """The equations of every choice of the file, and of `choice` when it is none of them."""
    model = load(path)
    mechanics = system(model, constants)
    names = [declared.name for declared in model.choices]
    if choice is not None and choice not in names:
        names.insert(0, choice)
    return {name: equations(mechanics, name) for name in names}


def _checks(name: str, candidates: dict[str, Equations], states: int, seed: int) -> list[CheckLine]:
    chosen = candidates[name]
    others = tuple(other for key, other in candidates.items() if key != name)
    with temporary_module(chosen) as module:
        found = verification(chosen.system.model, chosen, module, states=states, seed=seed, others=others)
    return [CheckLine(f"{name}: {c.name}", float(c.value), float(c.tolerance), bool(c.passed)) for c in found.checks]


def show(record: Verified, console: Console) -> None:
    from hamel.show import number, table

    rows = [(c.name, number(c.value), number(c.tolerance), "ok" if c.passed else "FAILED") for c in record.checks]
    table(console, ("check", "value", "tolerance", ""), rows, right=(1, 2))
    good = sum(check.passed for check in record.checks)
    console.print(f"{record.model}: {good} of {len(record.checks)} checks passed at {record.states} random states per choice")
