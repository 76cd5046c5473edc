"""Live pages in Chromium, timed by the clock: build/live.json with a row for every model.

| of a row | is |
|---|---|
| `bytes` | of the page, which is one file |
| `first_paint` | s from the start of navigation to the first text on the screen |
| `first_picture` | s to the figure at the state that the module computed, its motion integrated |
| `frame`, `slow_frame` | s for one frame of the motion, median and 95th of 100: state, drawing, layout, paint |
| `read_frame` | the same (median) with the numbers of the longest equation beside it |
| `per_second` | frames that were shown in a second |
| `slider` | s of work for a slider moved by a step: constraints, motion, plots, figure |

Times are the least of a few openings, each by a Chromium that has just started: other work on the
machine only adds. Run it on an idle one. Run by `make live`; `python benchmarks/live.py four_bar` does some models.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pages import BROWSERS, HOME, browser_of

import hamel

PAGES = HOME / "build" / "live"
MODELS = ("four_bar", "snake3", "rolling_disk", "bicycle", "stanford_arm")
OPENINGS = 3
PATIENCE = 60  # seconds for one opening
PATTERN = re.compile(r'"live-page (\{.*\})"')
# what a page has to keep; rates of a screen that shows 60 frames a second
LIMITS = {
    "bytes": 1_000_000,
    "first_picture": 0.5,
    "slow_frame": 1 / 60,
    "read_frame": 1 / 60,
}
LEAST_RATE = 58.0  # frames a second: a screen of 60 misses one now and then

START = '<script>setTimeout(() => { location.href = "page.html"; }, 2000);</script>'
# in the head: the moment at which the page has drawn its first figure
BEFORE = """<script>{
const shown = run => requestAnimationFrame(() => { const c = new MessageChannel(); c.port1.onmessage = run; c.port2.postMessage(0); });
let value;
Object.defineProperty(globalThis, "hamel", {configurable: true, get: () => value, set: x => {
  value = x;
  shown(() => { globalThis.picture = performance.now(); });
}});
}</script>"""
AFTER = """<script>{
const FRAMES = 200;
const quantile = (times, part) => times.sort((a, b) => a - b)[Math.floor(part * (times.length - 1))] / 1000;
// each callback of a frame is timed to the end of the frame: a message arrives once it is painted
const native = requestAnimationFrame.bind(window);
let works = null, moments = null;
globalThis.requestAnimationFrame = run => native(moment => {
  const from = performance.now(), channel = new MessageChannel();
  if (moments) moments.push(moment);
  channel.port1.onmessage = () => { if (works) works.push(performance.now() - from); };
  run(moment);
  channel.port2.postMessage(0);
});
const pause = time => new Promise(done => setTimeout(done, time));
async function played() {
  document.getElementById("play").click();
  await pause(300);
  works = []; moments = [];
  while (works.length < FRAMES) await pause(50);
  const result = [works, moments];
  works = moments = null;
  document.getElementById("play").click();
  return result;
}
async function measure() {
  while (!globalThis.picture) await pause(20);
  await pause(500);
  const out = {first_picture: globalThis.picture / 1000, first_paint: performance.getEntriesByName("first-contentful-paint")[0].startTime / 1000};
  const [times, at] = await played();
  out.per_second = 1000 * (at.length - 1) / (at.at(-1) - at[0]);
  out.frame = quantile(times, .5);
  out.slow_frame = quantile(times, .95);
  const counts = [...document.querySelectorAll(".equation")].map(e => {
    e.dispatchEvent(new Event("pointerenter"));
    return [globalThis.hamel.numbers().flat().length, e];
  });
  const longest = counts.reduce((a, b) => b[0] > a[0] ? b : a);
  longest[1].dispatchEvent(new Event("pointerenter"));
  out.read_frame = quantile((await played())[0], .5);
  out.numbers = longest[0];
  const slider = document.querySelector(".slider"), moves = [];
  for (let k = 1; k <= 20; k++) {
    slider.value = +slider.value * (1 + .002 * k);
    const from = performance.now();
    slider.dispatchEvent(new Event("input"));
    moves.push(performance.now() - from);
    await pause(20);
  }
  out.slider = quantile(moves, .5);
  console.log("live-page " + JSON.stringify(out));
}
addEventListener("load", measure);
}</script></body>"""


def main(names: Sequence[str]) -> int:
    """Writes and times the live pages of these models, of five where none is named."""
    browser = browser_of()
    if browser is None:
        print(f"none of {', '.join(BROWSERS)} is installed; pages are timed in one of them")
        return 3
    rows = [_row(browser, name) for name in names or MODELS]
    file = HOME / "build" / "live.json"
    before = json.loads(file.read_text("utf-8")) if file.exists() else []
    measured = {row["page"] for row in rows}
    kept = [row for row in before if row["page"] not in measured]
    text = json.dumps(sorted([*kept, *rows], key=lambda row: row["page"]), indent=1)
    file.write_text(f"{text}\n", encoding="utf-8")
    return 1 if any(misses(row) for row in rows) else 0


def _row(browser: str, name: str) -> dict[str, Any]:
    """Of one model; what it misses is told."""
    folder = PAGES / name
    made = hamel.derive(HOME / "models" / f"{name}.yaml", out=folder, live=True)
    text = made.html.read_text("utf-8")
    row = {"page": name, "bytes": len(text.encode()), **timed(browser, text)}
    shown = {key: f"{value:.4g}" for key, value in row.items() if key != "page"}
    print(name, *(f"{key} {value}" for key, value in shown.items()))
    for line in misses(row):
        print(f"    {line}")
    return row


def misses(row: Mapping[str, Any]) -> list[str]:
    """What a row does not keep, in words."""
    above = [
        f"{key} is {row[key]:.4g}, at most {most:.4g}"
        for key, most in LIMITS.items()
        if row[key] > most
    ]
    if row["per_second"] < LEAST_RATE:
        above.append(f"per_second is {row['per_second']:.4g}, at least {LEAST_RATE:g}")
    return above


def timed(browser: str, text: str) -> dict[str, float]:
    """The least times, and the highest rate, of a few openings of this page."""
    timing = text.replace("<head>", f"<head>{BEFORE}", 1)
    timing = AFTER.join(timing.rsplit("</body>", 1))
    PAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=PAGES) as scratch:
        (Path(scratch) / "page.html").write_text(timing, encoding="utf-8")
        page = Path(scratch) / "start.html"  # a browser that runs already opens the page
        page.write_text(START, encoding="utf-8")
        openings = [_opened(browser, page, Path(scratch) / f"{k}") for k in range(OPENINGS)]
    best = {key: min(row[key] for row in openings) for key in openings[0]}
    return best | {"per_second": max(row["per_second"] for row in openings)}


def _opened(browser: str, page: Path, profile: Path) -> dict[str, float]:
    """What the page says on its console, by its own clock: virtual time would stand still."""
    flags = [
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--no-first-run",
        "--window-size=1400,1000",
        "--enable-logging=stderr",
        f"--user-data-dir={profile}",
    ]
    command = [browser, *flags, page.as_uri()]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, errors="replace", **streams) as process:
        clock = threading.Timer(PATIENCE, process.kill)
        clock.start()
        try:
            for line in process.stderr or ():
                if found := PATTERN.search(line):
                    return json.loads(found[1])
        finally:
            clock.cancel()
            process.terminate()
    raise RuntimeError(f"{page.name} said nothing in {PATIENCE} s")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
