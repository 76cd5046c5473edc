"""The WebAssembly target, by Node and, where there is one, by a headless Chromium: values of every
function in both variants and a motion, through the ES module, against the module. Where there is no
browser, or one that cannot run WebAssembly here, the results say so."""

from __future__ import annotations

import contextlib
import functools
import http.server
import json
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from derive.diagnostics import ToolchainError
from hamel.verify.records import CheckResult
from hamel.verify.targets.motions import Motion, motion_of
from hamel.verify.targets.records import Subject, TargetCheck, result

INSTALL = "apt install chromium"
NO_BROWSER = "not run in Chromium, which is not installed"
UNABLE = "not run in Chromium, which cannot run WebAssembly here"
ROOM = "ulimit -v unlimited, where the memory that a process may address is limited"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
HEADLESS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
LIMIT = 120.0  # s
# the same in Node and in a browser: values by function and variant, then the motion
COMMON = """
async function answers(model, asked) {
    const found = {};
    for (const variant of ["", "_simd"]) {
        const loaded = await model.load(`./%(name)s${variant}.wasm`);
        const value = (name, row) => {
            try {
                return Array.from(loaded[name](...row));
            } catch (error) {
                return String(error);
            }
        };
        for (const [name, rows] of Object.entries(asked.rows))
            found[name + variant] = rows.map((row) => value(name, row));
    }
    const loaded = await model.load(), m = asked.motion;
    if (m) {
        const motion = loaded.simulate(m.times, m.x, m);
        found.motion = Array.from(motion.x);
        found.steps = motion.steps;
    }
    return found;
}
"""
# why there is no room for as many memories as are asked for above: each keeps 8 GiB of addresses
ABLE = """
let said = "";
try {
    globalThis.kept = [0, 1, 2].map(() => new WebAssembly.Memory({ initial: 1 }));
} catch (error) {
    said = String(error);
}
"""
NODE = """
import * as model from "./%(name)s.mjs";
import fs from "node:fs";
const found = await answers(model, JSON.parse(fs.readFileSync(0, "utf8")));
fs.writeSync(1, JSON.stringify(found));
"""
PAGE = """<!doctype html>
<script>
%(able)s
fetch("/able", { method: "POST", body: said });
</script>
<script type="module">
import * as model from "./%(name)s.mjs";
let found;
try {
    found = await answers(model, await (await fetch("/asked")).json());
} catch (error) {
    found = { error: String(error) };
}
await fetch("/found", { method: "POST", body: JSON.stringify(found) });
%(common)s
</script>
"""


def check(subject: Subject) -> Iterator[CheckResult]:
    """ToolchainError without a Node that can run WebAssembly."""
    node = shutil.which("node")
    if node is None:
        raise ToolchainError("node is not installed", "apt install nodejs")
    motion = motion_of(subject)
    asked = _asked(subject, motion)
    yield from _outcomes(subject, motion, "Node", _in_node(node, subject, asked))
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        about = f"no browser is installed: {INSTALL}"
        yield CheckResult(NO_BROWSER, 0.0, 0.0, True, about)
        return
    try:
        outcome = _in_browser(browser, subject, asked)
    except ToolchainError as error:
        yield CheckResult(UNABLE, 0.0, 0.0, True, error.diagnostics[0].message)
        return
    yield from _outcomes(subject, motion, "Chromium", outcome)


def _asked(subject: Subject, motion: Motion | None) -> dict[str, Any]:
    """Arguments of every row, and of the motion, as JSON takes them."""
    names = [name for name in subject.rows if subject.sizes(name)]
    rows = {name: [_plain(subject, name, k) for k in _places(subject, name)] for name in names}
    if motion is None:
        return {"rows": rows}
    numbers = {"x": motion.x[0], "u": motion.u, "p": motion.p, "times": motion.times}
    tolerances = {"rtol": motion.rtol, "atol": motion.rtol}
    return {"rows": rows, "motion": {k: v.tolist() for k, v in numbers.items()} | tolerances}


def _places(subject: Subject, name: str) -> range:
    return range(len(subject.sizes(name)))


def _plain(subject: Subject, name: str, k: int) -> list[Any]:
    return [np.asarray(part).tolist() for part in subject.row(name, k)]


def _outcomes(
    subject: Subject, motion: Motion | None, where: str, found: dict[str, Any]
) -> Iterator[CheckResult]:
    """What was printed, compared; what cannot be compared is as wrong as can be."""
    for variant, about in (("", "values"), ("_simd", "values with SIMD")):
        errors = [_error(subject, name, found.get(name + variant, [])) for name in subject.rows]
        yield result(subject, f"{about} in {where}", errors, "every function of the ES module")
    if motion is not None:
        rows = found.get("motion")
        given = np.full(motion.x.shape, np.nan) if rows is None else np.array(rows, dtype=float)
        yield from motion.checks(where, given, found.get("steps", np.inf))


def _error(subject: Subject, name: str, values: list[Any]) -> float:
    if len(values) != len(subject.sizes(name)):
        return np.inf
    rest = iter(values)

    def following(*_: Any) -> np.ndarray:
        value = next(rest)
        wrong = isinstance(value, str) or None in value
        size = np.size(getattr(subject.module, name)(*_))
        return np.full(size, np.nan) if wrong else np.array(value, dtype=float)

    return subject.error(name, following)


# ---- Node


def _in_node(node: str, subject: Subject, asked: dict[str, Any]) -> dict[str, Any]:
    """What the script found; nothing where it did not come to its end. ToolchainError where it
    cannot."""
    with _served(subject) as folder:
        text = (NODE + COMMON) % {"name": subject.name}
        (folder / "check.mjs").write_text(text, "utf-8")
        try:
            done = subprocess.run(
                [node, "check.mjs"],
                check=False,
                cwd=folder,
                input=json.dumps(asked),
                capture_output=True,
                text=True,
                timeout=LIMIT,
            )
        except subprocess.TimeoutExpired:
            return {}
    if done.returncode == 0 and done.stdout:
        return json.loads(done.stdout)
    if reason := _inability(node):
        raise ToolchainError(f"Node cannot run WebAssembly here: {reason}", ROOM)
    return {}


def _inability(node: str) -> str:
    """Why it cannot run any WebAssembly; nothing where it can."""
    probe = subprocess.run(
        [node, "-e", f"{ABLE}console.log(said);"], check=False, capture_output=True, text=True
    )
    if probe.returncode:
        return (probe.stderr.strip() or "it does not start").splitlines()[-1]
    return probe.stdout.strip()


@contextlib.contextmanager
def _served(subject: Subject) -> Iterator[Path]:
    """A copy of the folder `wasm`, to put a script or a page beside."""
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base) / "wasm"
        shutil.copytree(subject.folder / "wasm", folder)
        yield folder


# ---- a browser


@dataclass
class _Talk:
    """What the page asks for, and what it answers: first why it cannot run WebAssembly, "" where it
    can."""

    asked: bytes
    unable: str = "it does not open a page"
    found: dict[str, Any] = field(default_factory=dict)
    done: threading.Event = field(default_factory=threading.Event)


class _Handler(http.server.SimpleHTTPRequestHandler):
    """Files of a folder, the questions, and where the answers go."""

    def __init__(self, *given: Any, talk: _Talk, **named: Any) -> None:
        self.talk = talk
        known = {".mjs": "text/javascript", ".wasm": "application/wasm"}
        self.extensions_map = {**type(self).extensions_map, **known}
        super().__init__(*given, **named)

    def do_GET(self) -> None:
        if self.path != "/asked":
            super().do_GET()
            return
        self.send_response(200)
        self.end_headers()
        self.wfile.write(self.talk.asked)

    def do_POST(self) -> None:
        length = int(self.headers.get("Content-Length", 0))
        said = self.rfile.read(length)
        if self.path == "/able":
            self.talk.unable = said.decode()
        else:
            self.talk.found = json.loads(said)
        self.send_response(204)
        self.end_headers()
        if self.path != "/able":
            self.talk.done.set()

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is said of what is asked for."""


def _in_browser(browser: str, subject: Subject, asked: dict[str, Any]) -> dict[str, Any]:
    """What the page found; nothing where it did not come to its end. ToolchainError where it
    cannot."""
    talk = _Talk(json.dumps(asked).encode())
    with _served(subject) as folder:
        common = COMMON % {"name": subject.name}
        page = PAGE % {"name": subject.name, "common": common, "able": ABLE}
        (folder / "check.html").write_text(page, "utf-8")
        handler = functools.partial(_Handler, directory=str(folder), talk=talk)
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            _visit(browser, f"http://127.0.0.1:{server.server_port}/check.html", folder, talk)
            server.shutdown()
    if talk.unable and ("error" in talk.found or not talk.found):
        raise ToolchainError(f"Chromium cannot run WebAssembly here: {talk.unable}", ROOM)
    return talk.found


def _visit(browser: str, address: str, folder: Path, talk: _Talk) -> None:
    command = [browser, *HEADLESS, f"--user-data-dir={folder.parent / 'profile'}", address]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        talk.done.wait(LIMIT)
    finally:
        process.terminate()
        process.wait()


WASM = TargetCheck("wasm", "Node, and Chromium where there is one", check)
