"""Chunks of eigenvalues along a steady motion, without any motion being integrated.

Where there are many points the equations of the motion and their linear form are compiled, and go
side by side in lanes. That code travels with the job as a module does, and is checked against
values of CasADi before it is used.
"""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.emit import emit
from codegen.passes.lanes import LONGEST
from codegen.runtime.simulation import Status
from codegen.seal import VERIFICATION
from derive.diagnostics import ToolchainError
from derive.expressions.columns import columns_of
from derive.formulations.frames import based
from derive.linearize.many import steady_motions
from derive.linearize.spectrum import eigenvalues
from derive.linearize.steady import motion_of
from derive.linearize.study import Study, study
from derive.linearize.together import STEADY, by_call, plain, together
from derive.model import load_text
from hamel.build.module import compiled
from hamel.build.stages import mechanics_of, program_of
from hamel.sweep.artefact import Artefact, of_folder, unpacked
from hamel.sweep.job import Modes
from hamel.sweep.limits import BESIDE, STATES
from hamel.sweep.linear import equations_in
from hamel.verify.shipped import stored

NO_STEADY_MOTION = 102


@dataclass(frozen=True)
class Ready:
    """The study of the motion, and what is worth saying about this machine."""

    study: Study
    note: str = ""


def studied(work: Modes) -> Study:
    """The linear equations along the steady motion, derived from the model's text."""
    model = load_text(work.text, work.file)
    equations = based(equations_in(mechanics_of(model), work.choice))
    return study(equations, motion_of(equations, work.at), work.values)


def ready(work: Modes) -> Ready:
    """Derived, and by compiled code where the job brings some."""
    found = studied(work)
    if work.artefact is None:
        return Ready(found)
    module, note = unpacked(work.artefact)
    if module.backend == "numpy":  # slower than what is derived here
        return Ready(found, note)
    return Ready(by_call(found, module.steady), note)


def in_lanes(work: Modes) -> Artefact | None:
    """The compiled code for it; None where there is no compiler, or the function is too long for
    lanes."""
    found = studied(work)
    if not found.kept or found.length > LONGEST:
        return None
    program = program_of(together(found), (STEADY,))
    texts = dict(emit(program))
    texts[VERIFICATION] = json.dumps({"functions": {STEADY: _states(found)}})
    with contextlib.suppress(ToolchainError), compiled(program.name, texts) as folder:
        return of_folder(program.name, texts, folder) if folder.compiled else None
    return None


def _states(found: Study) -> dict[str, Any]:
    """Values of CasADi at the motion, and beside it."""
    motion, (p, s) = found.motions({}), found.values({})
    rng, rows = np.random.default_rng(0), []
    for k in range(STATES):
        parts = [motion.x[0], motion.u[0], np.concatenate([p[0], s[0]])]
        beside = [x * (1 + k * BESIDE * rng.uniform(-1, 1, x.shape)) for x in parts]
        rows.append((0.0, *beside))
    return stored(rows, plain(found))


def has_masses(found: Study, bodies: ca.Function, varied: dict[str, np.ndarray]) -> np.ndarray:
    """Where no mass and no moment of inertia is negative."""
    p = found.values(varied)[0][:, : bodies.numel_in(0)]
    return columns_of(bodies)(p.T)[0].min(axis=(0, 1)) >= 0.0


def columns(
    found: Study, varied: dict[str, np.ndarray], count: int
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Growth and frequency of the eigenvalue with the largest real part, and how each motion
    ended."""
    status = np.zeros(count, dtype=np.int16)
    with np.errstate(all="ignore"):
        motions, steady = steady_motions(found, varied)
        matrices = np.asarray(found.matrices(motions))
    status[~steady] = NO_STEADY_MOTION
    finite = np.isfinite(matrices.reshape(count, -1).sum(axis=1))
    status[~finite & (status == 0)] = Status.NOT_FINITE
    real, imaginary = np.full((2, count), np.nan)
    if finite.any() and matrices.shape[1]:
        first = eigenvalues(matrices[finite])[:, 0]
        real[finite], imaginary[finite] = np.real(first), np.abs(np.imag(first))
    return {"growth": real, "frequency": imaginary}, status
