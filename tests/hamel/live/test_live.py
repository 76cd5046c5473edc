"""A page that computes: what its sliders and its equations say is what the module and the terms say,
read back from a headless Chromium.

Of hamel.live: page, course, functions, module, shape, limits.
"""

import html
import json
import re
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hamel
from codegen.runtime import build_wasm
from derive.diagnostics import ToolchainError
from derive.formulations.evaluate import function_of
from derive.formulations.frames import based
from derive.states.initial import initial_state
from derive.textbook.derivation import derivation
from hamel.build.stages import equations_of
from hamel.draw.mechanism.poses import Bodies
from hamel.live import module
from hamel.live.course import course
from hamel.live.functions import FORMULAS, POSES, places, with_live
from hamel.live.limits import LOOKED, SPAN
from hamel.live.shape import drawing_of
from tests.scenes import MODELS

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
MOST = 1_000_000  # bytes
NARROWEST = 96.0  # pixels of a slider that can be moved
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
# moves sliders, points at every equation, and says what there is to read
READ = """<pre id="result"></pre><script type="module">
const out = {};
const moved = (kind, index, value) => {
  const e = document.querySelector(`.slider[data-kind="${kind}"][data-index="${index}"]`);
  e.value = value;
  e.dispatchEvent(new Event("input"));
};
const ready = () => globalThis.hamel && !document.querySelector(".equation:not([tabindex])");
for (let k = 0; k < 500 && !ready(); k++) await new Promise(done => setTimeout(done, 20));
const h = globalThis.hamel, first = document.getElementById("parts").innerHTML;
for (const [kind, index, value] of MOVES) moved(kind, index, value);
out.x = h.start(); out.p = h.now.p; out.u = h.now.u; out.told = h.told(); out.status = h.motion().status;
out.end = Array.from(h.motion().x).slice(-out.x.length);
out.xdot = Array.from(h.model.dynamics(0, out.x, out.u, out.p));
out.moves = document.getElementById("parts").innerHTML !== first;
out.beyond = 0;
out.narrow = Math.min(...[...document.querySelectorAll(".slider")].map(e => e.getBoundingClientRect().width));
for (let k = 0; k <= 1000; k += 50) {
  const slider = document.getElementById("time"), box = document.getElementById("stage").getBoundingClientRect();
  slider.value = k;
  slider.dispatchEvent(new Event("input"));
  for (const mark of document.querySelectorAll("#parts .mass, #parts .bob, #parts .rim, #parts .disc")) {
    const r = mark.getBoundingClientRect();
    out.beyond = Math.max(out.beyond, box.left - r.left, box.top - r.top, r.right - box.right, r.bottom - box.bottom);
  }
}
document.getElementById("time").value = 0;
document.getElementById("time").dispatchEvent(new Event("input"));
out.read = {};
for (const equation of document.querySelectorAll(".equation")) {
  equation.dispatchEvent(new Event("pointerenter"));
  out.read[equation.id.replace("equation-", "")] = h.numbers();
}
document.getElementById("result").textContent = JSON.stringify(out);
</script></body>"""


def formed(name: str):
    """Equations as a page takes them, and the document."""
    equations = based(equations_of(MODELS / f"{name}.yaml"))
    return equations, derivation(equations)


def test_formulas_of_the_page_are_the_printed_ones() -> None:
    """At a random state: the function that is compiled, and every printed term with v put in."""
    equations, document = formed("double_pendulum")
    system = equations.system
    function = with_live(equations, document, Bodies(system)).function(FORMULAS)
    symbols = [argument.symbols for argument in equations.arguments]
    evaluated = ca.Function("f", symbols, [function.result.value])
    x = np.array([0.3, -0.7, 1.1, 0.4])
    p = np.array(system.own_parameters)
    whole = np.asarray(evaluated(0.0, x, np.zeros(symbols[2].numel()), p)).ravel()
    velocity = ca.Function("v", symbols, [equations.function("velocity").result.value])
    v = velocity(0.0, x, np.zeros(symbols[2].numel()), p)
    own = [system.t, system.q, system.v, system.u, system.p, symbols[1][equations.speeds, 0]]
    at = 0
    for formula in document.printed:
        alone = ca.Function("one", own, [ca.vec(ca.densify(formula.value).T)])
        wanted = np.asarray(alone(0.0, x[:2], v, 0.0, p, x[2:])).ravel()
        assert whole[at : at + wanted.size] == pytest.approx(wanted, rel=1e-13, abs=1e-13)
        at += wanted.size
    assert at == whole.size
    ranges = [line for lines in places(document).values() for line in lines]
    assert ranges and all(first >= 0 and first + count <= at for first, count, _ in ranges)


def test_shapes_follow_a_length() -> None:
    """The points at another length of the crank are those that the slopes say."""
    equations, _ = formed("four_bar")
    system, p = equations.system, np.array(equations.system.own_parameters)
    q = initial_state(system).q
    rows = (np.array([0.0, 1.0]), np.vstack([q, q]))
    data = drawing_of(system, *rows, p).data["shapes"]
    bars = [shape for shape in data if shape["s"] == "bar" and shape["b"] == 0]
    assert bars[0]["d"][0][3] == pytest.approx(1.0, abs=1e-3)  # its end lies at l1
    assert not any(6 in shape.get("d", {}) for shape in data)  # a mass moves nothing


def test_the_size_of_the_picture_is_that_of_the_motion() -> None:
    """The rough course is the module's own motion, within a pixel."""
    equations, _ = formed("double_pendulum")
    p = np.array(equations.system.own_parameters)
    x = np.array([1.2, 0.4, 0.0, 0.0])
    t, q = course(equations, x, p)
    assert t[0] == 0.0 and t[-1] == pytest.approx(SPAN) and len(t) == len(q) == LOOKED + 1
    assert q[0] == pytest.approx(x[:2]) and np.ptp(q[:, 0]) > 1.0
    exact = solve_ivp(
        lambda t, x: np.asarray(function_of(equations, "dynamics")(t, x, [], p)).ravel(),
        (0.0, 1.0), x, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    assert q[LOOKED // 5] == pytest.approx(exact.y[:2, -1], abs=1e-4)


def test_a_course_ends_where_numbers_do() -> None:
    """Not defined from the start: the picture is that of the start."""
    equations, _ = formed("double_pendulum")
    p = np.array(equations.system.own_parameters)
    t, q = course(equations, np.array([0.1, np.nan, 0.0, 0.0]), p)
    assert len(t) == len(q) == 2


def test_poses_are_asked_of_the_module() -> None:
    equations, document = formed("double_pendulum")
    function = with_live(equations, document, Bodies(equations.system)).function(POSES)
    assert function.result.value.numel() == 12 * len(equations.system.model.bodies)


def test_without_a_compiler_the_page_is_refused(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(module, "find_compiler", lambda: None)
    with pytest.raises(ToolchainError, match="a compiler for WebAssembly") as refusal:
        hamel.derive(MODELS / "pendulum.yaml", out=tmp_path, live=True)
    assert "wasi-libc" in str(refusal.value) and not list(tmp_path.iterdir())


MOVES = {
    "pendulum": [["x", 1, -0.3]],
    "four_bar": [["p", 1, 0.6], ["x", 0, 1.3], ["u", 0, 0.5], ["x", 3, 2.0]],
    "rolling_disk": [["p", 0, 0.7], ["p", 1, 0.5], ["x", 4, 0.2]],
}


@pytest.mark.slow
@pytest.mark.skipif(build_wasm.find_compiler() is None, reason="no compiler for WebAssembly")
@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
@pytest.mark.parametrize("name", MOVES)
def test_numbers_of_the_page_are_those_of_the_module(name: str, tmp_path) -> None:
    made = hamel.derive(MODELS / f"{name}.yaml", out=tmp_path / "page", live=True)
    text = made.html.read_text("utf-8")
    assert len(text.encode()) <= MOST and "http" not in re.sub(r"http://www\.w3\.org/\S+", "", text)
    out = told(text, MOVES[name], tmp_path)
    assert out["status"] == "ok" and out["told"] == "" and out["moves"]
    assert out["beyond"] <= 0 and out["narrow"] >= NARROWEST  # pixels
    legends = re.findall(r'class="symbol"[^>]*>(.*?)</text>', text)
    assert legends and not any("_" in re.sub("<[^>]+>", "", x) for x in legends)
    for kind, index, value in MOVES[name]:
        assert out[kind][index] == pytest.approx(value, abs=1e-8)
    built = hamel.build(MODELS / f"{name}.yaml", out=tmp_path / name, choice=made.choice)
    other = hamel.load(built.folder)
    arguments = [np.array(out[key], dtype=float) for key in ("x", "u", "p")]
    assert out["xdot"] == pytest.approx(other.dynamics(0.0, *arguments), rel=1e-12, abs=1e-12)
    motion = other.simulate((0.0, SPAN), *arguments, rtol=1e-11, atol=1e-13)
    assert out["end"] == pytest.approx(motion.x[-1], rel=1e-5, abs=1e-5)
    check_formulas(name, out, arguments)


def check_formulas(name: str, out: dict, arguments: list[np.ndarray]) -> None:
    """What stands at every equation, against its term; other parameters are seen."""
    equations, document = formed(name)
    function = with_live(equations, document, Bodies(equations.system)).function(FORMULAS)
    symbols = [argument.symbols for argument in equations.arguments]
    evaluated = ca.Function("f", symbols, [function.result.value])
    whole = np.asarray(evaluated(0.0, *arguments)).ravel()
    others = np.asarray(evaluated(0.0, *arguments[:2], 1.01 * arguments[2])).ravel()
    count, seen = 0, 0
    for number, lines in places(document).items():
        for (first, size, _), values in zip(lines, out["read"][str(number)], strict=True):
            wanted = whole[first : first + size]
            assert values == pytest.approx(wanted, rel=1e-11, abs=1e-11), number
            count += size
            seen += int(np.any(np.abs(others[first : first + size] - wanted) > 1e-6))
    assert count > 20 and seen > 3


def told(text: str, moves: list, folder) -> dict:
    """The page opened, its sliders moved."""
    script = READ.replace("MOVES", json.dumps(moves))
    (folder / "read.html").write_text(text.replace("</body>", script), "utf-8")
    command = [
        BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=60000",
        "--dump-dom", (folder / "read.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    return json.loads(
        html.unescape(re.findall(r'<pre id="result">(.*?)</pre>', done.stdout, re.S)[0])
    )
