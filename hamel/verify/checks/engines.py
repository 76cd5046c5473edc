"""The same mechanism in Pinocchio, MuJoCo and Exudyn, where they are installed and it fits them."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType

import numpy as np

from hamel.verify.checks.agreement import mass_error
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.motion import best_conditioned, reference_end, time_scale
from hamel.verify.checks.samples import Sample
from hamel.verify.reference.engines.records import Forces
from hamel.verify.reference.outcome import reference, rotors, state_of
from hamel.verify.reference.vectors import Array

ENGINES = 1e-9  # relative, per condition number: their frames are not ours
MANY = 10  # states
STEPS = 400  # of Exudyn, half of them in the other run


def pinocchio(e: Evidence) -> float | None:
    """M, h and v̇ of a tree."""
    engine = _engine(e, "pinocchio")
    return (
        None
        if engine is None
        else _compared(e, [(s, _forces(e, engine, s)) for s in e.samples[:MANY]])
    )


def mujoco(e: Evidence) -> float | None:
    """M, h and v̇ of a tree; of loops that the force they take is along MuJoCo's own rows."""
    engine = _engine(e, "mujoco")
    if engine is None:
        return None
    pairs = [(s, _forces(e, engine, s)) for s in e.samples[:MANY]]
    return None if any(forces is None for _, forces in pairs) else _compared(e, pairs)


def exudyn(e: Evidence) -> float | None:
    """A short motion of the reference under gravity alone, which the other checks hold the
    equations to."""
    engine = _engine(e, "exudyn")
    if engine is None or e.redundant:  # the reference drifts to where redundant rows are not
        return None
    if e.system.model.states:
        return None
    model = replace(e.system.model, loads=())
    bare = replace(e, reference=reference(model))
    k = best_conditioned(e)[0]
    s = replace(e.samples[k], u=0.0 * e.samples[k].u)
    span = time_scale(bare, s)
    try:
        q, v = np.split(reference_end(bare, s, span), [len(s.q)])
    except FloatingPointError:  # the reference cannot tell
        return None
    arm = e.units.own.length
    start = state_of(bare.reference, s.t, s.q, s.v, s.u, s.full)
    end = state_of(bare.reference, s.t + span, q, v, s.u, s.full)
    ours, theirs = engine.points(model, end, arm), engine.ends(model, start, span, STEPS, arm)
    return (
        None
        if theirs is None
        else worst(theirs - ours) / worst(ours - engine.points(model, start, arm))
    )


def _engine(e: Evidence, name: str) -> ModuleType | None:
    """The file of that name, where the engine is installed and has everything that the model
    has."""
    if importlib.util.find_spec(name) is None:
        return None
    try:
        engine = importlib.import_module(f"hamel.verify.reference.engines.{name}")
    except ImportError:  # installed, but not for this machine
        return None
    return None if engine.missing(e.system.model) else engine


def _forces(e: Evidence, engine: ModuleType, s: Sample) -> Forces | None:
    return engine.forces(e.system.model, s.state, rotors(e.reference, s.state), s.outcome.Q)


def _compared(e: Evidence, found: list) -> float:
    return worst(
        [error for k, (s, forces) in enumerate(found) for error in _errors(e, k, s, forces)]
    )


def _errors(e: Evidence, k: int, s: Sample, forces: Forces) -> Iterator[float]:
    t, unit = e.terms[k], e.units
    yield mass_error(t.M / unit.M, forces.M / unit.M, e.of_masses(ENGINES)[k])
    sums = Sums(ENGINES, e.forces[k : k + 1])
    yield deviation([t.h], [forces.h], unit=unit.force, sums=sums)
    if forces.rows is None or not len(forces.rows):
        yield deviation([e.vdot[k]], [forces.vdot], e.conditions[k : k + 1], e.small, unit.vdot)
    else:
        yield (
            _across(t.M @ e.vdot[k] + t.h - s.outcome.Q, forces.rows, unit.force) / e.conditions[k]
        )


def _across(force: Array, rows: Array, unit: Array) -> float:
    """The part of a force that is not along the rows."""
    along = (rows / unit).T
    left = force / unit - along @ np.linalg.lstsq(along, force / unit, rcond=None)[0]
    return worst(left) / max(1e-6, worst(force / unit))


CHECKS = (
    Check(
        "Pinocchio",
        ENGINES,
        "M, h and v̇ of trees, where it is installed; v̇ per condition number",
        pinocchio,
    ),
    Check(
        "MuJoCo",
        ENGINES,
        "M, h and v̇ of trees, directions of loops, where it is installed; per condition number",
        mujoco,
    ),
    Check(
        "Exudyn",
        1e-6,
        "a short motion with loops and rolling under gravity, where it is installed",
        exudyn,
    ),
)
