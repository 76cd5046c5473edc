"""linearize: the linear equations along a steady motion in minimal states, their eigenvalues over a
range, and the page."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.linearize import study
from derive.linearize.discrete import Discrete
from derive.linearize.minimal import evaluator
from derive.linearize.nearest import away, moves
from derive.linearize.records import Kink, Steady
from derive.linearize.sensitivity import Mode, modes
from derive.linearize.steady import check_still, motion_of, with_free_inputs
from derive.linearize.study import Study
from derive.linearize.unreduced import unreduced
from derive.model.records import SteadyMotion
from hamel.build.clock import Clock
from hamel.build.files import write_text
from hamel.build.stages import equations_of
from hamel.linear.limits import SAME
from hamel.linear.page import page
from hamel.linear.ranges import Range, ranges, started, values
from hamel.linear.sweep import Sweep, swept
from hamel.linear.words import branches, course, shape, without
from hamel.records import CriticalValue, Linearized, ModeOf, UnreducedForm
from hamel.show import durations, table

if TYPE_CHECKING:
    from rich.console import Console

PAGE = "linearization.html"


@dataclass(frozen=True)
class Options:
    """Of the linear equations: the steady motion `at`, what is swept and what is held, the cyclic
    coordinates left out of the eigenvalues (all when None), and the step in s of discrete time."""

    at: str | None
    choice: str | None
    sweep: Mapping[str, str]
    given: Mapping[str, float | str]
    cyclic: Sequence[str] | None
    step: float | None


def run(path: str | PathLike[str], options: Options, out: str | Path | None) -> Linearized:
    """A, B, C, D in minimal states along a steady motion, eigenvalues over the ranges of `sweep`
    (one name, or two for a map), critical values and modes; with `out` the page as well.

    A free name of the motion that is swept stands at the middle of its range in A to D, unless it
    is given. With a step (s) Φ and Γ of δx(t + step) = Φ δx + Γ δu come along. Raises ModelError
    for more than two swept names, unknown names, and a step that is not positive.
    """
    sweep, step = options.sweep, options.step
    if len(sweep) > 2:
        raise ModelError(f"{len(sweep)} names are swept", "one, or two for a map")
    clock = Clock()
    equations = based(equations_of(path, options.choice, clock=clock, check=check_still))
    model = equations.system.model
    motion = with_free_inputs(equations, motion_of(equations, options.at), (*options.given, *sweep))
    motion, given = started(model, motion, options.given)
    wanted = ranges(model, motion, sweep)
    with clock("linearize"):
        middles = {
            r.name: float(r.values[0] + r.values[-1]) / 2
            for r in wanted
            if r.name in motion.sweepable
        }
        asked = middles | values(model, motion, given)
        result = _studied(equations, motion, asked, wanted, options.cyclic)
    _warn_of_kinks(result)
    with clock("sweep"):
        outcome = swept(result, wanted)
    if step is not None and not 0 < step < math.inf:
        raise ModelError(f"a step of {step} s", "a time that is more than zero")
    record = _record(result, outcome, clock)
    if step is not None:
        record = replace(record, step=step, **_sampled(result, step))
    if out is None:
        return record
    place = Path(out) if Path(out).suffix.lower() == ".html" else Path(out) / PAGE
    with clock("page"):
        write_text(place, page(result, outcome, wanted, record))
    return replace(record, page=place)


def _studied(
    equations: Equations,
    motion: SteadyMotion,
    asked: Mapping[str, float],
    wanted: Sequence[Range],
    cyclic: Sequence[str] | None,
) -> Study:
    """The study at these values. Where they have no steady motion, and nobody gave the value of
    what is swept, it is at the value of the range whose motion is nearest to the guess, and a
    warning says so."""
    try:
        return study(equations, motion, asked, cyclic)
    except AssumptionError:
        own = dict(zip(equations.arguments[3].labels, equations.parameters))
        found = list[tuple[str, Study]]()
        for along in wanted:
            if along.name in asked or along.name not in own:
                continue
            for value in along.beside(own[along.name]):
                with suppress(AssumptionError):
                    there = {**asked, along.name: value}
                    found.append((along.name, study(equations, motion, there, cyclic)))
        if not found:
            raise
        return _warned_of_place(*min(found, key=lambda entry: _away(entry[1])))


def _away(study: Study) -> float:
    """How far the motion is from the guess."""
    place = study.origin
    return away(study.problem, place.p, place.s, place.y)


def _warned_of_place(name: str, study: Study) -> Study:
    """The file's own value has no steady motion."""
    model = study.equations.system.model
    warnings.warn(
        f"{model.name} has no steady motion '{study.problem.motion.name}' with its own {name}: the "
        f"linear equations are those at {name} = {study.at[name]:.6g}",
        RuntimeWarning,
        stacklevel=4,
    )
    return study


OF_KINKS = {
    Kink.BENDS: "a force bends exactly here: slopes are the mean of those on both sides",
    Kink.JUMPS: "a force jumps exactly here: slopes are the mean of those on both sides, and leave "
    "the jump out",
}


def _warn_of_kinks(study: Study) -> None:
    """Where forces jump or bend there is no slope, and what comes out is a mean."""
    if said := OF_KINKS.get(study.linear.kink):
        warnings.warn(f"{study.equations.system.model.name}: {said}", RuntimeWarning, stacklevel=3)


def _record(study: Study, made: Sweep, clock: Clock) -> Linearized:
    form, equations = study.linear, study.equations
    motions, (p, s) = study.motions({}), study.values({})
    found = np.append(motions.x[0], motions.u[0])
    states, inputs = equations.arguments[1].labels, equations.arguments[2].labels
    numbers = {
        name: evaluator(equations, getattr(form, name))(motions.x, motions.u, motions.p)[0].tolist()
        for name in "ABCD"
    }
    return Linearized(
        model=equations.system.model.name,
        file=equations.system.model.file,
        choice=equations.choice,
        motion=study.problem.motion.name,
        values=study.at,
        steady=dict(zip((*states, *inputs), found.tolist())),
        strayed={name: (a, b) for name, a, b in moves(study.problem, p[0], s[0], found)},
        states=form.states,
        inputs=form.inputs,
        outputs=form.outputs,
        **numbers,
        cyclic=tuple(form.states[k] for k in study.cyclic),
        families=sum(len(stage) for stage in study.families),
        reduced=study.reduced,
        swept=made.names,
        rows=tuple(_rows(study, made)),
        critical=tuple(
            CriticalValue(c.kind, made.names[0], c.value, _pair(c.eigenvalue))
            for c in made.critical
        ),
        stable=made.stable,
        unstable=made.unstable,
        breaks=made.breaks,
        absent=made.absent,
        modes=tuple(_mode(study, mode) for mode in modes(study)),
        unreduced=_unreduced(study, motions),
        seconds=clock.seconds,
        step=None,
        Phi=None,
        Gamma=None,
        page=None,
    )


def _mode(study: Study, mode: Mode) -> ModeOf:
    slopes = {name: _pair(slope) for name, slope in mode.sensitivity.items()}
    return ModeOf(_pair(mode.eigenvalue), course(mode.eigenvalue), shape(study, mode), slopes)


def _unreduced(study: Study, motions: Steady) -> UnreducedForm | None:
    try:
        other = unreduced(
            study.linear, motions, tuple(study.linear.independent[k] for k in study.cyclic)
        )
    except AssumptionError:
        return None
    return UnreducedForm(other.states, other.A.tolist(), other.difference, other.spurious)


def _sampled(study: Study, step: float) -> dict[str, Any]:
    """Φ and Γ of δx(t + step) = Φ δx + Γ δu."""
    motions = study.motions({})
    Phi, Gamma = Discrete(study.linear)(0.0, motions.x[0], motions.u[0], motions.p[0], step)
    return {"Phi": Phi.tolist(), "Gamma": Gamma.tolist()}


def _rows(study: Study, made: Sweep) -> list[dict[str, Any]]:
    """Per motion: swept values, eigenvalues (none where there is no motion), and how many of the
    states are spurious (more than the minimal number)."""
    spurious, absent = study.spurious, {*made.absent}
    return [
        {
            **dict(zip(made.names, row.tolist())),
            "eigenvalues": [] if k in absent else [_pair(x) for x in spectrum],
            "spurious": spurious,
        }
        for k, (row, spectrum) in enumerate(zip(made.values, made.spectra))
    ]


def _pair(x: complex | np.complexfloating) -> list[float]:
    return [float(x.real), float(x.imag)]


def show(record: Linearized, console: Console) -> None:
    """The steady motion, the minimal states, eigenvalues per swept value (at most so many rows),
    modes, and where stability changes."""
    at = ", ".join(
        f"{name} {value:.6g}" for name, value in record.steady.items() if abs(value) > SEEN
    )
    console.print(f"{record.model}, steady motion '{record.motion}': {at or 'at rest'}")
    if record.strayed:
        changes = (f"{name} {a:.6g} → {b:.6g}" for name, (a, b) in record.strayed.items())
        console.print(f"  far from the guess: {', '.join(changes)}")
    console.print(f"  {len(record.states)} minimal states: {', '.join(record.states)}")
    zeros = [f"{len(record.cyclic)} cyclic ({', '.join(record.cyclic)})"] if record.cyclic else []
    zeros += [f"{record.families} along families of steady motions"] if record.families else []
    if zeros:
        console.print(f"  zero eigenvalues taken out: {'; '.join(zeros)}")
    absent = {*record.absent}
    rows = [
        (
            *(f"{row[name]:.6g}" for name in record.swept),
            "no steady motion" if k in absent else "  ".join(map(_complex, row["eigenvalues"])),
        )
        for k, row in enumerate(record.rows)
    ]
    every = max(1, len(rows) // MOST_ROWS)
    heads = (*record.swept, "eigenvalues (1/s)")
    if any(row["eigenvalues"] for row in record.rows):
        table(console, heads, rows[::every], right=range(len(record.swept)))
    else:
        console.print(f"  no eigenvalues: {_nothing(record)}")
    if record.swept:
        console.print(
            f"at {', '.join(f'{name} = {record.values[name]:.6g}' for name in record.swept)}:"
        )
    for mode in record.modes:
        what = "; ".join(filter(None, (mode.course, mode.shape)))
        console.print(f"{_complex(mode.eigenvalue)}: {what}")
    _show_changes(record, console)
    console.print(f"  time  {durations(record.seconds)}")
    if record.page:
        console.print(f"  read  {record.page}")


def _show_changes(record: Linearized, console: Console) -> None:
    """What happens along a range, and where the motion is stable."""
    for c in record.critical:
        console.print(
            f"{KINDS[c.kind]} at {c.name} = {c.value:.15g}, eigenvalue {_complex(c.eigenvalue)}"
        )
    for said in (branches(record), without(record)):
        if said:
            console.print(said)
    for first, last in record.stable:
        console.print(
            f"no unstable eigenvalue for {record.swept[0]} from {first:.15g} to {last:.15g}"
        )
    for first, last in record.unstable if record.stable else ():
        console.print(
            f"unstable eigenvalues for {record.swept[0]} from {first:.15g} to {last:.15g}"
        )
    grows = not record.stable and any(row["eigenvalues"] for row in record.rows)
    if grows and len(record.swept) == 1:
        console.print(f"no stable value of {record.swept[0]} in the range")


def _nothing(record: Linearized) -> str:
    """Why there are no eigenvalues."""
    if record.states:
        return "along all of these states motions are as steady as this one"
    return "the constraints leave no degree of freedom, so that nothing can move beside the motion"


MOST_ROWS = 25
SEEN = 1e-12  # a smaller value is what rounding leaves of zero
KINDS = {
    "zero": "a real eigenvalue passes zero",
    "hopf": "a pair passes the imaginary axis",
    "double": "two real eigenvalues meet and part as a pair",
    "fold": "the branch of steady motions turns back",
}


def _complex(pair: Sequence[float]) -> str:
    """A part that is nothing beside the other is not shown: rounding leaves it of zero."""
    size = math.hypot(*pair)
    re, im = (0.0 if abs(part) <= SAME * size else part for part in pair)
    if im == 0:
        return f"{re:.6g}"
    return f"{im:.6g}i" if re == 0 else f"{re:.6g}{im:+.6g}i"
