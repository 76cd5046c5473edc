"""The page of a linearisation: one file, MathML and SVG inside, no script, no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from markupsafe import Markup

import hamel
from derive.diagnostics import AssumptionError
from derive.linearize.sensitivity import Mode, modes
from derive.linearize.study import Study
from derive.linearize.unreduced import constraint_counts, unreduced
from derive.textbook import names as names_of
from derive.textbook.formulas.labels import labels
from derive.textbook.formulas.measure import letters
from derive.textbook.writing.mathml import mathml
from derive.textbook.writing.pages import rendered
from hamel.draw.mechanism import picture, svg
from hamel.linear import plots
from hamel.linear.figure import moving
from hamel.linear.limits import (
    GAP,
    GROWING,
    MAP,
    NARROW_TABLE,
    NOTHING,
    REAL,
    ROUNDOFF,
    STRONGEST,
)
from hamel.linear.ranges import Range, own_ranges
from hamel.linear.sweep import Sweep, swept
from hamel.linear.words import branches, course, shape, without
from hamel.records import Linearized


@dataclass(frozen=True)
class Section:
    title: str
    body: Markup


def page(study: Study, sweep: Sweep, ranges: Sequence[Range], record: Linearized) -> str:
    """HTML of the motion, the equations, eigenvalues over the range, stability over pairs of names,
    modes and sensitivities."""
    shapes, drawing = modes(study), picture(study.equations.system)
    parts = [
        ("In one line", f"<p>{_verdict(study, record, shapes)}</p>"),
        ("The steady motion", _motion(study, record)),
        ("The linear equations", _equations(study, record)),
        ("Zeros that are taken out", _zeros(study, record)),
        *_along(sweep, record),
        *_maps(study, sweep, ranges),
        ("Modes", _modes(study, shapes)),
        ("What the eigenvalues depend on", _sensitivities(shapes)),
    ]
    return rendered(
        "hamel.linear/page.html.j2",
        title=f"{record.model}: linear equations and stability",
        subtitle=f"along the steady motion “{record.motion}”",
        version=hamel.__version__,
        figure=Markup(svg(drawing) if drawing else ""),
        sections=[Section(title, Markup(body)) for title, body in parts if body],
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Cells are HTML already. A wide one shows every row as lines below each other on a phone."""
    titles = [escape(x) for x in head]
    top = "".join(f"<th>{title}</th>" for title in titles)
    body = "\n".join(_row(titles, row) for row in rows)
    columns = zip(titles, *rows)
    width = sum(GAP + max(map(len, cells)) for cells in columns)
    how = ' class="stacked"' if width > NARROW_TABLE else ""
    table = f"<table{how}><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="scroll">{table}</div>'


def _row(titles: Sequence[str], cells: Sequence[str]) -> str:
    labelled = zip(titles, cells)
    return "<tr>" + "".join(f'<td data-label="{x}">{cell}</td>' for x, cell in labelled) + "</tr>"


def _verdict(study: Study, record: Linearized, shapes: Sequence[Mode]) -> str:
    """Whether anything grows, and where that changes; parameters stand in the next section."""
    growing = [mode.eigenvalue for mode in shapes if mode.eigenvalue.real > GROWING]
    free = [name for name in record.values if name in study.problem.motion.sweepable]
    here = ", ".join(f"{escape(name)} = {record.values[name]:.4g}" for name in free)
    place = f" at {here}" if here else ""
    if growing:
        fastest = max(growing, key=lambda x: x.real)
        text = f"Unstable{place}: a mode grows by e every {1 / fastest.real:.3g} s."
    else:
        text = f"No mode grows{place}."
    ranges = "; ".join(f"{a:.4g} to {b:.4g}" for a, b in record.stable)
    return f"{text} In the range looked at no mode grows from {ranges}." if ranges else text


def _motion(study: Study, record: Linearized) -> str:
    """What is constant along it, with units."""
    units = _units(study)
    rows = [
        (escape(name), f"{value:.10g} {units.get(name, '')}".strip())
        for name, value in record.steady.items()
        if abs(value) > NOTHING
    ]
    free = ", ".join(f"{escape(name)} = {value:.6g}" for name, value in record.values.items())
    table = _table(("constant", "value"), rows) if rows else ""
    rest = "<p>All other coordinates, quasi-velocities and inputs are zero.</p>"
    return f'{table}{rest}<p class="soft">{free}</p>'


def _units(study: Study) -> dict[str, str]:
    """Of coordinates, velocities and quasi-velocities, by name."""
    model, state = study.equations.system.model, study.equations.argument("x")
    units = dict(zip(state.labels, state.units))
    units |= {x.name: x.unit for x in (*model.coordinates, *model.velocities, *model.inputs)}
    units |= {f"der({x.name})": f"{x.unit}/s" for x in model.coordinates}
    return {name: "" if unit in ("", "1") else names_of.unit(unit) for name, unit in units.items()}


def _number(x: float) -> str:
    text = f"{x:.5g}"
    if "e" not in text:
        return text
    digits, power = text.split("e")
    return rf"{digits} \cdot 10^{{{int(power)}}}"


def _matrix(entries: np.ndarray) -> str:
    rows = r" \\ ".join(" & ".join(_number(x) for x in row) for row in entries)
    return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"


def _column(names: Sequence[str], given: Mapping[str, str]) -> str:
    rows = r" \\ ".join(rf"\delta {_symbol(name, given)}" for name in names)
    return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"


def _symbol(name: str, given: Mapping[str, str]) -> str:
    """A state or input as the derivation calls it."""
    owner, _, slot = name.rpartition(".")
    return names_of.velocity(name, "") if owner and slot else names_of.symbol(name, given)


def _equations(study: Study, record: Linearized) -> str:
    """Without the cyclic coordinates, where no entry refers to them."""
    places = list(study.kept)
    n = len(record.states)
    A = np.array(record.A).reshape(n, n)[np.ix_(places, places)]
    B = np.array(record.B).reshape(n, len(record.inputs))[places]
    given = labels(study.equations.system.model)
    states = _column([record.states[k] for k in places], given)
    pieces = [
        rf"\frac{{\mathrm{{d}}}}{{\mathrm{{d}}t}} {states} =",
        f"{_matrix(_without_roundoff(A))} {states}",
    ]
    if record.inputs:
        pieces.append(f"{{}} + {_matrix(_without_roundoff(B))} {_column(record.inputs, given)}")
    return f'<div class="equation">{" ".join(map(_fitted, pieces))}</div>'


def _fitted(latex: str) -> str:
    """One part of an equation, which gets smaller where the screen is narrower; a line may end
    after it."""
    return mathml(latex, True).replace("<math", f'<math style="--w:{letters(latex):.0f}"', 1)


def _without_roundoff(matrix: np.ndarray) -> np.ndarray:
    least = ROUNDOFF * np.max(np.abs(matrix), initial=0.0)
    return np.where(np.abs(matrix) < least, 0.0, matrix)


def _zeros(study: Study, record: Linearized) -> str:
    """How many states are minimal, which are cyclic, and how many zeros other forms have."""
    system, motions = study.equations.system, study.motions({})
    q = motions.x[0, : system.q.numel()]
    holonomic, nonholonomic = constraint_counts(system, q, motions.p[0])
    text = (
        f"With n = {system.v.numel()} velocities, m<sub>h</sub> = {holonomic} holonomic and "
        f"m<sub>n</sub> = {nonholonomic} nonholonomic constraints there are {len(record.states)} "
        f"minimal states: {_listed(record.states)}. "
    )
    if record.cyclic:
        text += f"Cyclic coordinates, on which nothing depends: {_listed(record.cyclic)}. "
    if record.families:
        values = "1 free value" if record.families == 1 else f"{record.families} free values"
        text += f"The motion is one of a family with {values}, a zero for each. "
    count = len(record.reduced)
    text += f"The {count} eigenvalues below belong to {_listed(record.reduced)}."
    return f"<p>{text}</p><p>{_unreduced(study, 2 * holonomic + nonholonomic)}</p>"


def _listed(names: Sequence[str]) -> str:
    return escape(", ".join(names))


def _unreduced(study: Study, spurious: int) -> str:
    """Agreement with the multiplier equations, and the zeros that those have too many."""
    cyclic = tuple(study.linear.independent[k] for k in study.cyclic)
    try:
        form = unreduced(study.linear, study.motions({}), cyclic)
    except AssumptionError as error:
        reason = escape(str(error).removeprefix("error: "))
        return f"There is no unreduced form to compare with ({reason})."
    return (
        f"The multiplier equations in all {len(form.states)} coordinates and velocities, "
        "differentiated on their own, agree on the constraints to "
        f"{form.difference:.1e} of the largest entry, and have 2 m<sub>h</sub> + m<sub>n</sub> = "
        f"{spurious} spurious zeros (found: {form.spurious}, in a nilpotent block to "
        f"{form.nilpotent:.1e})."
    )


KINDS = {
    "zero": "a real eigenvalue passes zero",
    "hopf": "a pair passes the imaginary axis (Hopf)",
    "double": "two real eigenvalues meet and part as a pair",
    "fold": "the branch of steady motions turns back (a fold)",
}


def _along(sweep: Sweep, record: Linearized) -> list[tuple[str, str]]:
    """Over the one name that was swept."""
    if len(sweep.names) != 1:
        return []
    return [
        (f"Eigenvalues over {sweep.names[0]}", plots.over_range(sweep)),
        ("Critical values", _critical(sweep.names[0], record)),
        ("Root locus", plots.root_locus(sweep)),
    ]


def _critical(name: str, record: Linearized) -> str:
    """Where something happens, and where no mode grows."""
    rows = [
        (KINDS[c.kind], f"{c.value:.11g}", _complex(complex(*c.eigenvalue)))
        for c in record.critical
    ]
    head = ("what happens", f"at {name}", "eigenvalue (1/s)")
    table = _table(head, rows) if rows else "<p>No change in the range.</p>"
    for said in filter(None, (branches(record), without(record))):
        table += f"<p>{escape(said[0].upper() + said[1:])}.</p>"
    ranges = "; ".join(f"{a:.10g} to {b:.10g}" for a, b in record.stable)
    if ranges:
        rest = "; ".join(f"{a:.10g} to {b:.10g}" for a, b in record.unstable)
        grows = f" Some mode grows from {rest}." if rest else ""
        return f"{table}<p>No mode grows for {escape(name)} from {ranges}.{grows}</p>"
    return f"{table}<p>At every value of {escape(name)} looked at some mode grows.</p>"


def _maps(study: Study, sweep: Sweep, ranges: Sequence[Range]) -> list[tuple[str, str]]:
    """Over the two names that were swept, or over the swept one and each other range of the
    file."""
    if len(sweep.names) == 2:
        return [("Stability", plots.stability_map(sweep))]
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
    if abs(x) < NOTHING:
        return "0"
    real = 0.0 if abs(x.real) < ROUNDOFF * abs(x) else x.real
    return f"{real:.6g}" if x.imag == 0 else f"{real:.6g} ± {abs(x.imag):.6g} i"


def _modes(study: Study, shapes: Sequence[Mode]) -> str:
    figures = [
        f"<figure>{moving(study, mode)}<figcaption>{_caption(study, mode)}</figcaption></figure>"
        for mode in shapes
    ]
    return f'<div class="modes">{"".join(figures)}</div>' if figures else ""


def _caption(study: Study, mode: Mode) -> str:
    value, words = mode.eigenvalue, escape(shape(study, mode))
    return f"<strong>{_complex(value)}</strong>: {escape(course(value))}. {words}."


def _sensitivities(shapes: Sequence[Mode]) -> str:
    """dλ/dθ of the parameters that matter most, relative ones first."""
    names = list(dict.fromkeys(name for mode in shapes for name in _strongest(mode)))
    if not names:
        return ""
    rows = [
        (escape(name), *(_slope(mode.sensitivity.get(name)) for mode in shapes)) for name in names
    ]
    return _table(("dλ/d", *(_complex(mode.eigenvalue) for mode in shapes)), rows)


def _slope(x: complex | None) -> str:
    """A double eigenvalue has none."""
    if x is None:
        return "double"
    if abs(x) < NOTHING:
        return "0"
    if abs(x.imag) < REAL * abs(x):
        return f"{x.real:.4g}"
    real = 0.0 if abs(x.real) < ROUNDOFF * abs(x) else x.real
    return f"{real:.4g} {'+' if x.imag > 0 else '−'} {abs(x.imag):.4g} i"


def _strongest(mode: Mode) -> list[str]:
    return sorted(mode.sensitivity, key=lambda name: -abs(mode.sensitivity[name]))[:STRONGEST]
