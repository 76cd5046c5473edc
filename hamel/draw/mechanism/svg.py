"""A figure as SVG: one document that follows the reader's light or dark, with title and
description."""

from __future__ import annotations

import html

from hamel.draw.canvas import coordinates, element
from hamel.draw.mechanism.figure import Figure
from hamel.draw.mechanism.records import Lettering, Mark
from hamel.draw.mechanism.typeset import SIZE, SMALL, extent, runs

LIGHT = {
    "paper": "#fdfdfb",
    "ink": "#1d1f23",
    "soft": "#5d6470",
    "fill": "#e9ecf1",
    "plate": "#dfe5ee",
    "blue": "#1554a0",
    "red": "#a8320a",
    "floor": "#f1f2f4",
    "veil": "#dfe5ee",
}
DARK = {
    "paper": "#17191c",
    "ink": "#e4e5e7",
    "soft": "#a0a6b0",
    "fill": "#2c3138",
    "plate": "#333b47",
    "blue": "#86b9e8",
    "red": "#f2a079",
    "floor": "#1f2226",
    "veil": "#333b47",
}
# of letters: their contrast is what is tested
TEXT_COLOURS = ("ink", "soft", "blue", "red")
# style: (stroke, fill, width in pixels, dashes)
STYLES: dict[str, tuple[str, str, float, str]] = {
    "bar": ("ink", "none", 0.0, ""),
    "core": ("fill", "none", 0.0, ""),
    "plate": ("ink", "plate", 1.8, ""),
    "body": ("ink", "veil", 1.4, ""),
    "block": ("ink", "plate", 1.8, ""),
    "disc": ("ink", "veil", 1.8, ""),
    "sphere": ("ink", "plate", 1.6, ""),
    "rim": ("ink", "veil", 2.2, ""),
    "stay": ("ink", "none", 1.2, ""),
    "fine": ("soft", "none", 1.0, ""),
    "pin": ("ink", "paper", 1.6, ""),
    "joint": ("ink", "fill", 1.3, ""),
    "ball": ("ink", "plate", 1.6, ""),
    "bob": ("ink", "plate", 1.8, ""),
    "mass": ("ink", "paper", 1.0, ""),
    "point": ("ink", "ink", 0.8, ""),
    "quarter": ("none", "ink", 0.0, ""),
    "support": ("ink", "paper", 1.5, ""),
    "post": ("ink", "none", 3.0, ""),
    "ground": ("ink", "none", 1.6, ""),
    "hatch": ("ink", "none", 0.9, ""),
    "floor": ("soft", "floor", 0.9, ""),
    "grid": ("soft", "none", 0.4, ""),
    "rail": ("ink", "none", 2.4, ""),
    "rod": ("ink", "none", 2.0, ""),
    "axle": ("ink", "none", 2.0, ""),
    "tyre": ("ink", "ink", 1.0, ""),
    "cross": ("ink", "none", 2.2, ""),
    "spring": ("ink", "none", 1.3, ""),
    "damper": ("ink", "none", 1.3, ""),
    "rope": ("ink", "none", 1.1, ""),
    "pulley": ("ink", "paper", 1.4, ""),
    "pitch": ("soft", "none", 1.1, "7 3 1.5 3"),
    "curve": ("soft", "none", 1.2, "5 3"),
    "axis": ("soft", "none", 0.9, "7 2.5 1.5 2.5"),
    "reference": ("soft", "none", 0.8, "3 2.5"),
    "dimension": ("blue", "none", 1.2, ""),
    "dimension-head": ("none", "blue", 0.0, ""),
    "input": ("red", "none", 1.8, ""),
    "input-head": ("none", "red", 0.0, ""),
    "gravity": ("ink", "none", 1.5, ""),
    "gravity-head": ("none", "ink", 0.0, ""),
    "axis-arrow": ("soft", "none", 1.2, ""),
    "axis-arrow-head": ("none", "soft", 0.0, ""),
    "leader": ("soft", "none", 0.6, ""),
    "trace": ("blue", "none", 1.0, ""),
}
LETTERS = {
    "coordinate": "blue",
    "input": "red",
    "gravity": "ink",
    "frame": "soft",
    "joint": "ink",
    "body": "soft",
}
CLASS = "mechanism"


def svg(figure: Figure, name: str = "mechanism") -> str:
    """The document; `name` keeps its parts apart from others on one page."""
    width, height = f"{figure.width:.1f}", f"{figure.height:.1f}"
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="{CLASS}" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" '
        f'aria-labelledby="{name}-title {name}-about">'
    )
    parts = [
        head,
        element("title", html.escape(figure.title), id=f"{name}-title"),
        element("desc", html.escape(figure.about), id=f"{name}-about"),
        f"<style>{style(figure.bar)}</style>",
        '<rect class="paper" width="100%" height="100%"/>',
        *(drawn(mark) for mark in figure.marks),
        *(_lettering(x) for x in figure.letterings),
        "</svg>",
        "",
    ]
    return "\n".join(parts)


def style(bar: float) -> str:
    """The look of every mark in light and in dark; nothing outside the drawing is touched."""
    rules = [_colours(LIGHT), f"@media (prefers-color-scheme:dark){{{_colours(DARK)}}}"]
    rules.append(f".{CLASS} .paper{{fill:var(--m-paper)}}")
    for name, (stroke, fill, width, dashes) in STYLES.items():
        wide = {"bar": bar + 2.4, "core": bar - 0.6}.get(name, width)
        look = f"stroke:{_variable(stroke)};fill:{_variable(fill)};stroke-width:{wide:.1f}"
        look += ";fill-opacity:0.55" if fill == "veil" else ""
        look += f";stroke-dasharray:{dashes}" if dashes else ""
        rules.append(f".{CLASS} .{name}{{{look}}}")
    rules.append(f".{CLASS} .line{{stroke-linecap:round;stroke-linejoin:round}}")
    rules.append(
        f".{CLASS} text{{font:{SIZE:.0f}px 'STIX Two Text','Times New Roman',Tinos,"
        "'Liberation Serif',serif;stroke:none}"
    )
    rules += [f".{CLASS} .t-{name}{{fill:{_variable(x)}}}" for name, x in LETTERS.items()]
    rules.append(f".{CLASS} .t-body{{font-size:{SIZE:.0f}px}}")
    rules.append(
        f".{CLASS} .i{{font-style:italic}}.{CLASS} .b{{font-weight:bold}}"
        f".{CLASS} .s{{font-size:{SIZE * SMALL:.1f}px}}"
    )
    return "".join(rules)


def _colours(colours: dict[str, str]) -> str:
    return f".{CLASS}{{{';'.join(f'--m-{name}:{value}' for name, value in colours.items())}}}"


def _variable(name: str) -> str:
    return name if name == "none" else f"var(--m-{name})"


def drawn(mark: Mark) -> str:
    """One mark as an element."""
    if mark.radius:
        (x, y) = mark.points[0]
        return element("circle", class_=mark.style, cx=x, cy=y, r=float(mark.radius))
    tag = "polygon" if mark.closed else "polyline"
    return element(tag, class_=f"line {mark.style}", points=coordinates(mark.points))


def _lettering(x: Lettering) -> str:
    """The letters in the middle of their box, and the line that leads to what they name."""
    _, above, _ = extent(x.label.latex)
    middle = (x.box.left + x.box.right) / 2
    base = x.box.top + above
    text = element(
        "text",
        lettered(x.label.latex),
        class_=f"t-{x.label.style}",
        x=float(middle),
        y=float(base),
        text_anchor="middle",
    )
    if not x.leader:
        return text
    return element("polyline", class_="line leader", points=coordinates(x.leader)) + text


def lettered(latex: str) -> str:
    """A symbol as parts of a text element: italic letters, indices below the line."""
    spans, level = [], 0
    for run in runs(latex):
        shift = {-1: 0.24, 0: 0.0, 1: -0.36}
        dy = SIZE * (shift[run.level] - shift[level])
        level = run.level
        looks = {"italic": "i", "bold": "b"}.get(run.look, "")
        classes = " ".join(c for c in (looks, "s" if run.level else "") if c)
        spans.append(element("tspan", html.escape(run.text), class_=classes or None, dy=dy or None))
    return "".join(spans)
