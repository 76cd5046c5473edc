"""Reading a file takes instructions in proportion to what stands in it.

Of derive.model: letters.
"""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

import pytest

from derive.model import letters, load_text
from tests.trees import equal_links

MOST = 2.1  # times as many for twice the links


class Instructions:
    """Counts the instructions of Python that run within it."""

    def __init__(self) -> None:
        self.count = 0

    def _traced(self, frame: FrameType, event: str, argument: Any) -> Any:
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        self.count += event == "opcode"
        return self._traced

    def __enter__(self) -> Instructions:
        self._before = sys.gettrace()
        sys.settrace(self._traced)
        return self

    def __exit__(self, *error: object) -> None:
        sys.settrace(self._before)


def test_symbols_of_joints_take_instructions_in_proportion(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Twice the links, twice the instructions: each joint once looked through all coordinates."""
    plain, counts = letters.letters, []

    def counted(*given: Any) -> Any:
        with Instructions() as taken:
            result = plain(*given)
        counts.append(taken.count)
        return result

    monkeypatch.setattr(letters, "letters", counted)
    for links in (40, 80):
        load_text(equal_links(links), "links.yaml")
    few, many = counts
    assert few < many <= MOST * few
