"""A module to run: one formulation, one choice, and what a keeping makes of the equations; with all integrators in it."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from codegen.integrators import INTEGRATORS
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.initial import Initial, initial_state
from derive.mechanics.records import System
from hamel.importing import load
from hamel.pipeline import emit, mechanics_of, program_of
from hamel.settings import settings

FUNCTIONS = ("dynamics", "constraints", "project", "energy", "power", "velocity", "state")


@dataclass(frozen=True)
class Start:
    """The mechanics of a model file with the settings, and its consistent initial state."""

    system: System
    initial: Initial
    u: np.ndarray
    p: np.ndarray


def start(path: str, values: Mapping[str, float | str]) -> Start:
    return _start(path, tuple(sorted(values.items())))


@functools.lru_cache(maxsize=2)
def _start(path: str, values: tuple[tuple[str, float | str], ...]) -> Start:
    system = mechanics_of(load(path))
    given = settings(system.model, dict(values))
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    return Start(system, initial_state(system, given.initial, p), u, p)


def built(path: str, values: Mapping[str, float | str], unit: Mapping[str, str], folder: str) -> Iterator[dict[str, Any]]:
    """What runs need to know of the module that is in `folder` now."""
    found = start(path, values)
    made = made_equations(found, unit)
    names = [function.name for function in made.functions if function.name in FUNCTIONS]
    program = program_of(made, names, integrators=[method.name for method in INTEGRATORS])
    emit(program, Path(folder), {})
    yield {"operations": program.kernel("dynamics").operations["total"], "keepings": list(program.keepings)}


def made_equations(found: Start, unit: Mapping[str, str]) -> Equations:
    return equations(found.system, unit["choice"] or None, unit["formulation"])
