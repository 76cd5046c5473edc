"""A derivation that computes: its page with sliders, the mechanism moving, plots, and the numbers
of the equation under the cursor."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from markupsafe import Markup

from derive.diagnostics import AssumptionError
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.states.initial import initial_state
from derive.textbook import names
from derive.textbook.derivation import derivation
from derive.textbook.formulas.notation import symbols_of
from derive.textbook.records import Document
from derive.textbook.writing.html import parts_of
from derive.textbook.writing.mathml import mathml
from derive.textbook.writing.pages import rendered
from hamel.draw.canvas import ENTRY, element, text
from hamel.draw.mechanism.figure import bar_width
from hamel.draw.mechanism.svg import CLASS, drawn, lettered, style
from hamel.live.course import course
from hamel.live.functions import FORMULAS, POSES, places, with_live
from hamel.live.limits import CURVES, FEW, LARGEST_PUSH, NOTHING, ROWS, SPAN, TOLERANCE
from hamel.live.module import Module, check_compiler, module_of
from hamel.live.shape import Drawing, drawing_of
from hamel.simulate.exact import state_of
from hamel.simulate.method import Method, fitting_enforcement

INTEGRATOR = "dopri5"
CALLED = ("dynamics", "energy", "project", "constraints", "velocity", "state")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 420, 130, 52, 10, 22, 30
METHOD = Method("quasi_velocities", None, None, INTEGRATOR, None, TOLERANCE, None)


@dataclass(frozen=True)
class Live:
    """What a live page is made of."""

    equations: Equations
    document: Document
    module: Module
    drawing: Drawing
    data: Mapping[str, Any]
    symbols: Mapping[str, str]


def live_of(equations: Equations, roads: Sequence[str]) -> Live:
    """The page's parts. Raises ToolchainError without a compiler for WebAssembly, AssumptionError
    for equations without a choice of quasi-velocities, ModelError for a model without a consistent
    start."""
    check_compiler()
    if equations.generalized_velocities:
        raise AssumptionError("a live page shows equations in quasi-velocities")
    equations = replace(based(equations), charts=())
    system, document = equations.system, derivation(equations, roads)
    initial = initial_state(system)
    p = np.array(system.own_parameters, dtype=float)
    x = state_of(equations, initial, p, 0.0)
    drawing = drawing_of(system, *course(equations, x, p), p)
    formed = with_live(equations, document, drawing.bodies)
    enforcement = fitting_enforcement(METHOD, equations).name
    names = [function.name for function in formed.functions]
    module = module_of(
        formed, [x for x in names if x in (*CALLED, POSES, FORMULAS)], INTEGRATOR, enforcement
    )
    data = {
        **drawing.data,
        **_of_motion(equations, x, p),
        "closes": any(name == "project" for name in names),
        "equations": places(document),
        "size": [LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT],
        "rtol": TOLERANCE,
    }
    return Live(equations, document, module, drawing, data, symbols_of(equations))


def _of_motion(equations: Equations, x: np.ndarray, p: np.ndarray) -> dict[str, Any]:
    """The start, and which columns are what."""
    return {
        "times": np.linspace(0.0, SPAN, ROWS + 1).round(9).tolist(),
        "x": x.tolist(),
        "p": p.tolist(),
        "nq": equations.system.q.numel(),
        "nw": len(equations.w),
        "quaternions": list(equations.system.quaternions),
    }


@dataclass(frozen=True)
class Slider:
    """`kind` is p, x or u, `index` the place in it; `latex` is the symbol on the page."""

    kind: str
    index: int
    latex: str
    unit: str
    low: float
    high: float
    value: float

    @property
    def symbol(self) -> Markup:
        """As the formulas have it."""
        return Markup(mathml(self.latex))

    @property
    def shown(self) -> str:
        """The value, until the script writes it."""
        value = self.value if abs(self.value) > NOTHING else 0.0
        return f"{value:.4g}".replace("-", "−")


def sliders(live: Live) -> dict[str, list[Slider]]:
    """Parameters, initial values and inputs."""
    equations, system, symbols = live.equations, live.equations.system, live.symbols
    units = {x.name: x.unit for x in system.model.parameters}
    p, x, u = (equations.argument(name) for name in "pxu")
    parameters = [
        _slider("p", k, symbols[name], units.get(name, ""), value)
        for k, (name, value) in enumerate(zip(p.labels, live.data["p"]))
    ]
    nq = live.data["nq"]
    initial = [
        _slider("x", k, symbols[x.labels[k]], x.units[k], live.data["x"][k], k < nq)
        for k in _free(system, live.data)
    ]
    inputs = [
        Slider("u", k, symbols[name], _unit(unit), -LARGEST_PUSH, LARGEST_PUSH, 0.0)
        for k, (name, unit) in enumerate(zip(u.labels, u.units))
    ]
    return {"Parameters": parameters, "Initial values": initial, "Inputs": inputs}


def _unit(text: str) -> str:
    return names.unit(text) if text not in ("", "1") else ""


def _free(system: System, data: Mapping[str, Any]) -> list[int]:
    """Coordinates that the file starts from, all where nothing ties them; and quasi-velocities."""
    names = [c.name for c in system.model.coordinates]
    tied = {k + j for k in data["quaternions"] for j in range(4)}
    given = {value.name for value in system.model.initial if value.held}
    some = [k for k, name in enumerate(names) if name in given and k not in tied]
    if not system.phi.numel():
        some = [k for k in range(len(names)) if k not in tied]
    first = data["nq"]
    return [*some[:FEW], *range(first, first + data["nw"])]


def _slider(
    kind: str, index: int, latex: str, unit: str, value: float, angle: bool = False
) -> Slider:
    if kind == "p" and value:
        low, high = sorted((0.2 * value, 3.0 * value))
    elif angle and unit == "rad":
        low, high = value - math.pi, value + math.pi
    else:
        reach = max(1.0, 2.0 * abs(value))
        low, high = value - reach, value + reach
    return Slider(kind, index, latex, _unit(unit), low, high, value)


def page(live: Live, figure: str = "") -> str:
    """The page; `figure` is the SVG that opens it."""
    binary = base64.b64encode(live.module.binary).decode("ascii")
    document = live.document
    return rendered(
        "hamel.live/page.html.j2",
        title=document.title,
        version=document.version,
        figure=Markup(figure),
        wide=any(section.column for section in document.sections),
        stage=Markup(_stage(live)),
        plots=[Markup(_plot(about, names)) for about, names in _plots(live)],
        groups_of_sliders=[(name, some) for name, some in sliders(live).items() if some],
        space=not live.drawing.data["view"]["flat"],
        loader=Markup(live.module.loader),
        binary=binary,
        data=Markup(json.dumps(live.data, separators=(",", ":")).replace("<", "\\u003c")),
        span=SPAN,
        **parts_of(document),
    )


def _stage(live: Live) -> str:
    left, top, width, height = (f"{x:.1f}" for x in live.drawing.box)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" id="stage" class="{CLASS}" '
        f'viewBox="{left} {top} {width} {height}" tabindex="0" role="img" '
        f'aria-label="The mechanism with these values">'
    )
    marks = "".join(drawn(mark) for mark in live.drawing.marks)
    look = style(bar_width(live.drawing.stage.scene))
    return f'{head}<style>{look}</style><g id="parts">{marks}</g></svg>'


def _plots(live: Live) -> list[tuple[str, Sequence[str]]]:
    """What is plotted, and the symbols of the curves."""
    speeds = [live.symbols[name] for name in live.equations.w]
    about = "quasi-velocities (SI)"
    if len(speeds) > CURVES:
        about = f"quasi-velocities (SI), the first {CURVES} of {len(speeds)}"
    return [(about, speeds[:CURVES]), ("energy (J)", ("T", "V", "T+V"))]


def _plot(about: str, symbols: Sequence[str]) -> str:
    """A frame whose curves the script draws."""
    box = {"x": LEFT, "y": TOP, "width": WIDTH - LEFT - RIGHT, "height": HEIGHT}
    parts = [text(LEFT, 14, about), element("rect", class_="frame", **box)]
    for k, latex in enumerate(symbols):
        x, y = LEFT + 90.0 * k, TOP + HEIGHT + BOTTOM + 4.0
        line = {"x1": x, "x2": x + 18, "y1": y - 4, "y2": y - 4}
        curve = element("polyline", class_=f"curve{k}", points="")
        name = element("text", lettered(latex), class_="symbol", x=x + 23, y=y)
        parts += [curve, element("line", class_=f"curve{k}", **line), name]
    parts.append(element("line", class_="cursor", x1=LEFT, x2=LEFT, y1=TOP, y2=TOP + HEIGHT))
    parts.append(text(LEFT - 4, TOP + 10, "", "high", "end"))
    parts.append(text(LEFT - 4, TOP + HEIGHT, "", "low", "end"))
    parts.append(text(WIDTH - RIGHT, TOP + HEIGHT + 14, f"{SPAN:g} s", anchor="end"))
    size = f'class="plot" viewBox="0 0 {WIDTH} {TOP + HEIGHT + BOTTOM + ENTRY}"'
    return f'<svg {size} role="img" aria-label="{about} over time">{"".join(parts)}</svg>'
