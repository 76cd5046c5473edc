"""The plot of a motion: what shares an axis has one unit and one size."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hamel.draw import Curve, Panel, draw
from hamel.simulate.energies import energy_error
from hamel.simulate.limits import ALIKE

TURN = 2 * math.pi
Curves = Mapping[str, np.ndarray]


def figure(
    title: str, measures: Curves, groups: Mapping[str, Curves], units: Mapping[str, str]
) -> str:
    """The groups of curves, then energies and violations, over time, as SVG."""
    panels = [panel for about, curves in groups.items() for panel in _by_unit(about, curves, units)]
    energies = {name: measures[name] for name in ("T", "V", "work")}
    if "jacobi" in measures:
        energies["T₂ − T₀ + V"] = measures["jacobi"]
    panels.append(_panel("energy (J)", energies))
    errors = {
        "|φ|": measures["position_violation"],
        "|A v − c|": measures["velocity_violation"],
        "energy, rel.": np.abs(energy_error(measures)),
    }
    shown = {name: error for name, error in errors.items() if np.any(error > 0)}
    panels.append(_panel("violation (SI) and energy error (relative)", shown, log=True))
    return draw(title, "t (s)", measures["t"].tolist(), panels)


def _by_unit(about: str, curves: Curves, units: Mapping[str, str]) -> list[Panel]:
    """Metres and radians share no axis, nor do angles of many turns and small ones."""
    panels = []
    for unit in dict.fromkeys(units.get(name, "") for name in curves):
        same = {name: curve for name, curve in curves.items() if units.get(name, "") == unit}
        panels += [_panel(f"{about} ({unit or '1'})", part) for part in alike(same, unit)]
    return panels


def alike(curves: Curves, unit: str) -> list[dict[str, np.ndarray]]:
    """Curves of one unit in groups of one size, the first of each in the order of the curves."""
    groups: list[tuple[float, bool, dict[str, np.ndarray]]] = []
    sizes = {name: _size(curve) for name, curve in curves.items()}
    for name in sorted(sizes, key=lambda name: -sizes[name]):
        size = sizes[name]
        turning = unit == "rad" and size > TURN
        place = next(
            (one for most, turns, one in groups if turns == turning and size * ALIKE >= most), None
        )
        if place is None and size == 0.0 and groups:
            place = groups[-1][2]  # a line at zero needs no axis of its own
        if place is None:
            groups.append((size, turning, {name: curves[name]}))
        else:
            place[name] = curves[name]
    order = list(curves)
    sorted_groups = [{name: one[name] for name in order if name in one} for *_, one in groups]
    return sorted(sorted_groups, key=lambda one: order.index(next(iter(one))))


def _size(curve: np.ndarray) -> float:
    finite = np.abs(curve[np.isfinite(curve)])
    return float(finite.max()) if finite.size else 0.0


def _panel(about: str, curves: Curves, log: bool = False) -> Panel:
    return Panel(about, tuple(Curve(name, values.tolist()) for name, values in curves.items()), log)
