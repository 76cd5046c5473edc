"""The page of a linearisation: one file, MathML and SVG inside, no script, no network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.sensitivity import Mode, modes
from derive.linearize.study import Study
from derive.linearize.unreduced import constraint_counts, unreduced
from derive.textbook.mathml import mathml
from hamel.linear import plots
from hamel.linear.figure import moving
from hamel.linear.ranges import Range, own_ranges
from hamel.linear.sweep import Sweep, swept
from hamel.linear.words import course, shape
from hamel.records import Linearized

MAP = 25  # values of each name in a map that is made for the page
STRONGEST = 8  # parameters named for each mode


@dataclass(frozen=True)
class Section:
    title: str
    body: object


def page(study: Study, made: Sweep, ranges: Sequence[Range], record: Linearized) -> str:
    """HTML of the motion, the equations, eigenvalues over the range, stability over pairs of names,
    modes and sensitivities."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    found = modes(study)
    parts = [
        ("The steady motion", _motion(record)),
        ("The linear equations", _equations(study, record)),
        ("Zeros that are taken out", _zeros(study, record)),
        *_along(made, record),
        *_maps(study, made, ranges),
        ("Modes", _modes(study, found)),
        ("What the eigenvalues depend on", _sensitivities(found)),
    ]
    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        files("hamel.linear").joinpath("page.html.j2").read_text("utf-8")
    )
    sections = [Section(title, Markup(body)) for title, body in parts if body]
    title = f"{record.model}: linear equations and stability"
    return template.render(
        title=title, subtitle=f"along the steady motion “{record.motion}”", sections=sections
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Cells are HTML already."""
    top = "".join(f"<th>{escape(x)}</th>" for x in head)
    body = "\n".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _motion(record: Linearized) -> str:
    rows = [
        (escape(name), f"{value:.10g}")
        for name, value in record.steady.items()
        if abs(value) > 1e-12
    ]
    free = ", ".join(f"{escape(name)} = {value:.6g}" for name, value in record.values.items())
    rest = "<p>All other coordinates, quasi-velocities and inputs are zero.</p>"
    return (
        (_table(("constant", "value in SI units"), rows) if rows else "")
        + rest
        + f'<p class="soft">{free}</p>'
    )


def _number(x: float) -> str:
    text = f"{x:.5g}"
    if "e" not in text:
        return text
    digits, power = text.split("e")
    return rf"{digits} \cdot 10^{{{int(power)}}}"


def _matrix(entries: np.ndarray) -> str:
    rows = r" \\ ".join(" & ".join(_number(x) for x in row) for row in entries)
    return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"


def _column(names: Sequence[str]) -> str:
    rows = r" \\ ".join(rf"\delta \mathrm{{{name.replace('_', ' ')}}}" for name in names)
    return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"


def _equations(study: Study, record: Linearized) -> str:
    """Without the cyclic coordinates, where no entry refers to them."""
    kept = list(study.kept)
    A, B = (
        np.array(record.A)[np.ix_(kept, kept)],
        np.array(record.B).reshape(len(record.states), -1)[kept],
    )
    scale = np.max(np.abs(A), initial=0.0)
    A, B = (
        np.where(np.abs(A) < 1e-13 * scale, 0.0, A),
        np.where(np.abs(B) < 1e-13 * np.max(np.abs(B), initial=0.0), 0.0, B),
    )
    names = [record.states[k] for k in kept]
    right = rf"{_matrix(A)} {_column(names)}"
    if record.inputs:
        right += rf" + {_matrix(B)} {_column(record.inputs)}"
    text = rf"\frac{{d}}{{dt}} {_column(names)} = {right}"
    return f'<div class="equation">{mathml(text, True)}</div>'


def _zeros(study: Study, record: Linearized) -> str:
    system, motions = study.equations.system, study.motions({})
    holonomic, nonholonomic = constraint_counts(
        system, motions.x[0, : system.q.numel()], motions.p[0]
    )
    n = system.v.numel()
    text = (
        f"With n = {n} velocities, m<sub>h</sub> = {holonomic} holonomic and m<sub>n</sub> = "
        f"{nonholonomic} nonholonomic constraints there are {len(record.states)} minimal states: "
        f"{escape(', '.join(record.states))}. "
    )
    if record.cyclic:
        text += (
            f"Cyclic coordinates, on which nothing depends: {escape(', '.join(record.cyclic))}. "
        )
    if record.families:
        text += f"The motion is one of a family with {record.families} free value{'s' * (record.families > 1)}, a zero for each. "
    text += f"The {len(record.reduced)} eigenvalues below belong to {escape(', '.join(record.reduced))}."
    return f"<p>{text}</p><p>{_check(study, 2 * holonomic + nonholonomic)}</p>"


def _check(study: Study, spurious: int) -> str:
    cyclic = tuple(study.linear.independent[k] for k in study.cyclic)
    try:
        found = unreduced(study.linear, study.motions({}), cyclic)
    except AssumptionError as error:
        return f"There is no unreduced form to compare with ({escape(str(error).removeprefix('error: '))})."
    return (
        f"The multiplier equations in all {len(found.states)} coordinates and velocities, "
        f"differentiated on their own, agree on the constraints to {found.difference:.1e} of the "
        f"largest entry, and have 2 m<sub>h</sub> + m<sub>n</sub> = {spurious} spurious zeros "
        f"(found: {found.spurious}, in a nilpotent block to {found.nilpotent:.1e})."
    )


KINDS = {
    "zero": "a real eigenvalue passes zero",
    "hopf": "a pair passes the imaginary axis (Hopf)",
    "double": "two real eigenvalues meet and part as a pair",
}


def _along(made: Sweep, record: Linearized) -> list[tuple[str, str]]:
    if len(made.names) != 1:
        return []
    name = escape(made.names[0])
    rows = [
        (KINDS[c.kind], f"{c.value:.15g}", _complex(complex(*c.eigenvalue)))
        for c in record.critical
    ]
    table = (
        _table(("what happens", f"at {made.names[0]}", "eigenvalue (1/s)"), rows)
        if rows
        else "<p>No change in the range.</p>"
    )
    ranges = "; ".join(f"{a:.10g} to {b:.10g}" for a, b in record.stable)
    stable = (
        f"No mode grows for {name} from {ranges}."
        if ranges
        else f"At every value of {name} looked at some mode grows."
    )
    return [
        (f"Eigenvalues over {made.names[0]}", plots.over_range(made)),
        ("Critical values", f"{table}<p>{stable}</p>"),
        ("Root locus", plots.root_locus(made)),
    ]


def _maps(study: Study, made: Sweep, ranges: Sequence[Range]) -> list[tuple[str, str]]:
    """Over the two names that were swept, or over the swept one and each other range of the
    file."""
    if len(made.names) == 2:
        return [("Stability", plots.stability_map(made))]
    if len(ranges) != 1:
        return []
    first = _coarse(ranges[0])
    others = [_coarse(r) for r in own_ranges(study.problem.motion) if r.name != first.name]
    return [
        (f"Stability over {first.name} and {r.name}", plots.stability_map(swept(study, (r, first))))
        for r in others
    ]


def _coarse(r: Range) -> Range:
    return Range(r.name, np.linspace(r.values[0], r.values[-1], MAP))


def _complex(x: complex) -> str:
    return f"{x.real:.6g}" if x.imag == 0 else f"{x.real:.6g} ± {abs(x.imag):.6g} i"


def _modes(study: Study, found: Sequence[Mode]) -> str:
    figures = [
        f"<figure>{moving(study, mode)}<figcaption>{_caption(study, mode)}</figcaption></figure>"
        for mode in found
    ]
    return f'<div class="modes">{"".join(figures)}</div>' if figures else ""


def _caption(study: Study, mode: Mode) -> str:
    value = mode.eigenvalue
    return f"<strong>{_complex(value)}</strong>: {escape(course(value))}. {escape(shape(study, mode))}."


def _sensitivities(found: Sequence[Mode]) -> str:
    """dλ/dθ of the parameters that matter most, relative ones first."""
    names = list(dict.fromkeys(name for mode in found for name in _strongest(mode)))
    if not names:
        return ""
    rows = [
        (escape(name), *(_complex_or_none(mode.sensitivity.get(name)) for mode in found))
        for name in names
    ]
    return _table(("dλ/d", *(_complex(mode.eigenvalue) for mode in found)), rows)


def _complex_or_none(x: complex | None) -> str:
    if x is None:
        return "double"
    return (
        f"{x.real:.4g}"
        if abs(x.imag) < 1e-9 * (1e-300 + abs(x))
        else f"{x.real:.4g} {'+' if x.imag > 0 else '−'} {abs(x.imag):.4g} i"
    )


def _strongest(mode: Mode) -> list[str]:
    return sorted(mode.sensitivity, key=lambda name: -abs(mode.sensitivity[name]))[:STRONGEST]
