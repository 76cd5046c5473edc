"""`events:` of model files and events from Python through `hamel.simulate`: what they say, what is
printed, and what is refused; the examples."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.model import load_text
from derive.states import system
from hamel.cli import main

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "motions.md").read_text("utf-8")
PENDULUM = re.findall(r"^```yaml\n(model: .*?)^```", PAGE, re.DOTALL | re.MULTILINE)[0]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("stopped_pendulum.yaml").write_text(PENDULUM)
    return tmp_path


def test_the_pendulum_of_the_page_stops_as_it_says(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "stopped_pendulum.yaml", "--plot", "motion.svg"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    lines = re.findall(r"^  (?:event|stopped) .*$", PAGE, re.MULTILINE)
    assert len(lines) == 4 and all(line in said for line in lines)
    record = hamel.simulate("stopped_pendulum.yaml")
    assert record.stopped_by == "stop"
    assert record.final["q"] == pytest.approx(-np.pi / 4, abs=1e-13)
    assert record.motion["t"][-1] == record.time == record.events["stop"][0]
    assert record.at_events["bottom"].shape == (1, 2)
    height = 0.5 * 9.81 * (1 - np.cos(np.pi / 3))
    speed = np.sqrt(2 * height / 0.35)
    np.testing.assert_allclose(record.at_events["bottom"], [[0.0, -speed]], atol=1e-9)
    x = record.events["high"]
    assert len(x) == 1 and record.events["bottom"][0] < x[0] < record.time


def test_events_from_python_join_those_of_the_model(folder: Path) -> None:
    events = {"half": hamel.Event(lambda t, x: x[0] - 0.5, -1, True), "later": lambda t, x: t - 0.1}
    record = hamel.simulate("stopped_pendulum.yaml", events=events)
    assert record.stopped_by == "half" and record.final["q"] == pytest.approx(0.5, abs=1e-14)
    assert record.events["later"] == pytest.approx([0.1], abs=1e-15)
    assert record.events["bottom"] == []


@pytest.mark.parametrize(
    ("events", "said"),
    [
        ({"bottom": lambda t, x: 1.0}, "has an event 'bottom' already"),
        ({"low": 1.0}, "is no function"),
    ],
)
def test_what_makes_no_sense_is_refused(folder: Path, events: Any, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        hamel.simulate("stopped_pendulum.yaml", events=events)
    with pytest.raises(ModelError, match="looks for no events such as stop"):
        hamel.simulate("stopped_pendulum.yaml", integrator="scipy_dop853")


def test_a_function_that_fails_ends_the_motion_with_its_cause(folder: Path) -> None:
    def lost(t: float, x: np.ndarray) -> float:
        raise KeyError("sensor")

    with pytest.raises(AssumptionError, match=r"an event could not be looked for.*sensor"):
        hamel.simulate("stopped_pendulum.yaml", events={"lost": lost})


@pytest.mark.parametrize(
    ("entry", "line", "said"),
    [
        ("{formula: q, direction: up}", 1, "unknown direction 'up'"),
        ("{formula: q, stop: maybe}", 1, "unknown answer 'maybe'"),
        ("{formula: q, when: 3}", 1, "when"),
        ("q + 3 m", 1, ""),
        ("tip.z", 1, "unknown name 'tip.z'"),
        ("qq", 1, "did you mean 'q'"),
        ("position(rod)", 1, "a vector where a number is needed"),
    ],
)
def test_mistakes_in_events_are_told_at_their_place(entry: str, line: int, said: str) -> None:
    text = re.sub(r"^  bottom: q$", f"  bottom: {entry}", PENDULUM, flags=re.MULTILINE)
    with pytest.raises(ModelError) as caught:
        load_text(text)
    where = text.splitlines().index(f"  bottom: {entry}") + line
    assert caught.value.diagnostics[0].line == where
    assert said in str(caught.value)


def test_formulas_of_events_may_use_outputs_inputs_and_reactions_of_outputs() -> None:
    text = """model: block
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
inputs: {F: {unit: N}}
forces: {x: F}
outputs: {twice: 2*x, rate: der(x)}
events: {a: twice*rate - F*1 m^2/(1 N*s), b: {formula: t - 1 s, direction: both}}
"""
    mechanics = system(load_text(text))
    assert [name for name, _ in mechanics.events] == ["a", "b"]
    assert [event.direction for event in mechanics.model.events] == [0, 0]


@pytest.mark.slow
def test_a_planted_error_in_an_event_is_seen_by_verify(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import derive.mechanics.system as assembly

    right = assembly.events
    assert hamel.verify("stopped_pendulum.yaml", states=5).passed
    monkeypatch.setattr(
        assembly, "events", lambda *given: tuple((n, 1.001 * v) for n, v in right(*given))
    )
    wrong = hamel.verify("stopped_pendulum.yaml", states=5)
    red = [line.name for line in wrong.checks if not line.passed]
    assert not wrong.passed and all("events" in name for name in red)


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_section_lies_in_its_plane_at_one_energy(tmp_path: Path) -> None:
    poincare = example("poincare_section")
    module = poincare.built(tmp_path)
    x = poincare.starts(module, 8.0, 5)
    motions = module.simulate((0.0, 20.0), x, rtol=1e-10, atol=1e-12)
    events = motions.events.of("section")
    assert len(events.t) > 20
    assert np.abs(np.sin(events.x[:, 1])).max() < 1e-13
    total = module.energy(0.0, events.x)
    total = total[:, 0] + total[:, 1]
    np.testing.assert_allclose(total, total[0], atol=1e-7)
    rates = module.dynamics(0.0, events.x, [0.0])[:, 1] * np.cos(events.x[:, 1])
    assert (rates > 0).all()
    assert sum(map(len, poincare.section(module, x, 20.0))) == len(events.t)


def test_bounces_follow_the_energy_between_stops(tmp_path: Path) -> None:
    """From stop to stop the energy is kept; at one the speed falls to 0.7 of it."""
    stops = example("joint_stops")
    found = stops.bounces(stops.built(tmp_path), np.array([np.pi / 3, 0.0]), 8.0)
    assert len(found) >= 4
    t, speed = map(np.array, zip(*found))
    assert (np.diff(t) > 0).all()
    np.testing.assert_allclose(speed[1:] / speed[:-1], 0.7, atol=1e-8)
