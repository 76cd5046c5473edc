"""Events of the model: what changes its sign, which way, and whether the motion ends there."""

from __future__ import annotations

import casadi as ca

from derive.model.records import Event
from derive.textbook.given.sentences import UNREADABLE
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Run, Runs, Text

WAYS = {1: "rises through zero", -1: "falls through zero", 0: "changes its sign"}


def events(doc: Manuscript) -> None:
    """A table, where there is any."""
    found = doc.system.model.events
    if not found:
        return
    doc.say("Events of a motion are where a formula passes zero:")
    values = dict(doc.system.events)
    doc.listing(("event", "formula", "when", "then"), found, lambda x: _row(doc, x, values[x.name]))


def _row(doc: Manuscript, x: Event, value: ca.SX) -> tuple[Runs, ...]:
    then = "the motion ends" if x.stop else "the motion goes on"
    return (
        (Text(words(x.name)),),
        (_formula(doc, x, value),),
        (Text(WAYS[x.direction]),),
        (Text(then),),
    )


def _formula(doc: Manuscript, x: Event, value: ca.SX) -> Run:
    """What it is of the state; as the file says it where that is too long to be read."""
    shown = doc.term(value, f"event {x.name}")
    return Text(x.text) if shown == UNREADABLE else shown
