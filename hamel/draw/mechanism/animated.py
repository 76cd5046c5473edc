"""A motion as one SVG that moves by itself, without a script: every mark has its points over time
(SMIL, `animate`), so that it moves where a page shows it as an image."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np

from derive.diagnostics import AssumptionError
from derive.mechanics.records import System
from hamel.draw.canvas import coordinates, element
from hamel.draw.mechanism.figure import bar_width
from hamel.draw.mechanism.moving import Stage, staged
from hamel.draw.mechanism.records import Mark, Point, Vector
from hamel.draw.mechanism.svg import CLASS, style

RATE = 20  # frames a second
MOST = 240  # frames
SHOWN = (3.0, 20.0)  # seconds of the picture; a shorter motion goes slower, a longer one faster
SMALLEST = 2  # frames

Course = Sequence[Mark]  # one mark over time


def animated(system: System, t: Vector, q: Vector, p: Vector) -> str:
    """The motion q (a row for each time of t, in seconds and SI units), again and again.

    Raises AssumptionError for a mechanism in space: what is in front changes on the way.
    """
    shown = float(np.clip(t[-1] - t[0], *SHOWN))
    count = int(np.clip(round(RATE * shown), SMALLEST, MOST))
    times = np.linspace(t[0], t[-1], count + 1)
    rows = np.array([np.interp(times, t, column) for column in q.T]).T
    stage = staged(system, times, rows, p)
    if not stage.scene.view.flat:
        raise AssumptionError(
            f"{system.model.name} moves in space, which one picture cannot show in depth: "
            "use --view FILE.html"
        )
    seconds = f"{shown:.3g}s"
    courses = zip(*(stage.marks_at(k, stage.at(k)) for k in range(len(times))))
    marks = [_moving(course, seconds) for course in courses]
    return _document(system, stage, [*_traces(stage), *marks])


def _document(system: System, stage: Stage, parts: Sequence[str]) -> str:
    left, top, width, height = (f"{x:.1f}" for x in stage.box)
    name = html.escape(system.model.name)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="{CLASS}" '
        f'viewBox="{left} {top} {width} {height}" width="{width}" height="{height}" role="img" '
        f'aria-label="{name} in motion">'
    )
    paper = f'<rect class="paper" x="{left}" y="{top}" width="{width}" height="{height}"/>'
    look = f"<style>{style(bar_width(stage.scene))}</style>"
    return "\n".join([head, look, paper, *parts, "</svg>", ""])


def _traces(stage: Stage) -> list[str]:
    """The paths of the points that the mechanism's own page shows, whole."""
    paths: list[str] = []
    for _, at in stage.scene.traced:
        points: list[Point] = []
        for frame in range(len(stage.poses)):
            x, y = stage.scene.view.paper(stage.at(frame).place(at))
            base = stage.base(frame)
            points.append((x - base[0], y - base[1]))
        paths.append(element("polyline", class_="line trace", points=coordinates(points)))
    return paths


def _moving(course: Course, seconds: str) -> str:
    """One mark; what stays where it is has no animation."""
    first = course[0]
    if first.radius:
        centres = [mark.points[0] for mark in course]
        ways = {"cx": [f"{x:.1f}" for x, _ in centres], "cy": [f"{y:.1f}" for _, y in centres]}
        place = {"cx": float(centres[0][0]), "cy": float(centres[0][1])}
        inside = _animations(ways, seconds)
        return element("circle", inside, class_=first.style, **place, r=float(first.radius))
    points = [coordinates(mark.points) for mark in course]
    # between outlines of different corners there is nothing in between
    steady = len({len(mark.points) for mark in course}) == 1
    inside = _animations({"points": points}, seconds, "linear" if steady else "discrete")
    tag = "polygon" if first.closed else "polyline"
    return element(tag, inside, class_=f"line {first.style}", points=points[0])


def _animations(ways: dict[str, list[str]], seconds: str, mode: str = "linear") -> str:
    return "".join(
        element(
            "animate",
            attributeName=name,
            values=";".join(values),
            dur=seconds,
            repeatCount="indefinite",
            calcMode=None if mode == "linear" else mode,
        )
        for name, values in ways.items()
        if len(set(values)) > 1
    )
