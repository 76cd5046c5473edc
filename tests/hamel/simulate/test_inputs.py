"""`hamel simulate --input`: tables from files and arrays, functions, other starts; every mistake
with its cause and line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError
from hamel.cli import main

FOUR_BAR = Path(__file__).parents[3] / "models" / "four_bar.yaml"
ROWS = "time,torque\n0,0\n# the push\n0.5,1\n\n1,0.2\n2,0\n"
HINGE = """model: hinge
coordinates: {q: rad}
parameters: {J: 2 kg*m^2}
kinetic: J*der(q)^2/2
inputs: {tau: {unit: N*m}}
forces: {q: tau}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("hinge.yaml").write_text(HINGE)
    Path("torque.csv").write_text(ROWS)
    return tmp_path


def test_a_file_drives_the_motion_and_is_among_the_columns(folder: Path) -> None:
    found = hamel.simulate("hinge.yaml", inputs={"tau": "torque.csv"}, time=2.0, step=0.25)
    t = found.motion["t"]
    torque = np.interp(t, [0, 0.5, 1, 2], [0, 1, 0.2, 0])
    np.testing.assert_allclose(found.motion["tau"], torque, atol=1e-15)
    impulse = (0.5 * 1 + 0.5 * 1.2 + 0.2) / 2
    assert found.final["der(q)"] == pytest.approx(impulse / 2.0, rel=1e-12)
    assert found.final["work"] == pytest.approx(found.final["der(q)"] ** 2, rel=1e-9)
    held = hamel.simulate("hinge.yaml", inputs={"tau": "torque.csv:hold"}, time=3.0)
    assert held.final["der(q)"] == pytest.approx((0.5 * 1 + 0.2) / 2, rel=1e-12)
    again = ([0.0, 0.5, 1.0, 2.0], [0.0, 1.0, 0.2, 0.0], "linear")
    same = hamel.simulate("hinge.yaml", inputs={"tau": again}, time=2.0)
    assert same.final["q"] == pytest.approx(found.final["q"], rel=1e-12)


def test_a_function_at_sample_times_and_another_start(folder: Path) -> None:
    times: list[float] = []

    def control(t: float, x: np.ndarray) -> list[float]:
        times.append(t)
        return [2.0]

    found = hamel.simulate("hinge.yaml", inputs=control, sample=0.5, start=3.0, time=5.0)
    assert times == [3.0, 3.5, 4.0, 4.5]
    assert found.motion["t"][0] == 3.0 and found.time == 5.0 and found.lasts == "3 s to 5 s"
    assert found.final["q"] == pytest.approx(2.0, rel=1e-12)


def test_a_prescribed_motion_starts_consistent_at_its_start(folder: Path) -> None:
    text = (
        "model: led\ncoordinates: {x: m, y: m}\nkinetic: 1 kg*(der(x)^2 + der(y)^2)\n"
        "constraints: {c: {type: prescribed, coordinate: x, motion: 1 m*sin(t*1 rad/s)}}\n"
    )
    Path("led.yaml").write_text(text)
    found = hamel.simulate("led.yaml", start=1.0, time=2.0)
    np.testing.assert_allclose(found.motion["x"], np.sin(found.motion["t"]), atol=1e-9)
    np.testing.assert_allclose(found.motion["der(x)"], np.cos(found.motion["t"]), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ("0,0\n0.5,\n1,2\n", ":2:4", "a gap: no value"),
        ("t,u\n0,0\n0.5,nan\n1,2\n", ":3:5", "value nan is not finite"),
        ("0 0\n0.5 1\n0.5 2\n", ":3:1", "time 0.5 does not come after 0.5"),
        ("0;0\n1;one\n", ":2:3", "value 'one' is no number"),
        ("0,0,1\n", ":1:1", "3 columns in the table of 'tau'"),
        ("t,u\n0,0\n", "", "linear needs at least 2 rows, there are 1"),
        ("0,0\n1,1\n", "", "ends at t = 1, the motion at t = 2"),
    ],
)
def test_a_bad_table_is_told_with_its_line(
    folder: Path, text: str, place: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("bad.csv").write_text(text)
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "hinge.yaml", "--input", "tau=bad.csv", "--time", "2", "-o", "m.csv"])
    assert ended.value.code == 1
    error = capsys.readouterr().err
    assert said in error and (not place or error.startswith(f"bad.csv{place}: error:"))
    assert not Path("m.csv").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"inputs": {"tua": "torque.csv"}}, "'tua' is no input of hinge; did you mean 'tau'"),
        ({"inputs": {"tau": "torque.csv:qubic"}}, "did you mean 'cubic'"),
        ({"inputs": {"tau": "none.csv"}}, "there is no file none.csv"),
        ({"inputs": {"tau": "torque.csv"}, "values": {"tau": 1}}, "one of the two"),
        ({"inputs": {"tau": "torque.csv"}, "integrator": "scipy_dop853"}, "constant inputs"),
        ({"inputs": {"tau": 3.0}}, "given as float"),
        ({"sample": 0.1}, "for inputs that are a function"),
        ({"inputs": lambda t, x: [0.0], "integrator": "rosenbrock"}, "sample times, or use radau"),
        ({"start": 2.0}, "not after the start"),
        ({"start": np.nan}, "not a finite number"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_makes_no_sense_is_refused(folder: Path, options: dict[str, Any], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        hamel.simulate("hinge.yaml", **{"time": 2.0, **options})


def test_a_function_that_fails_ends_the_motion_with_its_cause(folder: Path) -> None:
    def lost(t: float, x: np.ndarray) -> list[float]:
        raise KeyError("sensor")

    with pytest.raises(AssumptionError, match=r"an input could not be had.*sensor") as caught:
        hamel.simulate("hinge.yaml", inputs=lost, sample=0.1, time=1.0)
    assert isinstance(caught.value.__cause__, KeyError)


def test_energy_is_not_held_where_a_table_does_work() -> None:
    snake = FOUR_BAR.parent / "snake3.yaml"
    with pytest.raises(HamelError, match="energy is not conserved"):
        table = ([0.0, 1.0], [0.0, 0.01])
        hamel.simulate(snake, enforcement="invariants", time=0.5, inputs={"tau1": table})
