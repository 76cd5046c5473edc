"""The canvas: SVG elements, documents, and frames with an axis along and one up.

Text of our own, rounded to a tenth of a pixel: the same bytes for the same numbers.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hamel.draw.axis import Axis

# Okabe and Ito's colours: told apart by every kind of colour vision.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
ENTRY = 18  # pixels of a legend entry
STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#333}.title{font-size:15px;font-weight:600}"
    ".grid{stroke:#ddd}.frame{fill:none;stroke:#888}"
    "polyline{fill:none;stroke-width:1.5;stroke-linejoin:round}"
)

Point = tuple[float, float]
Attribute = str | float | None


def element(tag: str, content: str = "", /, **attributes: Attribute) -> str:
    """<tag …>content</tag>, attributes in this order: `class_` is class and `stroke_width`
    stroke-width; None leaves one out."""
    parts = [
        f' {name.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for name, value in attributes.items()
        if value is not None
    ]
    start = f"<{tag}{''.join(parts)}"
    return f"{start}>{content}</{tag}>" if content else f"{start}/>"


def _value(value: str | float) -> str:
    """Whole numbers as they are, others to a tenth."""
    return f"{value:.1f}" if isinstance(value, float) else str(value)


def text(x: float, y: float, words: str, style: str = "", anchor: str = "start") -> str:
    """Words at a point; `anchor` is start, middle or end."""
    place = {"x": float(x), "y": float(y), "text_anchor": anchor, "class_": style or None}
    return element("text", html.escape(words), **place)


def polyline(points: Iterable[Point], **attributes: Attribute) -> str:
    """A line through points."""
    return element("polyline", **attributes, points=coordinates(points))


def coordinates(points: Iterable[Point]) -> str:
    """x,y of every point."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def document(width: int, height: int, parts: Iterable[str], style: str = STYLE) -> str:
    """A whole drawing on white."""
    size = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    paper = '<rect width="100%" height="100%" fill="#fff"/>'
    return "\n".join([head, f"<style>{style}</style>", paper, *parts, "</svg>", ""])


@dataclass(frozen=True)
class Frame:
    """The rectangle that values are drawn in: pixels, and an axis along and one up."""

    left: float
    top: float
    width: float
    height: float
    along: Axis
    up: Axis

    @property
    def right(self) -> float:
        """x of the right edge, in pixels from the left of the picture."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """y of the bottom edge, in pixels downwards as SVG counts them."""
        return self.top + self.height

    def x(self, value: float) -> float:
        """The pixel of a value along."""
        return self.left + self.along.position(value) * self.width

    def y(self, value: float) -> float:
        """The pixel of a value up."""
        return self.top + self.height * (1 - self.up.position(value))

    def points(self, values: Iterable[Point]) -> list[Point]:
        """The pixels of pairs of values."""
        return [(self.x(x), self.y(y)) for x, y in values]

    def border(self) -> str:
        """The rectangle around the frame as an SVG element; its look is that of the class
        `frame`."""
        return element(
            "rect",
            class_="frame",
            x=self.left,
            y=self.top,
            width=self.width,
            height=self.height,
        )

    def rows(self, grid: bool = True) -> list[str]:
        """Ticks up, with lines across where there is a grid."""
        parts = []
        for at, label in self.up.ticks:
            y = self.top + self.height * (1 - at)
            if grid:
                parts.append(
                    element("line", class_="grid", x1=self.left, x2=self.right, y1=y, y2=y)
                )
            parts.append(text(self.left - 6, y + 4, label, anchor="end"))
        return parts

    def columns(self, below: float, grid: bool = True) -> list[str]:
        """Ticks along, so many pixels below, with lines upwards where there is a grid."""
        parts = []
        for at, label in self.along.ticks:
            x = self.left + at * self.width
            if grid:
                parts.append(
                    element("line", class_="grid", x1=x, x2=x, y1=self.top, y2=self.bottom)
                )
            parts.append(text(x, self.bottom + below, label, anchor="middle"))
        return parts


def finite(points: Sequence[Point]) -> list[Point]:
    """Those of numbers (x − x is 0 only for them)."""
    return [(x, y) for x, y in points if x - x == 0 and y - y == 0]
