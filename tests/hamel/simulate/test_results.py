"""What comes out of a motion: data frames and data sets with units, Parquet, the plot in a notebook;
what shares an axis; and what is said where an optional library is missing.

Of hamel.simulate: measures.
"""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import hamel
from derive.diagnostics import ToolchainError
from hamel.records import Simulated
from hamel.simulate.figure import alike
from hamel.verbs.simulate import show

FOUR_BAR = Path(__file__).parents[3] / "models" / "four_bar.yaml"


@pytest.fixture(scope="module")
def record() -> Simulated:
    return hamel.simulate(FOUR_BAR, time=1.0, inputs={"tau": ([0.0, 1.0], [0.0, 0.2])})


def test_a_frame_has_the_columns_over_t_and_their_units(record: Simulated) -> None:
    pytest.importorskip("pandas")
    frame = record.to_pandas()
    assert frame.index.name == "t" and list(frame.columns) == [n for n in record.motion if n != "t"]
    assert np.array_equal(frame["q1"].to_numpy(), record.motion["q1"])
    assert frame.attrs["units"]["tau"] == "N*m" and frame.attrs["model"] == "four_bar"


def test_a_data_set_has_a_unit_on_every_variable(record: Simulated) -> None:
    pytest.importorskip("xarray")
    data = record.to_xarray()
    assert data["q1"].dims == ("t",) and data["q1"].attrs["units"] == "rad"
    assert data["t"].attrs["units"] == "s" and data.attrs["integrator"] == "dop853"
    assert np.array_equal(data["tip[1]"].values, record.motion["tip[1]"])


def test_parquet_holds_every_digit_and_the_units(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    found = hamel.simulate(FOUR_BAR, time=0.5, out=tmp_path / "m.parquet")
    table = parquet.read_table(tmp_path / "m.parquet")
    assert table.column_names == list(found.motion)
    assert np.array_equal(table["q1"].to_numpy(), found.motion["q1"])
    assert table.schema.field("q1").metadata[b"unit"] == b"rad"


@pytest.mark.parametrize(("call", "library"), [("to_pandas", "pandas"), ("to_xarray", "xarray")])
def test_a_missing_library_is_told_with_what_to_do(
    record: Simulated, call: str, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ToolchainError, match=rf"{call}\(\) needs {library}") as caught:
        getattr(record, call)()
    assert "pip install 'hamel[data]'" in str(caught.value)


def test_a_missing_library_is_told_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ToolchainError, match="needs pyarrow"):
        hamel.simulate("no such model.yaml", out=tmp_path / "m.parquet")
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_the_plot(record: Simulated) -> None:
    page = record._repr_html_()
    figure = page[page.index("<svg") : page.index("</svg>") + 6]
    words = ["".join(x.itertext()) for x in ET.fromstring(figure).iter() if x.tag.endswith("text")]
    assert "coordinates (rad)" in words and "t (s)" in words and "inputs (N*m)" in words
    assert page == record._repr_html_() and "four_bar" in page


def test_every_axis_has_a_unit(record: Simulated) -> None:
    figure = record.figure
    assert figure is not None
    words = [
        "".join(x.itertext()) for x in ET.fromstring(figure()).iter() if x.tag.endswith("text")
    ]
    about = [
        word for word in words if re.match(r"coord|quasi|inputs|outputs|energy \(|violation", word)
    ]
    assert len(about) >= 5 and all(re.search(r"\((\S.*)\)$", word) for word in about)


def test_angles_of_many_turns_and_small_ones_share_no_axis() -> None:
    t = np.linspace(0.0, 1.0, 11)
    curves = {"small": 0.1 * t, "wheel": 400 * t, "turn": 7.0 * t, "large": 2.0 * t, "none": 0 * t}
    groups = [set(group) for group in alike(curves, "rad")]
    assert groups == [{"small", "none"}, {"wheel"}, {"turn"}, {"large"}]
    near = {"a": 1.0 * t, "b": 0.2 * t, "far": 30.0 * t}
    assert [set(group) for group in alike(near, "m")] == [{"a", "b"}, {"far"}]
    assert [*alike({"a": t, "b": 2 * t}, "m")[0]] == ["a", "b"]


OWN_NAMES = """
model: own_names
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {a: {mass: 2 kg}, b: {mass: 1 kg}}
joints:
  j: {type: prismatic, parent: ground, child: a, axis: x, coordinate: T}
  k: {type: prismatic, parent: a, child: b, axis: y, coordinate: V}
inputs: {work: {joint: j}}
outputs: {position_violation: 3*T}
initial: {T: 1 m, der(V): 1 m/s}
"""


def test_a_name_of_the_model_is_not_taken_by_an_energy(tmp_path: Path) -> None:
    """T and V are natural names: a tension, a voltage. Seen: both columns held energies."""
    (tmp_path / "m.yaml").write_text(OWN_NAMES)
    found = hamel.simulate(tmp_path / "m.yaml", time=1.0, step=0.5, values={"work": 2.0})
    t = found.motion["t"]
    assert found.motion["V"] == pytest.approx(t - 9.81 * t**2 / 2, abs=1e-9)
    assert found.motion["T"] == pytest.approx(1 + 2.0 / 3 * t**2 / 2, abs=1e-9)
    assert list(found.motion["work"]) == [2.0] * 3
    assert found.motion["position_violation"] == pytest.approx(3 * found.motion["T"])
    total = found.motion["kinetic_energy"] + found.motion["potential_energy"]
    assert total - total[0] == pytest.approx(found.motion["work_done"], abs=1e-9)
    assert found.measures["T"] is found.motion["kinetic_energy"] and found.energy_balance < 1e-12


def test_a_speed_with_the_name_of_an_output_stands_beside_it(tmp_path: Path) -> None:
    """w1 and q_dot are what quasi-velocities are called by themselves."""
    outputs = "outputs: {q_dot: 100*V, w1: 5*V, V_dot: 2*V}\n"
    choices = "quasi_velocities: {a: auto, o: orthonormal, own: {w1: der(T), r: der(V)}}\n"
    text = OWN_NAMES.replace("outputs: {position_violation: 3*T}\n", outputs + choices)
    (tmp_path / "m.yaml").write_text(text)
    for choice in ("a", "o", "own"):
        found = hamel.simulate(tmp_path / "m.yaml", time=1.0, step=0.5, choice=choice)
        assert found.motion["V_dot"] == pytest.approx(2 * found.motion["V"])
        assert found.motion["w1"] == pytest.approx(5 * found.motion["V"])
        assert "w1_w" in found.motion  # `auto` takes the rows that are declared
    assert list(found.motion["w1_w"]) == [0.0] * 3
    (tmp_path / "m.yaml").write_text(text.replace(choices, ""))
    assert "V_dot_w" in hamel.simulate(tmp_path / "m.yaml", time=1.0).motion
    plain = hamel.simulate(tmp_path / "m.yaml", time=1.0, step=0.5, formulation="augmented")
    assert not [name for name in plain.motion if name.endswith(")_w")]


@pytest.mark.parametrize(("count", "said"), [(0, ""), (1, "1 position where"), (4, "4 positions")])
def test_what_was_crossed_need_not_be_a_singular_position(
    record: Simulated, count: int, said: str
) -> None:
    """A pivot of the choice may vanish where the constraints keep their rank."""
    console = Console(width=200)
    with console.capture() as text:
        show(replace(record, crossings=count), console)
    assert (said in text.get()) and ("crossed" in text.get()) == bool(count)
    assert "singular" not in text.get()
