"""The table and the plots of build/bench.json, and the page of the documentation with them.

    python benchmarks/page.py

copies build/bench.json to docs/bench.json and writes the table of docs/bench.md and the plots
beside it from that, so that no number is written by hand.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from targets import BEST, CHAINS

from hamel.draw import Curve, Panel, draw
from hamel.draw.canvas import COLOURS, document, element, text

SOURCE, DOCS = Path("build/bench.json"), Path("docs")
BEGIN, END = "<!-- the rest of this section: benchmarks/page.py -->", "<!-- so far -->"
HEAD = f"{'function':24}{'model':13}{'peer':27}{'ours, ns':>10}{'peer, ns':>10}{'ratio':>10}{'at most':>10}"
TITLES = ("function", "model", "against", "ours, ns", "theirs, ns", "ratio", "at most", "")
Row = dict[str, Any]


def line(row: Row) -> str:
    """One row for the terminal."""
    numbers = f"{_right(row['ours_ns'])}{_right(row['peer_ns'])}{_right(row['ratio'], 3)}{_right(row['target'], 3)}"
    met = {True: "met", False: "MISSED", None: ""}[row["met"]]
    return f"{row['function']:24}{row['model']:13}{row['peer']:27}{numbers}  {met:7}{row['note'] or row['variant']}"


def _right(value: float | None, digits: int = 1) -> str:
    return f"{'–':>10}" if value is None else f"{value:10.{digits}f}"


def section(rows: Sequence[Row]) -> str:
    """Markdown: when and where, the table, the plots."""
    days = sorted({row["measured"].replace("T", " ")[:16] for row in rows})
    loads = sorted(row["load"] for row in rows)
    machines = "; ".join(sorted({row["machine"] for row in rows}))
    met, missed = (sum(row["met"] is verdict for row in rows) for verdict in (True, False))
    said = (
        f"{machines}. From {days[0]} to {days[-1]} (UTC), load average {loads[0]} to {loads[-1]}."
    )
    said += f" {met} targets are met, {missed} missed."
    table = [
        "| " + " | ".join(TITLES) + " |",
        "|---|---|---|---:|---:|---:|---:|---|",
        *map(_cells, rows),
    ]
    return "\n".join(
        [said, "", *table, "", *(f"![{title}]({name})" for name, title in PLOTS.items())]
    )


def _cells(row: Row) -> str:
    what = row["variant"] or row["note"]
    met = {True: "met", False: "**missed**", None: ""}[row["met"]]
    numbers = (
        _number(row["ours_ns"]),
        _number(row["peer_ns"]),
        _number(row["ratio"], 3),
        _number(row["target"], 3),
    )
    peer = f"{row['peer']} ({what})" if what else row["peer"]
    return "| " + " | ".join((row["function"], row["model"], peer, *numbers, met)) + " |"


def _number(value: float | None, digits: int = 1) -> str:
    return "–" if value is None else f"{value:,.0f}" if value >= 1000 else f"{value:.{digits}f}"


PLOTS = {
    "bench_targets.svg": "Ratio over what is allowed, for every target",
    "bench_chains.svg": "Time of forward dynamics of planar pendulum chains over the number of links",
}


def drawn(rows: Sequence[Row], folder: Path) -> None:
    """The plots; that of the chains where all of them are there."""
    (folder / "bench_targets.svg").write_text(targets(rows), "utf-8")
    if all(any(row["model"] == f"chain{n}" and row["ours_ns"] for row in rows) for n in CHAINS):
        (folder / "bench_chains.svg").write_text(chains(rows), "utf-8")


def chains(rows: Sequence[Row]) -> str:
    """Time over the number of links, ours and the peers that have them all."""
    of = {n: [row for row in rows if row["model"] == f"chain{n}"] for n in CHAINS}
    curves = [Curve("hamel", [of[n][0]["ours_ns"] for n in CHAINS])]
    for peer in [row["peer"] for row in of[CHAINS[0]] if row["peer"] != BEST]:
        times = [
            next((row["peer_ns"] for row in of[n] if row["peer"] == peer), None) for n in CHAINS
        ]
        if all(times):
            curves.append(Curve(peer, [time for time in times if time]))
    return draw(
        "Planar pendulum chains",
        "links",
        CHAINS,
        [Panel("forward dynamics, ns", tuple(curves), log=True)],
    )


def targets(rows: Sequence[Row]) -> str:
    """A bar for each target: our time over the allowed one; what reaches beyond the line is
    missed."""
    found = [row for row in rows if row["target"] and row["ratio"]]
    most = max([1.0, *(row["ratio"] / row["target"] for row in found)])
    left, width, step, top = 330, 300, 17, 34
    height = top + step * len(found) + 30
    parts = [text(10, 18, "Our time over the allowed one", "title")]
    for i, row in enumerate(found):
        share, y = row["ratio"] / row["target"], top + step * i
        colour = COLOURS[0] if row["met"] else COLOURS[1]
        parts.append(
            text(
                left - 6, y + 11, f"{row['function']}, {row['model']}: {row['peer']}", anchor="end"
            )
        )
        size = {"width": share / most * width, "height": step - 5}
        parts.append(element("rect", x=left, y=y, **size, fill=colour))
        parts.append(text(left + share / most * width + 4, y + 11, f"{share:.2f}"))
    one = left + width / most
    parts.append(element("line", class_="frame", x1=one, x2=one, y1=top - 4, y2=height - 24))
    parts.append(text(one, height - 8, "allowed", anchor="middle"))
    return document(680, height, parts)


def page(before: str, rows: Sequence[Row]) -> str:
    """The page with the section of these rows in place of the one it had."""
    start, end = before.index(BEGIN) + len(BEGIN), before.index(END)
    return f"{before[:start]}\n\n{section(rows)}\n\n{before[end:]}"


def main() -> None:
    if not SOURCE.exists():
        sys.exit(f"page: {SOURCE} is missing: run make bench first")
    rows = json.loads(SOURCE.read_text("utf-8"))
    (DOCS / "bench.json").write_text(SOURCE.read_text("utf-8"), "utf-8")
    place = DOCS / "bench.md"
    place.write_text(page(place.read_text("utf-8"), rows), "utf-8")
    drawn(rows, DOCS)
    print(
        f"{len(rows)} rows in {place}, {DOCS}/bench.json, "
        + ", ".join(f"{DOCS}/{name}" for name in PLOTS)
    )


if __name__ == "__main__":
    main()
