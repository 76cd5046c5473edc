"""docs/operations.md says what is counted today, and it is less than what was published."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))

import operations  # noqa: E402

PAGE = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| ([^|]+) \| ([\d,]+ \+ [\d,]+ \+ \d+) \|$", PAGE, re.MULTILINE))
PUBLISHED = {
    "RX90, all ten numbers of every link": (253, 238),
    "RX90, symmetric links": (160, 113),
    "Stanford arm": (142, 99),
    "six revolute joints, all symbols": (540, 395),
}
QUICK = ("RX90, symmetric links", "rolling disk, inverse dynamics")


def numbers(title: str) -> tuple[int, ...]:
    return tuple(int(x.replace(",", "")) for x in ROWS[title].split(" + "))


def test_the_page_has_every_case() -> None:
    assert set(ROWS) == {case.title for case in operations.CASES}


def test_multiplications_and_additions_are_below_the_published() -> None:
    for title, most in PUBLISHED.items():
        found = numbers(title)[:2]
        assert all(own < other for own, other in zip(found, most)), title


def test_the_puma_is_exact_in_300_operations() -> None:
    assert sum(numbers("Puma 560")) <= 300


@pytest.mark.parametrize(
    "title", ["Whipple bicycle, solved", "Whipple bicycle, solved, all symbols"]
)
def test_the_bicycle_is_solved_in_1200_operations(title: str) -> None:
    assert sum(numbers(title)) <= 1200


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.title, marks=[] if case.title in QUICK else pytest.mark.slow)
        for case in operations.CASES
    ],
)
def test_what_the_page_says_is_counted(case: operations.Case) -> None:
    assert operations.counted(case) == numbers(case.title)
