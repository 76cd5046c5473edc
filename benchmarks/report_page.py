"""The figures of docs/report.md from what `make report` and `make whole` found, so that none is
written by hand.

    python benchmarks/report_page.py

From build/report/report.json come the three plots and the table of extreme cases, from
build/whole.json the table of whole simulations, from build/whole_curves.json the plot of
docs/methods.md of many motions. What was not run keeps what is there.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hamel.draw import Series, chart, side_by_side
from hamel.records import ExtremeRow
from hamel.study.plots import error_charts, extremes_chart

REPORT, WHOLE, DOCS = Path("build/report/report.json"), Path("build/whole.json"), Path("docs")
CURVES = Path("build/whole_curves.json")
END = "<!-- so far -->"
PLOTS = {
    "four_bar": ("report-four-bar.svg", 0),
    "snake3": ("report-snake3.svg", 1),
}  # which of its charts
SHOWN = (
    "plain C DOP853 loop, CasADi augmented",
    "CasADi's exported RK4 loop",
    "best library",
    "Exudyn",
)
# What has to be there, and the cases that are it: a file, or one of its cases.
EXTREMES: Mapping[str, Sequence[str]] = {
    "stiff springs to 1e12 N/m": ("stiff_spring",),
    "bushings as closures": ("bushed_parallelogram", "soft_pin: stiff"),
    "stiff dampers": ("stiff_damper",),
    "mass ratios 1e-9 to 1e9": ("mass_ratio",),
    "needle and disk inertias": ("tumbling: needle", "tumbling: disk", "tumbling: tiny"),
    "micrometre and megametre": ("scale_micrometre", "scale_megametre"),
    "1e5 rad/s": ("tumbling: fast",),
    "gimbal lock": ("gimbal",),
    "heavy top, fast and slow": ("heavy_top",),
    "change point": ("change_point",),
    "parallelograms through their singular positions": (
        "four_bar_chain: one_turn_and_more",
        "four_bar_chain: ten_seconds",
    ),
    "slider-crank with crank = rod": ("isosceles_slider",),
    "nearly redundant constraints": ("third_crank: nearly",),
    "redundant constraints": ("redundant", "bricard", "third_crank: exactly"),
    "nearly parallel rows": ("near_parallel",),
    "joint rates zero at the start": ("straight_snake", "heavy_top: at_rest"),
    "inconsistent initial state": ("scale_metre: inconsistent",),
    "long runs": ("long_run: minutes", "long_run: day"),
    "t = 1e9 s": ("slow_drive: ten_turns", "stiff_damper: heavily_damped"),
    "NaN, ±Inf, denormals, 1e300 in every argument": (
        "*: spoiled_arguments",
        "*: spoiled_arguments_single",
    ),
    "float32": (
        "scale_metre: single",
        "tumbling: single",
        "mass_ratio: heavy_tip_single",
        "near_parallel: one_line_single",
    ),
    "chaos (error reported only)": ("chaos",),
}
Row = Mapping[str, Any]


def extremes(rows: Sequence[Row]) -> str:
    """Markdown: what was asked for, its cases, how they came out."""
    cells = (
        (about, " ".join(f"`{name}`" for name in names), _outcome(chosen(rows, names)))
        for about, names in EXTREMES.items()
    )
    return _table(("extreme", "file: case", "outcome"), "--", cells)


def chosen(rows: Sequence[Row], names: Sequence[str]) -> list[Row]:
    return [row for name in names for row in rows if _is(row, *name.partition(": ")[::2])]


def _is(row: Row, model: str, case: str) -> bool:
    return model in ("*", row["model"]) and case in ("", row["case"])


def _outcome(rows: Sequence[Row]) -> str:
    """The largest error, the steps of stiff cases, and why what was refused was."""
    errors = [row["error"] for row in rows if row["error"] is not None]
    parts = [f"largest error {max(errors):.1e}"] if errors else []
    spoiled = [re.match(r"(\d+) calls.* (\d+) wrong", row["status"]) for row in rows]
    counts = [tuple(map(int, found.groups())) for found in spoiled if found]
    parts += (
        [f"{sum(calls for calls, _ in counts):,} calls, {sum(wrong for _, wrong in counts)} wrong"]
        if counts
        else []
    )
    parts += [
        f"{row['fewest']} steps, SciPy's Radau {row['scipy']}"
        for row in rows
        if row["fewest"] and row["scipy"]
    ]
    parts += [f"moved by {row['moved']:.1g}" for row in rows if row["moved"] > 0]
    parts += [
        f"{row['case']} refused: {_cause(row['status'])}"
        for row in rows
        if row["outcome"] == "refused"
    ]
    parts += [
        f"**{row['model']}, {row['case']}: {row['outcome']}, not {row['expected']}**"
        for row in rows
        if not row["passed"]
    ]
    return "; ".join(parts) or "not run"


def _cause(status: str) -> str:
    """Without the name of the model, and with the time in as many digits as one reads."""
    return re.sub(
        r"\S+\.simulate stopped at t = (\S+):", lambda found: f"at {float(found[1]):.4g} s", status
    )


def simulations(rows: Sequence[Row]) -> str:
    """Markdown: whole simulations beside other programs."""
    shown = [row for row in rows if row["peer"] in SHOWN]
    own = "; ".join(f"{row['model']}: {row['ours']}" for row in rows if row["peer"] == SHOWN[0])
    head = ("model", "peer", "ours, ms", "peer, ms", "ratio", "at most", "")
    return _table(head, "--rrrr-", map(_simulation, shown)) + f"\n\nOurs: {own}."


def _simulation(row: Row) -> tuple[str, ...]:
    met = {True: "met", False: "**missed**", None: ""}[row["met"]]
    peer = f"{row['peer']} ({row['variant']})"
    return (
        row["model"],
        peer,
        *(_number(row[name]) for name in ("ours_ms", "peer_ms", "ratio", "target")),
        met,
    )


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}" if value < 10 else f"{value:.0f}"


def _table(head: Sequence[str], sides: str, rows: Any) -> str:
    bars = "|".join("---:" if side == "r" else "---" for side in sides.ljust(len(head), "-"))
    return "\n".join(
        (
            "| " + " | ".join(head) + " |",
            f"|{bars}|",
            *("| " + " | ".join(row) + " |" for row in rows),
        )
    )


def put(page: str, name: str, text: str) -> str:
    """The page with the text between the two marks."""
    begin = f"<!-- {name}: benchmarks/report_page.py -->"
    before, _, rest = page.partition(begin)
    return f"{before}{begin}\n\n{text}\n\n{END}{rest.partition(END)[2]}"


def found() -> Iterator[tuple[str, str]]:
    """Names of marks, and what belongs there."""
    if REPORT.exists():
        yield "extreme cases", extremes(json.loads(REPORT.read_text("utf-8"))["extremes"])
    if WHOLE.exists():
        yield "whole simulations", simulations(json.loads(WHOLE.read_text("utf-8")))


def many_motions(found: Mapping[str, Mapping[str, Sequence[Sequence[float]]]]) -> str:
    """Error at the end over time a motion takes, of every contender, a chart for each model."""
    return side_by_side(
        [
            chart(
                f"{model}: error at the end",
                "µs a motion",
                "error",
                [
                    Series(_contender(name), [(t, e) for t, e in curve])
                    for name, curve in of.items()
                ],
            )
            for model, of in found.items()
        ]
    )


def _contender(name: str) -> str:
    """Ours by the integrator alone, but where nothing is enforced though it could be."""
    integrator, _, enforcement = name.partition(", ")
    ours = enforcement in ("None", "none", "projection")
    return f"hamel {integrator}, {enforcement}".removesuffix(", None") if ours else name


def plots() -> Iterator[tuple[str, str]]:
    if CURVES.exists():
        yield "many-motions.svg", many_motions(json.loads(CURVES.read_text("utf-8")))
    if not REPORT.exists():
        return
    found = json.loads(REPORT.read_text("utf-8"))
    for model, (name, which) in PLOTS.items():
        own = [row for row in found["rows"] if row["model"] == model]
        if own:
            yield name, error_charts(model, own)[which]
    if found["extremes"]:
        yield (
            "report-extremes.svg",
            extremes_chart([ExtremeRow(**row) for row in found["extremes"]]),
        )


def main() -> int:
    page = DOCS / "report.md"
    text = page.read_text("utf-8")
    for name, made in found():
        text = put(text, name, made)
    page.write_text(text, "utf-8")
    for name, drawn in plots():
        (DOCS / name).write_text(drawn, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
