"""identify: parameters of a model from measured motion; which ones it can tell, and motions that
tell them."""

from __future__ import annotations

import contextlib
import importlib.util
import math
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from derive.diagnostics import AssumptionError, ModelError, listed
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.states.closing import nominal
from hamel.build.files import write_text
from hamel.build.module import temporary_module
from hamel.build.stages import equations_of
from hamel.identify.base import Base, base_parameters
from hamel.identify.excitation import columns, excitation, undriven
from hamel.identify.fit import Fit, fit, own_values, relative
from hamel.identify.limits import DOUBTFUL
from hamel.identify.measured import recorded
from hamel.identify.page import page
from hamel.identify.shooting import check_free, quantities, scales_of, shot
from hamel.identify.variation import is_continuous, varied
from hamel.identify.writing import identified
from hamel.optional import library
from hamel.records import (
    BaseParameter,
    BaseParameters,
    Excitation,
    FreeParameter,
    FreeParameters,
    Identified,
    StandardParameter,
)
from hamel.show import table

if TYPE_CHECKING:
    from rich.console import Console

PAGE = "identification.html"
SOLVER = "clarabel"
HOW = ("dop853",)  # motions of the shooting
SEEN = ("dynamics", "velocity", "state", "outputs", "project", "constraints")


def base(path: str | PathLike[str], choice: str | None) -> BaseParameters:
    """Which sums of standard parameters the motion of a model can tell."""
    equations = _equations(path, choice)
    result = base_parameters(equations)
    own = own_values(equations)
    values = result.combination @ own
    return BaseParameters(
        model=equations.system.model.name,
        standard=len(result.standard),
        by_structure=result.by_structure,
        base=tuple(
            _parameter(result, k, file=float(values[k])) for k in range(len(result.leading))
        ),
        without_effect=result.without_effect,
        least_kept=result.kept,
        largest_dropped=result.dropped,
    )


def _equations(path: str | PathLike[str], choice: str | None) -> Equations:
    equations = equations_of(path, choice)
    names = {request.name for request in equations.requests}
    if "regressor" in names and not equations.w:
        raise AssumptionError(
            f"{equations.system.model.name} has no freedom: its constraints decide the whole "
            "motion, and take every force that would tell a parameter",
            "a model without the constraint that drives it, and with its force as an input",
        )
    if "regressor_w" not in names:
        analytic = equations.system.model.kinetic is not None
        raise AssumptionError(
            f"{equations.system.model.name} has no body with a mass that moves, so no standard "
            "parameters",
            "bodies and joints in place of `kinetic:`" if analytic else "",
        )
    return equations


def _parameter(found: Base, k: int, **values: float | None) -> BaseParameter:
    x = found.standard[found.leading[k]]
    return BaseParameter(x.name, x.unit, found.sums[k], **values)


def run(
    path: str | PathLike[str],
    data: str | Path,
    choice: str | None,
    cutoff: float | None,
    check: str | Path | None,
    out: str | Path | None,
    html: str | Path | None,
) -> Identified:
    """The values from a file of measurements, the model with them in `out`, the page in `html`."""
    solver: Any = None
    if out is not None or importlib.util.find_spec(SOLVER):
        solver = library(SOLVER, "physically consistent parameters", "identify")
    equations = _equations(path, choice)
    if cutoff is not None and not 0.0 < cutoff < math.inf:
        raise ModelError(f"the cutoff is {cutoff}", "a frequency in Hz")
    result = fit(equations, data, cutoff, check, solver)
    record = _record(result, data, check, out, html)
    if out is not None:
        assert result.consistent is not None  # with a solver there are some
        text = identified(path, equations.system, result.base.standard, result.consistent)
        write_text(Path(out), text)
    if html is not None:
        write_text(Path(html), page(result, record))
    return record


def _record(
    found: Fit,
    data: str | Path,
    check: str | Path | None,
    out: str | Path | None,
    html: str | Path | None,
) -> Identified:
    own, consistent = found.base.combination @ found.own, found.consistent
    together = None if consistent is None else found.base.combination @ consistent
    base = tuple(
        _parameter(
            found.base,
            k,
            file=float(own[k]),
            ordinary=float(found.ordinary.values[k]),
            weighted=float(found.weighted.values[k]),
            deviation=float(found.weighted.deviations[k]),
            consistent=None if together is None else float(together[k]),
        )
        for k in range(len(found.base.leading))
    )
    standard = tuple(
        StandardParameter(
            x.name,
            x.unit,
            float(found.own[k]),
            None if consistent is None else float(consistent[k]),
        )
        for k, x in enumerate(found.base.standard)
    )
    missing = () if consistent is not None else (
        "no physically consistent values: pip install 'hamel[identify]'",
    )  # fmt: skip
    left = tuple(map(float, relative(found.rows, found.values)))
    return Identified(
        model=found.equations.system.model.name,
        data=Path(data).name,
        rows=len(found.rows.t),
        base=base,
        standard=standard,
        condition=found.weighted.condition,
        equations=found.equations.w,
        noise=tuple(map(float, found.weighted.spread)),
        residuals=left,
        check=None if check is None else Path(check).name,
        check_residuals=()
        if found.fresh is None
        else tuple(map(float, relative(found.fresh, found.values))),
        notes=(*found.motion.notes, *missing, *_doubts(left)),
        file=None if out is None else Path(out),
        page=None if html is None else Path(html),
    )


def excite(
    path: str | PathLike[str],
    out: str | Path,
    period: float,
    harmonics: int,
    speed: float | None,
    rate: float,
) -> Excitation:
    """A Fourier series that tells the base parameters, sampled into a file."""
    for name, value in (("period", period), ("rate", rate), ("harmonics", harmonics)):
        if not 0.0 < value < math.inf:
            raise ModelError(f"{name} is {value}", "more than zero")
    equations = _equations(path, None)
    result = base_parameters(equations)
    start = nominal(equations.system)
    series, condition = excitation(
        equations, result, start, period, harmonics, math.inf if speed is None else speed
    )
    names = [c.name for c in equations.system.model.coordinates]
    t = np.arange(0.0, period, 1.0 / rate)
    rows = columns(names, series, t)
    lines = [
        ",".join(rows),
        *(",".join(map(repr, row)) for row in np.column_stack([*rows.values()]).tolist()),
    ]
    write_text(Path(out), "\n".join(lines) + "\n")
    return Excitation(
        equations.system.model.name, Path(out), period, harmonics, condition, len(result.leading),
        tuple(map(float, series.middle)), series.a.tolist(), series.b.tolist(),
        undriven(equations),
    )  # fmt: skip


def shoot(
    path: str | PathLike[str],
    data: str | Path,
    free: Sequence[str],
    choice: str | None,
    segments: int,
    cutoff: float | None,
) -> FreeParameters:
    """Any parameters of a model by simulation."""
    if segments < 1:
        raise ModelError(f"{segments} segments", "one or more")
    equations = based(equations_of(path, choice))
    check_free(equations, free)
    motion = recorded(equations, data, cutoff)
    quantities(equations, motion)
    functions = [x for x in SEEN if equations.has(x)]
    with contextlib.ExitStack() as stack:
        module = stack.enter_context(temporary_module(equations, HOW, None, functions))
        along = None
        if is_continuous(equations):
            whole = varied(equations, free, scales_of(equations, free).tolist())
            along = stack.enter_context(temporary_module(whole, HOW, ("none",)))
        result = shot(equations, module, motion, free, segments, along)
    model = equations.system.model
    known = {x.name: x for x in model.parameters}
    return FreeParameters(
        model=model.name,
        data=Path(data).name,
        rows=len(motion.t),
        segments=segments,
        parameters=tuple(
            FreeParameter(name, known[name].unit, known[name].value, float(value), float(deviation))
            for name, value, deviation in zip(free, result.values, result.deviations)
        ),
        measured=dict(zip(result.measured, map(float, result.noise))),
        gap=result.gap,
        notes=_unexplained(result.doubtful),
    )


def _unexplained(doubtful: Sequence[str]) -> tuple[str, ...]:
    if not doubtful:
        return ()
    return (
        f"much of {listed(doubtful)} is left, so these values are not to be trusted: more segments "
        "find the way from farther away; else the model may lack a force",
    )


def _show_free(record: FreeParameters, console: Console) -> None:
    head = ("parameter", "unit", "file", "value", "deviation")
    rows = [
        (x.name, x.unit, *(_cell(v) for v in (x.file, x.value, x.deviation)))
        for x in record.parameters
    ]
    table(console, head, rows, right=range(2, len(head)))
    console.print(
        f"{record.model}: {record.rows} rows of {record.data} in {record.segments} segments, "
        f"which meet to {record.gap:.1g} of the spread of the state"
    )
    for name, left in record.measured.items():
        console.print(f"  {name} is left with {left:.3g}")
    for note in record.notes:
        console.print(f"  {note}")


def show(
    record: BaseParameters | Identified | Excitation | FreeParameters, console: Console
) -> None:
    """The values as a table, and what they rest on."""
    if isinstance(record, BaseParameters):
        _show_base(record, console)
    elif isinstance(record, Excitation):
        console.print(
            f"{record.model}: a series of {record.harmonics} harmonics, period "
            f"{record.period:g} s, tells {record.base} base parameters; condition "
            f"{record.condition:.3g}"
        )
        if record.undriven:
            console.print(
                f"  no input moves {listed(record.undriven)}: the inputs alone cannot follow the "
                "series"
            )
        console.print(f"  wrote {record.file}")
    elif isinstance(record, FreeParameters):
        _show_free(record, console)
    else:
        _show_values(record, console)


def _show_base(record: BaseParameters, console: Console) -> None:
    rows = [(x.name, x.unit, f"{x.file:.6g}", x.sum) for x in record.base]
    table(console, ("base parameter", "unit", "value", "sum of"), rows, right=range(2, 3))
    left = f", {len(record.base)} by rank" if len(record.base) < record.by_structure else ""
    console.print(
        f"{record.model}: {len(record.base)} base parameters of {record.standard} standard ones: "
        f"{record.by_structure} by structure{left} "
        f"(least kept {record.least_kept:.2g}, largest dropped {record.largest_dropped:.2g})"
    )
    if record.without_effect:
        console.print(f"  without effect: {', '.join(record.without_effect)}")


def _show_values(record: Identified, console: Console) -> None:
    head = ("base parameter", "unit", "file", "ordinary", "weighted", "deviation", "consistent")
    rows = [
        (
            x.name,
            x.unit,
            *(_cell(v) for v in (x.file, x.ordinary, x.weighted, x.deviation, x.consistent)),
        )
        for x in record.base
    ]
    table(console, head, rows, right=range(2, len(head)))
    console.print(
        f"{record.model}: {len(record.base)} base parameters from {record.rows} rows of "
        f"{record.data}, condition {record.condition:.3g}"
    )
    for note in record.notes:
        console.print(f"  {note}")
    _show_residuals("left of the forces", record.equations, record.residuals, console)
    if record.check:
        about = f"left of those of {record.check}"
        _show_residuals(about, record.equations, record.check_residuals, console)
    for place in (record.file, record.page):
        if place is not None:
            console.print(f"  wrote {place}")


def _doubts(left: tuple[float, ...]) -> tuple[str, ...]:
    """What to think of where much of the forces is left."""
    if max(left, default=0.0) < DOUBTFUL:
        return ()
    return (
        "much of the forces is left, so these values are not to be trusted: the model may lack a "
        "force, the filter may take some of the motion away (--cutoff), or noise hides it",
    )


def _show_residuals(
    about: str, names: tuple[str, ...], values: tuple[float, ...], console: Console
) -> None:
    shown = ", ".join(f"{n} {100.0 * x:.2g} %" for n, x in zip(names, values))
    console.print(f"  {about}: {shown}")


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.5g}"
