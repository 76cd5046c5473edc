"""The page of a motion: everything is in it, positions are those of the System within a fraction of
a pixel, and a model's text stays text.

Of hamel.simulate: view. Of hamel.draw.mechanism: moving.
"""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from codegen import compiler
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.cli import main
from hamel.draw.mechanism.moving import frames, moving, quaternion
from hamel.draw.mechanism.poses import Bodies
from hamel.simulate.view import page
from tests.scenes import MODELS

ROWS = 40


def course(mechanics, turn: float = 2.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t, q and p of something that moves: every coordinate, as far as the page is concerned."""
    t, p = np.linspace(0.0, 1.0, ROWS), np.array(mechanics.parameters)
    start = initial_state(mechanics).q
    scale = 0.1 + np.abs(start)
    q = start + turn * np.outer(np.sin(3 * t), scale)
    for k in mechanics.quaternions:
        q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1)[:, None]
    return t, q, p


def motion(mechanics, t, q) -> SimpleNamespace:
    """As much of a record as the page reads."""
    zero = np.zeros_like(t)
    names = [c.name for c in mechanics.model.coordinates]
    energies = {"T": 1 + t, "V": -t, "work": zero}
    violations = {"position_violation": 1e-12 + zero, "velocity_violation": zero}
    columns = {"t": t, **dict(zip(names, q.T)), **energies, **violations}
    return SimpleNamespace(title="a <b> & c", motion=columns, measures=columns)


def unpacked(column: list, count: int) -> np.ndarray:
    if len(column) == 1:
        return np.full(count, column[0])
    low, step, text = column
    return low + step * np.frombuffer(base64.b64decode(text), "<u2").astype(float)


def rotation(w: float, x: float, y: float, z: float) -> np.ndarray:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "stanford_arm"])
def test_positions_on_the_page_are_those_of_the_system(name):
    mechanics = system(load(MODELS / f"{name}.yaml"))
    t, q, p = course(mechanics)
    data = moving(mechanics, t, q, p).data
    poses = Bodies(mechanics).many(t, q, p)
    pixels = data["view"]["scale"]
    columns = [unpacked(column, ROWS) for column in data["poses"]]
    assert len(columns) == 7 * poses.shape[1]
    for body in range(poses.shape[1]):
        own = np.array(columns[7 * body : 7 * body + 7])
        assert np.abs(own[:3] - poses[:, body, 9:].T).max() * pixels < 0.05
        for k in range(ROWS):
            turned = rotation(*own[3:, k] / np.linalg.norm(own[3:, k]))
            assert turned == pytest.approx(poses[k, body, :9].reshape(3, 3), abs=2e-4)
        # q and −q are one rotation: between neighbours the page goes the short way
        assert np.sum(own[3:, 1:] * own[3:, :-1], axis=0).min() > 0


def test_every_rotation_has_its_quaternion():
    rng = np.random.default_rng(0)
    for q in [*np.eye(4), *rng.normal(size=(20, 4))]:
        R = rotation(*q / np.linalg.norm(q))
        assert rotation(*quaternion(R)) == pytest.approx(R, abs=1e-12)


class Elements(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def text_of(name: str) -> str:
    mechanics = system(load(MODELS / f"{name}.yaml"))
    t, q, p = course(mechanics, 0.3)
    return page(mechanics, motion(mechanics, t, q), p)


@pytest.mark.parametrize("name", ["slider_crank", "rolling_sphere", "pendulum", "ball_on_beam"])
def test_one_file_without_network_and_the_same_every_time(name):
    text = text_of(name)
    assert text == text_of(name)
    assert "a &lt;b&gt; &amp; c" in text and "a <b>" not in text
    addresses = set(re.findall(r"(?:https?:)?//[\w.]+", text))
    assert {x for x in addresses if ":" in x} == {"http://www.w3.org"}  # the name of SVG
    elements = Elements()
    elements.feed(text)
    assert not any(attributes.get("src") or tag == "link" for tag, attributes in elements.tags)
    controls = [x for tag, x in elements.tags if tag in ("input", "button", "select")]
    assert len(controls) >= 3 and len(text) < 400_000
    slider = next(x for x in controls if x.get("type") == "range")
    assert slider["aria-label"] == "time"


def test_text_of_a_model_cannot_end_the_script():
    mechanics = system(load(MODELS / "four_bar.yaml"))
    t, q, p = course(mechanics, 0.3)
    model = mechanics.model
    outputs = tuple(replace(x, name="</script><b>") for x in model.outputs)
    evil = replace(mechanics, model=replace(model, outputs=outputs, name="</title><b>"))
    text = page(evil, motion(evil, t, q), p)
    assert "<b>" not in text
    data = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert json.loads(data[1])["traces"][0][-1] == "</script><b>"


def test_long_motions_are_thinned_but_keep_their_end():
    rows = frames(100_001)
    assert len(rows) == 600 and rows[0] == 0 and rows[-1] == 100_000
    assert frames(1).tolist() == [0] and frames(3).tolist() == [0, 1, 2]


def test_a_body_that_goes_far_is_followed():
    text = "model: m\nplane: xy\nbodies: {a: {mass: 1 kg, inertia: 0.01}, b: {mass: 1 kg, com: [0.1 m, 0]}}\njoints:\n  p: {type: planar, parent: ground, child: a, coordinates: [x, y, th]}\n  j: {type: revolute, parent: a, child: b, at: [0.2 m, 0], coordinate: q}\n"
    mechanics = system(load_text(text))
    t = np.linspace(0.0, 1.0, ROWS)
    q = np.zeros((ROWS, 4))
    q[:, 0] = 100 * t
    found = moving(mechanics, t, q, np.array([]))
    assert found.data["follow"] == 0 and found.box[2] < 500
    q[:, 0] = 0.1 * t
    assert moving(mechanics, t, q, np.array([])).data["follow"] == -1


@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
def test_the_verb_writes_the_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = str(MODELS / "pendulum.yaml")
    with pytest.raises(SystemExit) as ended:
        main(["simulate", path, "--time", "1", "--view", "motion.html", "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["view"] == "motion.html"
    assert "pendulum in motion" in (tmp_path / "motion.html").read_text("utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["simulate", path, "--view", "motion.gif"])
    assert ended.value.code == 1 and ".html" in capsys.readouterr().err
