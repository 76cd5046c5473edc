"""All pages of all models, written, opened in Chromium and measured: build/pages.json with a row
{"page", "width", "clipped", "overlaps"} for every page and width.

Clipped is what lies beyond the page, beyond its equation, or in a box that has to be scrolled;
overlaps are labels of figures that cover each other, and formulas that cover a number of an
equation. Everything that is folded is unfolded, and the numbers are shown.

Run by `make pages`; `python benchmarks/pages.py four_bar bicycle` does some models.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from pathlib import Path
from typing import Any

import hamel
from derive.diagnostics import HamelError
from derive.model import load

HOME = Path(__file__).parent.parent
PAGES = HOME / "build" / "pages"
WIDTHS = (1400, 390)
AT_ONCE = 12  # pages that one Chromium opens
PATIENCE = 600  # seconds for these
PATTERN = re.compile(r'<pre id="rows">(.*?)</pre>', re.DOTALL)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

MEASURE = r"""
const beyond = (r, left, right) => r.width > 0 && (r.right > right + 1.5 || r.left < left - 1.5);
function clipped(doc, width) {
  const found = new Set();
  for (const x of doc.querySelectorAll('math, svg, table, p, li, h1, h2, h3, pre, input, button, canvas')) {
    const r = x.getBoundingClientRect();
    const box = x.closest('.equation');
    const right = box ? Math.min(width, box.getBoundingClientRect().right) : width;
    if (x.closest('svg') && x.tagName !== 'svg') continue;
    if (beyond(r, 0, right)) found.add(x);
  }
  for (const x of doc.querySelectorAll('body *')) {
    const how = doc.defaultView.getComputedStyle(x).overflowX;
    if (how !== 'visible' && x.scrollWidth > x.clientWidth + 1 && !x.closest('svg')) found.add(x);
  }
  return [...found].map(words);
}
const words = x => `${x.tagName} ${x.textContent.trim().replace(/\s+/g, ' ').slice(0, 60)}`;
const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
  Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
function overlaps(doc) {
  const found = [];
  for (const svg of doc.querySelectorAll('svg')) {
    const boxes = [...svg.querySelectorAll('text')].map(x => x.getBoundingClientRect()).filter(r => r.width > 0);
    boxes.forEach((a, i) => boxes.slice(i + 1).forEach(b => { if (meet(a, b)) found.push(words(svg)); }));
  }
  for (const number of doc.querySelectorAll('.equation > .number')) {
    const box = number.getBoundingClientRect();
    for (const x of number.parentElement.querySelectorAll('math'))
      if (box.width > 0 && meet(box, x.getBoundingClientRect())) found.push(words(x));
  }
  return found;
}
async function measured(page, width) {
  const frame = document.createElement('iframe');
  frame.style.cssText = `border:0;width:${width}px;height:3000px`;
  frame.src = page;
  document.body.append(frame);
  await new Promise(done => { frame.onload = done; });
  const doc = frame.contentDocument;
  doc.querySelectorAll('details').forEach(x => { x.open = true; });
  const rows = [[clipped(doc, width), overlaps(doc)]];
  const worked = doc.getElementById('worked');
  if (worked) { worked.checked = true; rows.push([clipped(doc, width), overlaps(doc)]); }
  frame.remove();
  const most = k => rows.map(x => x[k]).reduce((a, b) => b.length > a.length ? b : a);
  return {page, width, clipped: most(0).length, overlaps: most(1).length, where: [...most(0), ...most(1)].slice(0, 4)};
}
(async () => {
  const rows = [];
  for (const page of PAGES) for (const width of WIDTHS) rows.push(await measured(page, width));
  document.getElementById('rows').textContent = JSON.stringify(rows);
})();
"""


def main(names: Sequence[str]) -> int:
    """Writes and measures the pages of these models, of all where none is named."""
    browser = browser_of()
    if browser is None:
        print(f"none of {', '.join(BROWSERS)} is installed; pages are measured in one of them")
        return 3
    paths = [x for x in models() if not names or x.stem in names]
    rows = [row for path in paths for row in _of_model(browser, path)]
    wrong = sum(1 for row in rows if row["clipped"] or row["overlaps"])
    print(f"{len(rows) // len(WIDTHS)} pages at {len(WIDTHS)} widths, {wrong} with something wrong")
    return 1 if wrong else 0


def models() -> list[Path]:
    """Those of the repository and of its gallery."""
    folder = HOME / "models"
    return [*sorted(folder.glob("*.yaml")), *sorted((folder / "gallery").glob("*.yaml"))]


def browser_of() -> str | None:
    """The Chromium that is installed."""
    return next((path for path in map(shutil.which, BROWSERS) if path), None)


def _of_model(browser: str, path: Path) -> list[dict[str, Any]]:
    """The rows of a model's pages, which take the place of those in pages.json; what is wrong is
    told."""
    pages = list(written(path))
    rows = [row for part in _parts(pages) for row in measured(browser, part)]
    places = [row.pop("where") for row in rows]
    _store(path.stem, rows)
    for row, where in zip(rows, places):
        if row["clipped"] or row["overlaps"]:
            counts = f"{row['clipped']} clipped, {row['overlaps']} overlap"
            print(f"{row['page']} at {row['width']}: {counts}")
            print("".join(f"    {text}\n" for text in where), end="", flush=True)
    return rows


def _store(model: str, rows: Sequence[dict[str, Any]]) -> None:
    """Rows of other models stay: models can be measured one at a time."""
    file = HOME / "build" / "pages.json"
    before = json.loads(file.read_text(encoding="utf-8")) if file.exists() else []
    others = [row for row in before if row["page"].split("/")[0] != model]
    body = "".join(f"{line}\n" for line in _lines(sorted([*others, *rows], key=_place)))
    file.write_text(body, encoding="utf-8")


def _place(row: dict[str, Any]) -> tuple[str, int]:
    return row["page"], -row["width"]


def _lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A JSON list, a row to a line."""
    body = [f"  {json.dumps(row)}" for row in rows]
    return ["[", *(f"{line}," for line in body[:-1]), *body[-1:], "]"]


def written(path: Path) -> Iterator[Path]:
    """Every page there is of a model; one that does not apply is left out."""
    folder = PAGES / path.stem
    folder.mkdir(parents=True, exist_ok=True)
    for name, write in WRITERS.items():
        page = folder / f"{name}.html"
        page.unlink(missing_ok=True)
        try:
            write(path, page)
        except HamelError as error:
            print(f"{path.stem}: no {name}: {str(error).splitlines()[0]}", flush=True)
        if page.exists():
            print(page.relative_to(HOME), flush=True)
            yield page


def _derivation(path: Path, page: Path) -> None:
    hamel.derive(path, out=page.parent)


def _two_roads(path: Path, page: Path) -> None:
    with tempfile.TemporaryDirectory(dir=PAGES) as scratch:
        hamel.derive(path, out=scratch, road=("kane", "boltzmann_hamel"))
        shutil.move(Path(scratch) / "derivation.html", page)


def _linearization(path: Path, page: Path) -> None:
    if load(path).steady_motions:
        hamel.linearize(path, out=page.parent)


def _motion(path: Path, page: Path) -> None:
    hamel.simulate(path, time=1.0, view=page)


WRITERS: dict[str, Callable[[Path, Path], None]] = {
    "derivation": _derivation,
    "two_roads": _two_roads,
    "linearization": _linearization,
    "motion": _motion,
}


def _parts(pages: Sequence[Path]) -> list[Sequence[Path]]:
    return [pages[k : k + AT_ONCE] for k in range(0, len(pages), AT_ONCE)]


def measured(browser: str, pages: Sequence[Path]) -> list[dict[str, Any]]:
    """One row for every page and width."""
    urls = [page.resolve().as_uri() for page in pages]
    script = f"const PAGES = {json.dumps(urls)}, WIDTHS = {json.dumps(WIDTHS)};{MEASURE}"
    body = f'<!DOCTYPE html><body><pre id="rows"></pre><script>{script}</script></body>'
    with tempfile.TemporaryDirectory(dir=PAGES) as scratch:
        frame = Path(scratch) / "frame.html"
        frame.write_text(body, encoding="utf-8")
        text = _opened(browser, frame, Path(scratch) / "profile")
    rows = json.loads(unescape(PATTERN.findall(text)[0]))
    for row, page in zip(rows, [page for page in pages for _ in WIDTHS]):
        row["page"] = str(page.relative_to(PAGES))
    return rows


def _opened(browser: str, page: Path, profile: Path) -> str:
    """The page as it is once its script has run."""
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--allow-file-access-from-files",
        "--window-size=1500,1000",
        "--virtual-time-budget=600000",
        f"--user-data-dir={profile}",
        "--dump-dom",
    ]
    command = [browser, *flags, page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
    return done.stdout


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
