"""First-order states and their rates."""

from __future__ import annotations

from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math, Runs, Text


def first_order_states(doc: Manuscript) -> None:
    """What the states are, and ż as the file gives it."""
    states = doc.system.model.states
    if not states:
        return
    doc.section("First-order states")
    doc.say(
        "Besides positions and velocities the motion has states $!z$ with first-order equations of "
        "their own; $!x=(!q, !w, !z)$:"
    )
    rows: list[tuple[Runs, ...]] = []
    for symbol, state in zip(doc.z, states):
        latex = doc.notation.latex[symbol]
        doc.mean(latex, "{about}", state.unit, about=state.about or f"state {state.name}")
        start = doc.formula(state.initial, f"initial {state.name}")
        rows.append(
            ((Math(latex),), (start,), (Text(names.unit(state.unit)),), (Text(state.about),))
        )
    doc.table(("symbol", "value at t = 0", "unit", "meaning"), rows)
    doc.say("Their rates are:")
    for k, (symbol, state) in enumerate(zip(doc.z, states)):
        rate, value = doc.notation.rate(symbol), doc.system.zdot[k]
        entries = doc.read(value)
        if entries is None:
            doc.too_long(doc.notation.latex[rate])
        else:
            doc.lines(f"rate of {state.name}", [rate], entries, value)
    doc.say(
        "Loads use the states as they use inputs; how fast the states change stands in no "
        "acceleration."
    )
