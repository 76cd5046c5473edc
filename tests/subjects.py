"""Modules with targets on request, and states to compare the two at, without the rest of a build."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from codegen import loader
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for, with_emitted
from hamel.build.targets import subject_of
from hamel.verify.shipped import shipped
from hamel.verify.targets import Subject
from tests.scenes import MODELS


def subject(
    base: Path, model: str, targets: Sequence[str], functions: Sequence[str] = ("dynamics", "mass")
) -> Subject:
    equations = equations_of(MODELS / f"{model}.yaml")
    made = program_for(equations, BuildOptions(functions=functions, targets=targets))
    rows = shipped(with_emitted(equations, made), [kernel.name for kernel in made.kernels], 0)
    folder = published(made, base / model).folder
    return subject_of(made, loader.load(folder), rows)
