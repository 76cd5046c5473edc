"""Sentences that lead to a formula which is left out.

Of derive.textbook: prose.
"""

from __future__ import annotations

import pytest

from derive.textbook.prose import left_alone, runs
from derive.textbook.records import Math, Text


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ("The speeds are $w$, with:", "The speeds are $w$."),
        (
            "It gives $x$, a derivative along the motion:",
            "It gives $x$, a derivative along the motion.",
        ),
        ("The entries of $h$ are:", ""),
        ("The energy is:", ""),
        ("So far so good. The entries of $h$ are:", "So far so good. The entries of $h$ are:"),
        ("Nothing follows $x$", "Nothing follows $x$"),
        ("A full stop.", "A full stop."),
    ],
)
def test_a_sentence_ends_where_nothing_is_shown(said, left):
    assert left_alone(runs(said)) == runs(left)


def test_a_formula_at_the_end_stays():
    ends = (Text("Let "), Math("x:"))
    assert left_alone(ends) == ends
