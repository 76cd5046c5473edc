"""The WebAssembly target: values in Node, errors in its files that are seen, many motions, calls
that do not fit, names that are refused, a compiler that is missing.

Of codegen.targets: wasm.
Of codegen.runtime: build_wasm.
Of hamel.verify.targets: wasm, motions.
"""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import program
from codegen.runtime import build_wasm
from derive.diagnostics import AssumptionError, ToolchainError
from hamel.build.module import compiled
from hamel.verify.targets import Subject
from hamel.verify.targets import wasm as checked
from tests.subjects import subject
from tests.toy import toy

needs_tools = pytest.mark.skipif(
    compiler.find_compiler() is None or not shutil.which("node") or not build_wasm.find_compiler(),
    reason="no Node, or no compiler for WebAssembly",
)
needs_browser = pytest.mark.skipif(
    not any(map(shutil.which, checked.BROWSERS)), reason="no Chromium"
)
SCRIPT = """
import { load, Failure } from "./cart_pole.mjs";
import assert from "node:assert";
const model = await load();
const start = [0, 0.1, 0, 0], times = [0, 0.1, 0.2];
const many = model.simulate(times, [start, [0, 0.2, 0, 0]], { u: [[1], [2]] });
assert.deepEqual(many[0].x, model.simulate(times, start, { u: [1] }).x);
assert.equal(many[1].status, "ok");
assert.throws(() => model.dynamics(0, [NaN, 0, 0, 0]), (e) => e instanceof Failure && e.status === 3);
assert.throws(() => model.dynamics(0, [0, 0]), RangeError);
assert.throws(() => model.simulate(times, start, { integrator: "euler" }), Failure);
for (const wrong of [[], [1, 0], [0, 2, 1], [0, NaN], [NaN, 1], [0, Infinity]])
    assert.throws(() => model.simulate(wrong, start), RangeError);
assert.throws(() => model.dynamics(0), /x has to be an array of 4 numbers/);
for (const wrong of [{ rtol: -1 }, { atol: 0 }, { rtol: NaN }])
    assert.throws(() => model.simulate(times, start, wrong), /tolerances above zero/);
const short = model.simulate(times, start, { maxSteps: 1, rtol: 1e-13 });
assert(short.status !== "ok" && Number.isNaN(short.x[11]));
"""


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    base = tmp_path_factory.mktemp("wasm")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["wasm"])


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("this._put(au, u ?? ", "this._put(au, ", {"values", "values with SIMD"}),
        ("u ?? new", "u  ??  new", set()),
        ("this.raw[name](t, ax, au", "this.raw[name](t, ax, ap", {"values", "values with SIMD"}),
        ("this._put(au + k", "this._put(ap + k", {"simulate", "steps"}),
        ("stepSize, rtol", "1, rtol", {"simulate", "steps"}),
        ("rtol, atol, max", "1e-9, 1e-9, max", {"steps"}),
    ],
)
def test_errors_are_seen_in_node(cart_pole, tmp_path, monkeypatch, before, after, seen):
    monkeypatch.setattr(checked, "BROWSERS", ())
    shutil.copytree(cart_pole.folder, tmp_path / "cart_pole")
    file = tmp_path / "cart_pole" / "wasm" / "cart_pole.mjs"
    text = file.read_text("utf-8")
    assert before in text
    file.write_text(text.replace(before, after))
    results = list(checked.check(replace(cart_pole, folder=tmp_path / "cart_pole")))
    failed = {result.name for result in results if not result.passed}
    assert failed == {f"{name} in Node" for name in seen}


@needs_tools
@pytest.mark.slow
def test_a_browser_that_is_missing_is_said(cart_pole, monkeypatch):
    monkeypatch.setattr(checked, "BROWSERS", ())
    *_, last = checked.check(cart_pole)
    assert last.name == "not run in Chromium, which is not installed"
    assert "apt install chromium" in last.about


@pytest.mark.skipif(not shutil.which("node"), reason="no Node")
def test_what_does_not_end_in_node_has_no_values(tmp_path, monkeypatch):
    monkeypatch.setattr(checked, "LIMIT", 0.5)
    (tmp_path / "wasm").mkdir()
    (tmp_path / "wasm" / "endless.mjs").write_text("while (true);\n")
    endless = Subject("endless", tmp_path, sys, {})
    assert checked._in_node("node", endless, {"rows": {}}) == {}


def without_memory(folder: Path, tool: str, body: str) -> str:
    """A Node that has no room for the memory of WebAssembly, as under `ulimit -v`, or a browser."""
    file = folder / tool
    file.write_text(f"#!{sys.executable}\nimport sys, urllib.request as web\n{body}")
    file.chmod(0o755)
    return str(file)


def test_a_node_without_room_for_webassembly_is_told_as_such(tmp_path):
    """It was told as wrong numbers: "values in Node: not finite"."""
    (tmp_path / "wasm").mkdir()
    reason = "RangeError: WebAssembly.Memory(): could not allocate memory"
    node = without_memory(
        tmp_path, "node", f"if '-e' not in sys.argv: sys.exit(1)\nprint('{reason}')"
    )
    with pytest.raises(ToolchainError) as caught:
        checked._in_node(node, Subject("small", tmp_path, sys, {}), {"rows": {}})
    assert f"Node cannot run WebAssembly here: {reason}" in str(caught.value)
    assert "ulimit -v unlimited" in str(caught.value)
    silent = without_memory(tmp_path, "silent", "sys.exit('no such library')")
    with pytest.raises(ToolchainError, match="here: no such library"):
        checked._in_node(silent, Subject("small", tmp_path, sys, {}), {"rows": {}})


@pytest.mark.parametrize("said, cause", [("no room", "no room"), (None, "does not open a page")])
def test_a_browser_without_room_for_webassembly_is_told_as_such(tmp_path, monkeypatch, said, cause):
    (tmp_path / "wasm").mkdir()
    monkeypatch.setattr(checked, "LIMIT", 2.0)
    post = "web.urlopen(web.Request(sys.argv[-1].replace('check.html', {!r}), data={!r}))\n"
    asked = [] if said is None else [("able", said.encode()), ("found", b'{"error": "it is"}')]
    body = "".join(post.format(*given) for given in asked)
    browser = without_memory(tmp_path, "chromium", body)
    with pytest.raises(ToolchainError, match=f"Chromium cannot run WebAssembly here: .*{cause}"):
        checked._in_browser(browser, Subject("small", tmp_path, sys, {}), {"rows": {}})
    monkeypatch.setattr(checked, "BROWSERS", (browser,))
    monkeypatch.setattr(checked, "_in_node", lambda *_: {})
    monkeypatch.setattr(checked, "motion_of", lambda _: None)
    *_, last = checked.check(Subject("small", tmp_path, SimpleNamespace(defaults=np.zeros(1)), {}))
    assert last.passed and last.name == checked.UNABLE and cause in last.about


@needs_tools
@needs_browser
@pytest.mark.slow
def test_errors_are_seen_in_chromium(cart_pole, tmp_path):
    """States that are doubled where there is a window, which Node has not."""
    shutil.copytree(cart_pole.folder, tmp_path / "cart_pole")
    file = tmp_path / "cart_pole" / "wasm" / "cart_pole.mjs"
    before = "this._put(ax, x"
    text = file.read_text("utf-8")
    assert before in text
    spoiled = 'this._put(ax, typeof window === "undefined" ? x : x.map((value) => 2 * value)'
    file.write_text(text.replace(before, spoiled))
    results = checked.check(replace(cart_pole, folder=tmp_path / "cart_pole"))
    failed = {result.name for result in results if not result.passed}
    assert failed == {"values in Chromium", "values with SIMD in Chromium"}


@needs_tools
@pytest.mark.slow
def test_many_motions_and_calls_that_do_not_fit(cart_pole):
    place = cart_pole.folder / "wasm" / "use.mjs"
    place.write_text(SCRIPT)
    subprocess.run(["node", place], check=True)


STOPPING = """model: swing
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {rod: {mass: 1 kg, com: [0, -0.5 m], inertia: 0.1 kg*m^2}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
events:
  bottom: q
  stop: {formula: q + 45 deg, direction: falling, stop: true}
"""
STOPPED = """
import { load } from "./swing.mjs";
import assert from "node:assert";
const model = await load();
const [high, low] = model.simulate([0, 0.4, 2], [[1, 0], [0.5, 0]]);
assert.equal(high.status, "event");
assert(Math.abs(model.simulate([0, high.time - 1e-9], [1, 0]).x[2] + Math.PI / 4) < 1e-6);
assert(high.x[2] > -0.7 && Math.abs(high.x[4] + Math.PI / 4) < 1e-9);
assert.equal(low.status, "ok");
assert.equal(model.simulate([0, 500], [0.5, 0]).status, "ok"); // through hundreds that do not stop
"""


@needs_tools
@pytest.mark.slow
def test_an_event_that_stops_ends_a_motion(tmp_path):
    (tmp_path / "swing.yaml").write_text(STOPPING)
    swing = subject(tmp_path, str(tmp_path / "swing"), ["wasm"])
    place = swing.folder / "wasm" / "use.mjs"
    place.write_text(STOPPED)
    subprocess.run(["node", place], check=True)
    assert all(found.passed for found in checked.check(swing))


@needs_tools
@pytest.mark.slow
def test_nothing_is_imported_by_the_module(cart_pole):
    code = (
        'import fs from "node:fs"; for (const end of ["", "_simd"]) {'
        "const bytes = fs.readFileSync(`./cart_pole${end}.wasm`);"
        "if (WebAssembly.Module.imports(new WebAssembly.Module(bytes)).length) process.exit(1); }"
    )
    command = ["node", "--input-type=module", "-e", code]
    subprocess.run(command, check=True, cwd=cart_pole.folder / "wasm")


@pytest.mark.slow
def test_without_a_compiler_nothing_is_built(monkeypatch, tmp_path):
    """The command that installs one is said, before anything is written."""
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = replace(program(toy(), ("dynamics",)), targets=("wasm",))
    texts = emit(made)
    texts["build_wasm.py"] = texts["build_wasm.py"].replace('shutil.which("clang")', "None")
    texts["build_wasm.py"] = texts["build_wasm.py"].replace(
        'find_spec("ziglang")', 'find_spec("no")'
    )
    missing = pytest.raises(ToolchainError, match=r"^error: no compiler for .*pip install ziglang")
    with missing as refused, compiled("toy", texts):
        pass
    assert "CC names another" not in str(refused.value)


def test_a_name_that_javascript_keeps_is_refused():
    made = program(toy())
    kernels = (replace(made.kernels[0], name="delete"), *made.kernels[1:])
    with pytest.raises(AssumptionError, match="'delete'"):
        emit(replace(made, kernels=kernels, targets=("wasm",)))
