"""What a complete sweep holds: columns, an xarray Dataset over what varies, Sobol indices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from derive.diagnostics import ToolchainError, counted
from hamel.optional import library
from hamel.sweep.axes import MOVED, NUMBER, STATUS, problem
from hamel.sweep.folder import Folder
from hamel.sweep.job import Motions
from hamel.sweep.kept import Kept
from hamel.sweep.limits import SAME
from hamel.sweep.plan import Plan
from hamel.sweep.work import Held, columns_in, moves_in, summary_of

SHOWN = 1_000_000  # rows that a page reads


def held_of_rows(plan: Plan) -> Callable[[bytes], Held]:
    """What is known of a file of rows."""

    def held(content: bytes) -> Held:
        columns = columns_in(content)
        quantities = {each.label: columns[each.label] for each in plan.kept}
        first, moved = int(columns[NUMBER][0]), (columns[MOVED], moves_in(content))
        return summary_of(first, quantities, columns[STATUS], *moved)

    return held


def columns_of(plan: Plan, folder: Folder) -> dict[str, np.ndarray] | None:
    """All rows by name, where there are not too many for a page."""
    if plan.asked.reduce or plan.design.size > SHOWN:
        return None
    return rows(plan, folder)


def rows(plan: Plan, folder: Folder) -> dict[str, np.ndarray]:
    """All rows by name, in the order of the motions. Raises ToolchainError where a file is gone or
    damaged."""
    names = map(folder.chunk_name, range(plan.chunks))
    parts = [folder.understood(name, columns_in) for name in names]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def dataset(plan: Plan, folder: Folder) -> Any:
    """Over the axes: grids with their values as coordinates, rows of files and samples by
    number."""
    xarray = library("xarray", "to_xarray()")
    if plan.asked.reduce:
        raise ToolchainError("the sweep kept no rows", "the same sweep without --reduce")
    columns, design = rows(plan, folder), plan.design
    dims = design.dimensions if design.samples > 1 else design.dimensions[:-1]
    shape = design.shape if design.samples > 1 else design.shape[:-1]
    if not dims:
        dims, shape = ("sample",), (1,)
    units = {**plan.units, **{each.label: each.unit for each in plan.kept}}
    axes = [*design.methods, *design.grids]
    coordinates = {a.name: (a.name, list(a.values), {"units": units.get(a.name, "")}) for a in axes}
    drawn = [n for n in design.names if n not in coordinates]
    names = [*drawn, *(each.label for each in plan.kept), STATUS, MOVED]
    variables = {
        name: (dims, columns[name].reshape(shape), {"units": units.get(name, "")}) for name in names
    }
    about = {"model": plan.model.name, "motions": design.size, "hamel": plan.jobs[0].version}
    return xarray.Dataset(variables, coordinates, about)


def _noise(plan: Plan, each: Kept, values: np.ndarray) -> float:
    """What values that are the same differ by: rounding, and the tolerances of what is integrated.
    `atol` says something of states alone, whose units it is in."""
    work, size = plan.jobs[0].work, float(np.max(np.abs(values)))
    if not isinstance(work, Motions) or work.stepping.step_size is not None:
        return SAME * size
    by = work.stepping
    return max(SAME, by.rtol) * size + (by.atol if each.text in work.states else 0.0)


def sensitivities(plan: Plan, folder: Folder) -> tuple[dict[str, Any], list[str]]:
    """First order and total Sobol indices of every kept quantity, by SALib, where the design is
    made for them; and which quantities have none."""
    design = plan.design
    if design.kind != "saltelli":
        return {}, []
    sobol = library("SALib.analyze.sobol", "Sobol indices")
    columns = rows(plan, folder)
    names = [each.name for each in design.distributions]
    result: dict[str, Any] = {}
    without: list[str] = []
    for each in plan.kept:
        values = columns[each.label]
        if missing := int(np.sum(~np.isfinite(values))):
            has = counted(missing, "motion of the design has", "motions of the design have")
            without.append(f"no Sobol indices of {each.label}: {has} no value")
            continue
        if (spread := np.ptp(values)) <= _noise(plan, each, values):
            but = "" if spread == 0 else ", but for rounding and the tolerances"
            without.append(f"no Sobol indices of {each.label}: it is the same in all motions{but}")
            continue
        about = problem(len(names), names)
        indices = sobol.analyze(about, values, calc_second_order=False, seed=0)
        result[each.label] = {
            "names": names,
            "first": indices["S1"].tolist(),
            "first_confidence": indices["S1_conf"].tolist(),
            "total": indices["ST"].tolist(),
            "total_confidence": indices["ST_conf"].tolist(),
        }
    return result, without
