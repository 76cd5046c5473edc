"""A motion to look at: one page that needs no network, with the mechanism moving, energies and
violations beside it, and a slider of time."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

import hamel
from derive.mechanics.records import System
from derive.textbook.writing.pages import rendered
from hamel.draw import linear, logarithmic, mechanism
from hamel.draw.canvas import ENTRY, Frame, element, finite, polyline, text
from hamel.draw.mechanism.animated import animated
from hamel.draw.mechanism.moving import Moving, frames, moving
from hamel.draw.mechanism.svg import CLASS, drawn, style
from hamel.records import Simulated
from hamel.simulate.energies import energy_error
from hamel.simulate.limits import LOOKED_AT, SHOWN

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 420, 150, 52, 10, 24, 34
Curves = Mapping[str, np.ndarray]


def page(system: System, record: Simulated, p: np.ndarray) -> str:
    """The page of a motion of the system with parameters p."""
    columns = _numbers(record)
    rows = frames(len(columns["t"]))
    shown = {name: values[rows] for name, values in columns.items()}
    measures = {name: values[rows] for name, values in record.measures.items()}
    t, q = _course(system, shown)
    scene = moving(system, t, q, p)
    drawing = mechanism.picture(system)
    return rendered(
        "hamel.simulate/view.html.j2",
        title=f"{system.model.name} in motion",
        subtitle=f"{record.title}; {t[-1] - t[0]:g} s",
        version=hamel.__version__,
        figure=Markup(mechanism.svg(drawing, "named") if drawing else ""),
        stage=Markup(_stage(system, scene)),
        plots=[Markup(plot) for plot in _plots(measures, energy_error(record.measures)[rows])],
        data=Markup(_script(scene.data)),
        speeds=_speeds(float(t[-1] - t[0])),
        space=not scene.data["view"]["flat"],
        traces=[trace[4] for trace in scene.data["traces"]],
        plot={"left": LEFT, "width": WIDTH - LEFT - RIGHT},
    )


def picture(system: System, record: Simulated, p: np.ndarray) -> str:
    """The motion as a picture that moves by itself (SVG, without a script).

    Raises AssumptionError for a mechanism in space.
    """
    t, q = _course(system, _numbers(record))
    return animated(system, t, q, p)


def _numbers(record: Simulated) -> Mapping[str, np.ndarray]:
    """Columns of the motion that are numbers."""
    columns = {name: np.asarray(values) for name, values in record.motion.items()}
    return {name: x.astype(float) for name, x in columns.items() if x.dtype.kind != "U"}


def _course(system: System, columns: Curves) -> tuple[np.ndarray, np.ndarray]:
    """Times, and a row of coordinates for each."""
    t = columns["t"]
    return t, np.array([columns[c.name] for c in system.model.coordinates]).T.reshape(len(t), -1)


def _script(data: Mapping[str, object]) -> str:
    """JSON that stands in a script: no text of the model can end it."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _stage(system: System, scene: Moving) -> str:
    """The first frame as SVG; the script moves it."""
    left, top, width, height = (f"{x:.1f}" for x in scene.box)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" id="stage" class="{CLASS}" '
        f'viewBox="{left} {top} {width} {height}" tabindex="0" role="img" '
        f'aria-label="The mechanism moving">'
    )
    traces = '<g id="traces"></g>'
    parts = "".join(drawn(mark) for mark in scene.marks)
    return f'{head}<style>{style(scene.bar)}</style>{traces}<g id="parts">{parts}</g></svg>'


def _speeds(span: float) -> list[tuple[str, float, bool]]:
    """Label, rate and whether it is the first choice: own speed, or a round one that shows the
    motion in about ten seconds."""
    own = LOOKED_AT[0] <= span <= LOOKED_AT[1]
    rate = 1.0 if own else _round(span / SHOWN)
    rates = [rate / 4, rate / 2, rate, 2 * rate]
    return [(f"{x:g}×", x, x == rate) for x in rates]


def _round(x: float) -> float:
    """1, 2 or 5 times a power of ten, not above x."""
    power = 10.0 ** math.floor(math.log10(x))
    return next(m * power for m in (5, 2, 1) if m * power <= x * (1 + 1e-9))


def _plots(measures: Curves, error: np.ndarray) -> list[str]:
    """Energies, and violations where there are any."""
    T, V = measures["T"], measures["V"]
    energies = {"T": T, "V": V, "T + V": T + V}
    if np.any(measures["work"] != 0):
        energies["work"] = measures["work"]
    errors = {
        "|φ|": measures["position_violation"],
        "|A v − c|": measures["velocity_violation"],
        "energy, rel.": np.abs(error),
    }
    shown = {name: error for name, error in errors.items() if np.any(error > 0)}
    plots = [_plot("energy (J)", measures["t"], energies, False)]
    if shown:
        about = "violation (SI) and energy error (relative)"
        plots.append(_plot(about, measures["t"], shown, True))
    return plots


def _plot(about: str, t: np.ndarray, curves: Curves, log: bool) -> str:
    """One chart over time with a cursor that the script moves; its colours are the page's."""
    values = [float(x) for curve in curves.values() for x in curve]
    up = logarithmic(values) if log else linear(values)
    frame = Frame(LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT, linear(t.tolist(), tight=True), up)
    parts = [text(LEFT, 14, about), *frame.rows(), *frame.columns(15, grid=False), frame.border()]
    parts.append(text(frame.right, frame.bottom + 30, "t (s)", anchor="end"))
    for k, (name, curve) in enumerate(curves.items()):
        points = finite(frame.points(zip(t.tolist(), curve.tolist())))
        parts.append(polyline(points, class_=f"curve{k}"))
        parts += _entry(name, k)
    cursor = {"x1": frame.left, "x2": frame.left, "y1": frame.top, "y2": frame.bottom}
    parts.append(element("line", class_="cursor", **cursor))
    height = TOP + HEIGHT + BOTTOM + ENTRY
    size = f'class="plot" viewBox="0 0 {WIDTH} {height}"'
    head = f'<svg {size} role="img" aria-label="{about} over time">'
    return "\n".join([head, *parts, "</svg>"])


def _entry(name: str, k: int) -> Sequence[str]:
    """Of the legend."""
    x, y = LEFT + 90.0 * k, TOP + HEIGHT + BOTTOM + 10.0
    line = {"x1": x, "x2": x + 18, "y1": y - 4, "y2": y - 4}
    return [element("line", class_=f"curve{k}", **line), text(x + 23, y, name)]
