"""A figure as a TikZ picture, with the same marks and letters in the same places."""

from __future__ import annotations

from hamel.draw.mechanism.figure import Figure
from hamel.draw.mechanism.records import Lettering, Mark, Point
from hamel.draw.mechanism.svg import LETTERS, LIGHT, STYLES

UNIT = 0.8  # points a pixel


def tikz(figure: Figure) -> str:
    """The tikzpicture; it needs the package tikz and nothing else."""
    colours = LIGHT | {"paper": "#ffffff"}
    lines = [_colour(name, value) for name, value in colours.items()]
    lines.append(rf"\begin{{tikzpicture}}[x={UNIT}bp,y=-{UNIT}bp,line cap=round,line join=round]")
    lines += [_mark(mark, figure.bar) for mark in figure.marks]
    for x in figure.letterings:
        if x.leader:
            lines.append(_mark(Mark("leader", x.leader), figure.bar))
        lines.append(_lettering(x))
    return "\n".join([*lines, r"\end{tikzpicture}"])


def _colour(name: str, value: str) -> str:
    return rf"\definecolor{{mechanism{name}}}{{HTML}}{{{value[1:].upper()}}}"


def _mark(mark: Mark, bar: float) -> str:
    stroke, fill, width, dashes = STYLES[mark.style]
    wide = {"bar": bar + 2.4, "core": bar - 0.6}.get(mark.style, width)
    options = [f"line width={wide * UNIT:.2f}bp"]
    if stroke != "none":
        options.append(f"draw=mechanism{stroke}")
    if fill != "none":
        options.append(f"fill=mechanism{fill}")
    if fill == "veil":
        options.append("fill opacity=0.55")
    if dashes:
        options.append(f"dash pattern={_dashes(dashes)}")
    return rf"\path[{','.join(options)}] {_way(mark)};"


def _dashes(dashes: str) -> str:
    lengths = [float(x) * UNIT for x in dashes.split()]
    words = ("on", "off")
    return " ".join(f"{words[k % 2]} {length:.2f}bp" for k, length in enumerate(lengths))


def _way(mark: Mark) -> str:
    if mark.radius:
        return f"{_at(mark.points[0])} circle[radius={mark.radius * UNIT:.2f}bp]"
    return " -- ".join(_at(point) for point in mark.points) + (" -- cycle" if mark.closed else "")


def _at(point: Point) -> str:
    return f"({point[0]:.1f},{point[1]:.1f})"


def _lettering(x: Lettering) -> str:
    middle = ((x.box.left + x.box.right) / 2, (x.box.top + x.box.bottom) / 2)
    latex = x.label.latex.replace(r"\_", r"\ ")
    colour = LETTERS[x.label.style]
    look = rf"inner sep=0pt,text=mechanism{colour},font=\footnotesize"
    return rf"\node[{look}] at {_at(middle)} {{${latex}$}};"
