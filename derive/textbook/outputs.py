"""The model's outputs."""

from __future__ import annotations

import casadi as ca

from derive.formulations.motion import per_second
from derive.model.rows import is_reaction
from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math


def outputs(doc: Manuscript) -> None:
    """Every output, or which multipliers it is."""
    if not doc.system.outputs:
        return
    doc.section("Outputs")
    if doc.notation.accelerations:
        _accelerations(doc)
    doc.say("The model's outputs are:")
    for output, (name, value, unit) in zip(doc.system.model.outputs, doc.system.outputs):
        if is_reaction(output.expression):
            reactions = _reactions_in(doc, value)
            doc.say(
                "{name}: the multipliers $!\\lambda$ of {rows}.",
                name=name,
                rows=", ".join(reactions),
            )
        else:
            _formula(doc, name, value, unit)


def _accelerations(doc: Manuscript) -> None:
    """What the rates of velocities in outputs are."""
    rates, latex = doc.notation.accelerations, doc.notation.latex
    doc.say(
        "Outputs use accelerations. In them {rates} stand for the rates $!!v$ of the generalized "
        "velocities, as the equations of motion give them.",
        rates=Math(", ".join(latex[x] for x in rates)),
    )
    for symbol, rate, velocity in zip(doc.v, rates, doc.system.model.velocities):
        if rate not in doc.rates:
            unit = per_second(velocity.unit)
            doc.mean(latex[rate], "rate of {of}", unit, of=Math(latex[symbol]))
    told = {symbol for formula in doc.printed for symbol in formula.left}
    rest = [j for j, rate in enumerate(rates) if rate not in told]
    value = doc.terms.vdot[rest]
    entries = doc.read(value) if rest else None
    if entries is not None:
        doc.say("Those that are not written out above are:")
        doc.lines("accelerations", [rates[j] for j in rest], entries, value)


def _reactions_in(doc: Manuscript, value: ca.SX) -> list[str]:
    """Names of the constraint rows whose reactions stand in it."""
    symbols = doc.system.symbols
    return [
        row.name for row in doc.system.rows if ca.depends_on(value, symbols.reactions([row.name]))
    ]


def _formula(doc: Manuscript, name: str, value: ca.SX, unit: str) -> None:
    labels = _labels(name, value.numel())
    symbols = [
        doc.notation.fresh(f"output {name}[{k}]", latex) for k, latex in enumerate(labels, 1)
    ]
    labels = [doc.notation.latex[symbol] for symbol in symbols]
    entries = doc.read(value)
    if entries is None:
        doc.too_long(labels[0])
    else:
        doc.lines(f"output {name}", symbols, entries, ca.densify(value))
    for latex in labels:
        doc.mean(latex, "output {name}", unit, name=name)
    for row in _reactions_in(doc, value):
        symbol = doc.notation.multiplier(row)
        doc.mean(doc.notation.latex[symbol], "multiplier of {row}", row=row)


def _labels(name: str, count: int) -> list[str]:
    """The output's name, with an index where it has several entries."""
    if count == 1:
        return [names.symbol(name)]
    return [f"{names.upright(name)}_{{{k}}}" for k in range(1, count + 1)]
