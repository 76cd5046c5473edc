"""hamel sweep: the motions are those of `simulate`, the bytes those of any engine, nothing is made
twice, and what is wrong is said.

Of hamel: columns, optional.
Of hamel.sweep: artefact, axes, chunk, drive, folder, job, kept, limits, linear, modes, page, places,
plan, result, summary, work.
Of hamel.verbs: sweep.
"""

from __future__ import annotations

import dataclasses
import json
import shlex
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc

import hamel
from codegen import compiler
from codegen.runtime.simulation import Status
from derive.diagnostics import (
    AssumptionError,
    HamelError,
    ModelError,
    ToolchainError,
    VerificationError,
)
from hamel.engines import Engine
from hamel.records import Swept
from hamel.sweep import artefact, axes, chunk, drive, modes, places, plan, work
from hamel.sweep.axes import Sampling, design
from hamel.sweep.folder import Folder
from hamel.sweep.job import Modes
from hamel.sweep.plan import Asked, planned
from hamel.sweep.summary import Growing, of_json, summary, together

ROD = """
model: rod
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 1 kg, l: 1 m, c: 0.1 N*m*s/rad}
bodies: {rod: {mass: m, com: [0, -l/2], inertia: m*l**2/12}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q, damper: c}}
inputs: {tau: {joint: hinge}}
outputs: {tip: "position(rod, [0, -l])"}
events: {low: {formula: q, direction: falling}}
steady_motion: {hanging: {q: 0}}
initial: {q: 30 deg, der(q): 0 rad/s}
"""
ASKED: dict[str, Any] = {
    "vary": {"q": "normal(20 deg, 5 deg)", "l": "0.8:1.2:3"},
    "keep": ["tip.x", "reach = highest(tip.x)", "balance", "count(low)", "at(q, 0.25)", "der(q)"],
    "samples": 40,
    "time": 1.0,
    "chunk": 16,
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "rod.yaml").write_text(ROD)
    return folder


@pytest.fixture(scope="module")
def record(place: Path) -> Swept:
    return hamel.sweep(place / "rod.yaml", out=place / "here", **ASKED)


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_motions_are_those_of_simulate(record: Swept, place: Path) -> None:
    """The command that a page gives for its extreme motions gives these values again."""
    assert record.motions == 120 and not record.failed and record.chunks == 8
    kept = {each.name: each for each in record.kept}
    value, number = kept["tip.x"].highest[0]
    words = shlex.split(record.commands[str(number)])
    sets = dict(word[6:].split("=", 1) for word in words if word.startswith("--set="))
    again = hamel.simulate(place / "rod.yaml", time=1.0, rtol=1e-9, values=sets)
    assert again.final["tip[0]"] == pytest.approx(value, abs=1e-9)
    assert kept["reach"].unit == "m" and kept["der(q)"].unit == "rad/s"
    assert max(abs(x) for x, _ in kept["balance"].highest) < 1e-6


def test_a_stopped_motion_is_that_of_simulate(tmp_path: Path) -> None:
    """Its work and the balance are those up to the event."""
    low, stop = "{low: {formula: q,", "{stop: {stop: true, formula: q + 10 deg,"
    (tmp_path / "stopped.yaml").write_text(ROD.replace(low, stop))
    given: dict[str, Any] = {"time": 2.0, "rtol": 1e-9}
    keep = ["w = work", "T", "end", "balance", "at(q, 0.2)", "at(q, 1.9)"]
    found = hamel.sweep(
        tmp_path / "stopped.yaml", vary={"c": [0.1, 0.2]}, keep=keep, out=tmp_path / "out", **given
    ).to_xarray()
    motion = hamel.simulate(tmp_path / "stopped.yaml", values={"c": 0.2}, **given).motion
    assert motion["work"][-1] < -0.05
    for name, column in (("w", "work"), ("T", "T"), ("end", "t")):
        assert float(found[name][1]) == pytest.approx(motion[column][-1], abs=1e-8)
    assert float(abs(found["balance"]).max()) < 1e-9
    assert bool(np.isfinite(found["at(q, 0.2)"]).all()), "before the end"
    assert bool(np.isnan(found["at(q, 1.9)"]).all()), "behind it"


def test_a_dataset_has_coordinates_and_units(record: Swept) -> None:
    found = record.to_xarray()
    assert found.sizes == {"l": 3, "sample": 40}
    assert found["tip.x"].attrs["units"] == "m" and found["l"].attrs["units"] == "m"
    assert found["l"].values.tolist() == [0.8, 1.0, 1.2]
    assert np.rad2deg(found["q"].values).mean() == pytest.approx(20.0, abs=3.0)
    assert (found["status"].values == 0).all()
    # the same samples at every place of the grid
    assert (found["q"].values[0] == found["q"].values[2]).all()


def test_what_is_finished_is_not_made_again(record: Swept, place: Path) -> None:
    before = files(place / "here")
    (place / "here" / "chunks" / "000000003.parquet").unlink()
    again = hamel.sweep(place / "rod.yaml", out=place / "here", **ASKED)
    assert again.made == 1 and files(place / "here") == before


@pytest.mark.parametrize("kept", [0.0, 0.5])
def test_a_damaged_file_is_named(record: Swept, place: Path, kept: float) -> None:
    damaged = place / "here" / "chunks" / "000000003.parquet"
    content = damaged.read_bytes()
    damaged.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ToolchainError, match=r"chunks/000000003\.parquet is damaged") as told:
        hamel.sweep(place / "rod.yaml", out=place / "here", **ASKED)
    assert "remove it" in str(told.value)
    damaged.unlink()
    hamel.sweep(place / "rod.yaml", out=place / "here", **ASKED)
    assert damaged.read_bytes() == content


def test_what_a_killed_process_left_is_removed(record: Swept, place: Path) -> None:
    half = place / "here" / "chunks" / f".000000009.parquet.{2**22 + 1}"
    half.write_bytes(b"half")
    hamel.sweep(place / "rod.yaml", out=place / "here", **ASKED)
    assert not half.exists()


def test_another_sweep_does_not_go_on_in_the_folder(record: Swept, place: Path) -> None:
    with pytest.raises(ToolchainError, match=r"holds another sweep: its 'vary' \(seed\) differs"):
        hamel.sweep(place / "rod.yaml", out=place / "here", **{**ASKED, "seed": 1})


def test_bytes_do_not_depend_on_who_is_ready_first_or_ends(record: Swept, place: Path) -> None:
    """An engine that answers late, loses work, and forgets jobs."""
    of = planned(place / "rod.yaml", asked())
    folder = Folder(str(place / "late"), True)
    folder.enter(dict(of.about))
    late = Late()
    made = drive.driven(of, Engine(late, lambda: 3, "late", False), folder, 0)
    assert made.lost == late.lost > 2 and made.chunks == of.chunks
    for name, content in files(place / "late").items():
        assert content == (place / "here" / name).read_bytes()


def asked(**more: Any) -> Asked:
    """ASKED as the verb has it."""
    from hamel.simulate.compiled import Rows
    from hamel.simulate.method import Method

    usual = Asked(
        ASKED["vary"],
        (),
        tuple(ASKED["keep"]),
        Sampling(40, "random", 0),
        Method("quasi_velocities", None, None, "dop853", None, 1e-9, None),
        Rows(1.0),
        chunk=16,
    )
    return dataclasses.replace(usual, **more)


class Late:
    """Answers when it is looked at, the last one first; every third task is lost at first."""

    def __init__(self) -> None:
        self.count = self.lost = 0

    def submit(self, function: Any, task: work.Task) -> Future[Any]:
        future: Future[Any] = Future()
        self.count += 1
        if self.count % 3 == 0:
            self.lost += 1
            future.set_exception(BrokenExecutor("killed"))
        elif self.count == 5:
            future.set_result(work.Answer(missing=True))
        else:
            future.set_result(function(task))
        return future


def test_without_rows_the_same_is_known_of_all(record: Swept, place: Path) -> None:
    less = hamel.sweep(place / "rod.yaml", out=place / "less", reduce=True, **ASKED)
    assert less.kept == record.kept and less.statuses == record.statuses
    assert sorted(files(place / "less")) == ["groups/000000000.json", "sweep.html", "sweep.json"]
    with pytest.raises(ToolchainError, match="kept no rows"):
        less.to_xarray()


def test_summaries_merge_into_that_of_all() -> None:
    x = np.random.default_rng(0).standard_normal(10_000) * 3 - 1
    parts = [summary(part, k * 100) for k, part in enumerate(np.split(x, 100))]
    growing = Growing()
    for part in parts:
        growing.add(of_json(json.loads(json.dumps(part.about()))))
    whole = growing.summary()
    assert whole.mean == pytest.approx(x.mean(), rel=1e-12)
    assert whole.variance == pytest.approx(x.var(ddof=1), rel=1e-12)
    assert whole.lowest[0] == (x.min(), int(x.argmin()))
    for part in (0.01, 0.3, 0.5, 0.99):
        wanted = np.quantile(x, part, method="inverted_cdf")
        assert abs(whole.quantile(part) - wanted) <= 0.005001 * abs(wanted)
    assert len(whole.bins.places) < 2500
    backwards = together([part.bins for part in parts[::-1]])
    assert (backwards.places == whole.bins.places).all() and backwards.level == whole.bins.level
    assert (backwards.counts == whole.bins.counts).all()


def test_quantiles_of_values_that_lie_closely() -> None:
    """0.6 m ± 0.2 mm: half a per cent of it would be 15 deviations."""
    x = 0.6 + 2e-4 * np.random.default_rng(1).standard_normal(100_000)
    growing = Growing()
    for k, part in enumerate(np.split(x, 100)):
        growing.add(summary(part, k * 1000))
    whole = growing.summary()
    for part in (0.001, 0.05, 0.5, 0.95, 0.999):
        assert whole.quantile(part) == pytest.approx(np.quantile(x, part), abs=0.02 * 2e-4)
    edges, counts = whole.histogram(60)
    assert len(edges) == 61 and sum(counts) == len(x) and max(counts) < 0.1 * len(x)
    assert np.abs(np.array(counts) - np.histogram(x, 60)[0]).max() < 0.01 * len(x)
    assert len(json.dumps(whole.about())) < 10_000


def test_samples_do_not_depend_on_how_they_are_cut() -> None:
    for kind in ("random", "sobol", "latin"):
        vary = {"a": "uniform(0, 1)", "b": "normal(0, 1)"}
        made = design(vary, (), Sampling(1000, kind, 7), lambda name, text: float(text))
        whole = made.values(0, 1000)
        part = made.values(300, 613)
        assert all((whole[name][300:613] == part[name]).all() for name in whole)
        assert abs(whole["a"].mean() - 0.5) < 0.03 and abs(whole["b"].std() - 1) < 0.1


def test_numbers_of_methods_come_in_ranges() -> None:
    vary = {"rtol": "1e-6:1e-10:5:log", "step_size": ["0.1", 0.2]}
    made = design(vary, (), Sampling(None, "random", 0), lambda name, text: 0.0)
    assert made.methods[0].values == pytest.approx((1e-6, 1e-7, 1e-8, 1e-9, 1e-10), rel=1e-12)
    assert made.methods[1].values == (0.1, 0.2)


@pytest.mark.parametrize("first", [0, 1, 777, 100_000])
def test_sobol_points_are_those_of_scipy(first: int) -> None:
    """And those far out come as fast as the first."""
    rng = np.random.default_rng(np.random.SeedSequence(3))
    points = qmc.Sobol(5, scramble=True, bits=64, rng=rng).random(2**17)[first : first + 100]
    assert np.abs(axes._sobol(3, 5, first, first + 100) - points).max() < 1e-15
    begin = time.process_time()
    far = axes._sobol(3, 5, 10**11, 10**11 + 1000)
    assert time.process_time() - begin < 0.5
    assert len(np.unique(far)) == far.size and abs(far.mean() - 0.5) < 0.01


def test_files_of_columns_vary_together(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("q, m\n0.1, 1\n0.2, 2\n")
    made = design({}, [str(tmp_path / "runs.csv")], Sampling(None, "random", 0), lambda n, t: 0.0)
    assert {n: c.tolist() for n, c in made.values(0, 2).items()} == {
        "q": [0.1, 0.2],
        "m": [1.0, 2.0],
    }
    named = design(
        {"l": f"{tmp_path / 'runs.csv'}:m"}, (), Sampling(None, "random", 0), lambda n, t: 0.0
    )
    assert named.values(0, 2)["l"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"vary": {"mass": "1:2:3"}}, "'mass' is to vary, but rod has no such value"),
        ({"vary": {"m": "gauss(1, 2)"}}, "'gauss' is no distribution"),
        ({"vary": {"m": "normal(1, 2"}}, "does not end with '\\)'"),
        ({"vary": {}, "files": ["m"]}, "'m' varies over nothing, and is no file"),
        ({"vary": {"m": "1:2:3"}, "scheduler": "no.json"}, "no scheduler has written no.json"),
        ({"vary": {"m": "normal(1 kg, 0 kg)"}}, "deviation is not above zero"),
        ({"vary": {"m": "loguniform(0, 1)"}}, "low is not above zero"),
        ({"vary": {"m": "1:2:x"}}, "with 'x' values"),
        ({"vary": {"m": "1:2:1000000000"}}, "at most 10,000,000 values of one name"),
        ({"vary": {"m": "1 s:2 s:3"}}, "no quantity in kg"),
        ({"vary": {"m": [1.0, 1e300]}}, "too large"),
        ({"vary": {"rtol": "1e-6, tight"}}, "'tight', which is no number"),
        ({"vary": {"m": "1:2:3"}, "keep": ["tip.z"]}, "unknown name 'tip.z'"),
        ({"vary": {"m": "1:2:3"}, "keep": ["q + m"]}, "add"),
        ({"vary": {"m": "1:2:3"}, "keep": ["count(high)"]}, "'high' is no event"),
        ({"vary": {"m": "1:2:3"}, "keep": ["at(q, 9)"]}, "outside the motion"),
        ({"vary": {"m": "1:2:3"}, "keep": ["q", "growth"]}, "steady motion"),
        ({"vary": {"m": "1:2:3"}, "values": {"m": 1.0}}, "'m' is set, and is to vary"),
        ({"vary": {"q": "normal(0, 1)"}, "design": "best"}, "unknown design 'best'"),
        ({"vary": {"integrator": "scipy_radau"}}, "one motion at a time"),
        ({"vary": {"m": "no.csv:m"}}, "no.csv cannot be read"),
        ({"vary": {"m": "1:2:3"}, "scheduler": "nowhere"}, "'nowhere' is no engine"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(
    more: dict[str, Any], message: str, place: Path
) -> None:
    with pytest.raises(HamelError, match=message.replace("(", r"\(")):
        hamel.sweep(place / "rod.yaml", **{"out": place / "wrong", "time": 1.0, **more})
    assert not (place / "wrong" / "chunks").exists()


def test_motions_that_cannot_be_are_counted(place: Path) -> None:
    """Up to a bound, and with their reasons; others go on."""
    model = "models/four_bar.yaml"
    given: dict[str, Any] = {"vary": {"l4": "0.55, 0.6, 5"}, "keep": ["q1"], "time": 0.2}
    with pytest.raises(AssumptionError, match=r"1 of 3 motions failed.*motion 2: .*assembled"):
        hamel.sweep(model, out=place / "few", **given)
    found = hamel.sweep(model, out=place / "few", failures=0.5, **given)
    assert found.failed == 1 and found.kept[0].count == 2 and "l4=5.0" in found.commands["2"]


@pytest.mark.parametrize("keep", ["q", "growth"])
@pytest.mark.parametrize("mass", ["normal(1 kg, 1 kg)", "-1 kg:3 kg:50"])
def test_negative_masses_are_counted(mass: str, keep: str, tmp_path: Path, place: Path) -> None:
    samples = 50 if "normal" in mass else None
    how: dict[str, Any] = {"keep": [keep], "samples": samples, "time": 0.1, "failures": 1.0}
    found = hamel.sweep(place / "rod.yaml", vary={"m": mass}, out=tmp_path / "masses", **how)
    assert 2 < found.failed < 20 and found.kept[0].count == 50 - found.failed
    assert found.statuses[chunk.cause(chunk.INADMISSIBLE)] == found.failed


def test_methods_vary_too(place: Path) -> None:
    found = hamel.sweep(
        place / "rod.yaml",
        vary={"integrator": "dop853, rk4", "step_size": [0.01], "q": "0.1:0.5:4"},
        keep=["q"],
        out=place / "methods",
        time=0.5,
    ).to_xarray()
    assert found["integrator"].values.tolist() == ["dop853", "rk4"]
    apart = np.abs(np.diff(found["final(q)"].values, axis=0)).max()
    assert 0 < apart < 1e-6


def test_eigenvalues_of_a_steady_motion(place: Path) -> None:
    """The rod hanging: λ² + c λ / J + g m l / (2 J) = 0 with J = m l²/3."""
    found = hamel.sweep(
        place / "rod.yaml",
        vary={"l": "0.5:2:7", "c": "0:1:5"},
        keep=["growth", "frequency"],
        out=place / "modes",
    ).to_xarray()
    l, c = np.meshgrid(found["l"], found["c"], indexing="ij")
    J = l**2 / 3
    roots = (-c / J + np.sqrt((c / J) ** 2 - 4 * 9.81 * l / 2 / J + 0j)) / 2
    assert np.abs(found["growth"] - roots.real).max() < 1e-9
    assert np.abs(found["frequency"] - np.abs(roots.imag)).max() < 1e-9


def test_sobol_indices(place: Path) -> None:
    """Without gravity's lever the height of the tip depends on q alone."""
    found = hamel.sweep(
        place / "rod.yaml",
        vary={"q": "uniform(0.1, 0.2)", "c": "uniform(0.1, 0.11)"},
        keep=["at(q, 0)", "same = 1e3 + 1e-10*q"],
        samples=256,
        design="saltelli",
        time=0.01,
        out=place / "indices",
    )
    indices = found.sensitivities["at(q, 0)"]
    assert indices["names"] == ["q", "c"]
    assert indices["total"][0] == pytest.approx(1.0, abs=0.05) and indices["total"][1] < 1e-6
    assert "same" not in found.sensitivities  # it varies by its last digits
    assert any("of same: it is the same in all motions, but for round" in x for x in found.notes)


def test_another_processor_compiles_and_one_without_a_compiler_says_so(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = planned(place / "rod.yaml", asked()).jobs[0]
    assert isinstance(job.work, chunk.Motions)
    sent = job.work.artefact
    module, note = artefact.unpacked(sent)
    assert module.backend == "extension" and not note
    bare = dataclasses.replace(sent, binaries={})
    module, note = artefact.unpacked(bare)
    assert module.backend != "numpy" and "compiled from its sources" in note
    monkeypatch.setattr(compiler, "find_compiler", lambda: None)
    module, note = artefact.unpacked(bare)
    assert module.backend == "numpy" and "no C compiler found" in note
    # a planted error: another value is stored, so that nothing here gives it
    text = json.loads(sent.texts["verification.json"])
    text["functions"]["dynamics"]["expected"][0][1] += 1e-3
    wrong = {**sent.texts, "verification.json": json.dumps(text)}
    with pytest.raises(VerificationError, match="does not give the stored values"):
        artefact.unpacked(dataclasses.replace(sent, texts=wrong))


def test_another_version_of_a_worker_is_told() -> None:
    with pytest.raises(ToolchainError, match="a worker has hamel"):
        work.work(work.Task("0.0.0", "job", 0))


def test_a_full_disk_ends_with_a_folder_to_go_on_from(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, count = Folder.write, [0]

    def full(self: Folder, name: str, content: bytes) -> None:
        count[0] += 1
        if count[0] >= 4:
            raise ToolchainError("cannot write: No space left on device")
        write(self, name, content)

    monkeypatch.setattr(Folder, "write", full)
    with pytest.raises(ToolchainError, match="No space left"):
        hamel.sweep(place / "rod.yaml", out=place / "full", **ASKED)
    monkeypatch.undo()
    again = hamel.sweep(place / "rod.yaml", out=place / "full", **ASKED)
    assert again.made == 6 and again.chunks == 8


def test_addresses_of_fsspec(place: Path, record: Swept) -> None:
    pytest.importorskip("fsspec")
    found = hamel.sweep(place / "rod.yaml", out="memory://hamel-test", **ASKED)
    assert found.kept == record.kept
    again = hamel.sweep(place / "rod.yaml", out="memory://hamel-test", **ASKED)
    assert again.made == 0


def test_command_line(place: Path, record: Swept) -> None:
    words = ["--vary", "q=0.1:0.2:3", "--keep", "q", "--time", "0.1", "-o", "cli", "--json"]
    made = subprocess.run(
        [sys.executable, "-m", "hamel", "sweep", "rod.yaml", *words],
        cwd=place,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(made.stdout)
    assert found["motions"] == 3 and (place / "cli" / "sweep.html").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["processes", "local"])
def test_bytes_do_not_depend_on_the_engine(name: str, record: Swept, place: Path) -> None:
    pytest.importorskip("distributed")
    hamel.sweep(place / "rod.yaml", out=place / name, scheduler=name, workers=2, **ASKED)
    assert files(place / name) == files(place / "here")


def test_values_that_differ_by_rounding_have_no_histogram() -> None:
    assert summary(np.array([1.0, 1.1]), 0).histogram(60)[1]
    assert not summary(np.array([1.0, 1.0 + 4e-16]), 0).histogram(60)[1]


def test_a_file_of_many_rows_is_not_laid_out_for_each_chunk(tmp_path: Path) -> None:
    """A million rows were turned into an array for every chunk: 50 ms each."""
    (tmp_path / "long.csv").write_text("q\n" + "\n".join(map(str, range(1_000_000))) + "\n")
    made = design({}, [str(tmp_path / "long.csv")], Sampling(None, "random", 0), lambda n, t: 0.0)
    begin = time.perf_counter()
    for first in range(0, 1_000_000, 50_000):
        assert made.values(first, first + 3)["q"].tolist() == [first, first + 1, first + 2]
    assert time.perf_counter() - begin < 0.2


@pytest.mark.slow
def test_many_points_of_a_map_go_by_compiled_code_and_give_the_same(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To rounding; and a planted error is seen before anything runs."""
    given: dict[str, Any] = {
        "vary": {"speed": "2:8:30", "c": "0.02:0.1:4"}, "keep": ["growth", "frequency"],
    }  # fmt: skip
    derived = hamel.sweep("models/bicycle.yaml", out=place / "derived", **given).to_xarray()
    monkeypatch.setattr(plan, "WORTH", 100)
    lanes = hamel.sweep("models/bicycle.yaml", out=place / "lanes", **given).to_xarray()
    assert np.abs(lanes["growth"] - derived["growth"]).max() < 1e-10
    assert np.abs(lanes["frequency"] - derived["frequency"]).max() < 1e-10
    asked_for = asked(
        vary=given["vary"], keep=given["keep"], chunk=None, sampling=Sampling(None, "random", 0)
    )
    job = planned("models/bicycle.yaml", asked_for).jobs[0].work
    assert isinstance(job, Modes) and job.artefact is not None
    text = json.loads(job.artefact.texts["verification.json"])
    text["functions"]["steady"]["expected"][0][-1] += 1e-3
    wrong = {**job.artefact.texts, "verification.json": json.dumps(text)}
    spoiled = dataclasses.replace(job.artefact, texts=wrong)
    with pytest.raises(VerificationError, match="does not give the stored values"):
        modes.ready(dataclasses.replace(job, artefact=spoiled))


def test_a_killed_process_between_a_group_and_its_chunks(place: Path) -> None:
    """The group's file is there, and some of its chunks are still: they go, and are not counted
    twice."""
    given = {**ASKED, "reduce": True}
    whole = hamel.sweep(place / "rod.yaml", out=place / "between", **given)
    (place / "between" / "chunks").mkdir(exist_ok=True)
    (place / "between" / "chunks" / "000000002.json").write_text("{}")
    again = hamel.sweep(place / "rod.yaml", out=place / "between", **given)
    assert again.made == 0 and again.kept == whole.kept
    assert not list((place / "between" / "chunks").iterdir())


def test_values_that_had_to_give_way_are_counted_with_rows_and_without(tmp_path: Path) -> None:
    """The coupler of a four-bar cannot have any angle beside a crank that is held."""
    given: dict[str, Any] = {
        "vary": {"q1": "0.5, 0.6, 0.7", "q2": "0.3"}, "keep": ["q1"], "time": 0.01,
    }  # fmt: skip
    rows = hamel.sweep("models/four_bar.yaml", out=tmp_path / "rows", **given)
    less = hamel.sweep("models/four_bar.yaml", out=tmp_path / "less", reduce=True, **given)
    assert rows.moved == less.moved == 3


DOME = """
model: dome_of_a_sweep
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {R: 0.7 m, m: 0.4 kg}
bodies: {p: {mass: m}}
joints: {fly: {type: point, parent: ground, child: p, coordinates: [x, y]}}
constraints: {dome: {holonomic: "sqrt(x^2 + y^2) - R"}}
outputs: {N: reaction.dome}
events: {off: {formula: N, direction: falling, stop: true}}
initial: {x: 0.07 m, guess: {y: 0.7 m}}
"""


@pytest.mark.slow
def test_a_start_that_is_not_possible_is_told_of_motions_that_an_event_stops(
    tmp_path: Path,
) -> None:
    """At 0.9 m there is no dome of 0.7 m: which row it is, and where it begins instead."""
    (tmp_path / "dome.yaml").write_text(DOME)
    given: dict[str, Any] = {"vary": {"x": "0.5, 0.9, 0.8"}, "keep": ["at(x, 0)"], "time": 1.0}
    rows = hamel.sweep(tmp_path / "dome.yaml", out=tmp_path / "rows", **given)
    less = hamel.sweep(tmp_path / "dome.yaml", out=tmp_path / "less", reduce=True, **given)
    assert rows.moved == less.moved == 2 and rows.moves == less.moves
    data = rows.to_xarray()
    assert data.moved.values.tolist() == [False, True, True]
    first = rows.moves[0]
    assert (first.motion, first.name, first.unit, first.given) == (1, "x", "m", 0.9)
    assert first.used == pytest.approx(float(data["at(x, 0)"][1]))
    text = (tmp_path / "rows" / "sweep.html").read_text()
    assert "2 motions begin elsewhere" in text and rows.commands["2"] in text.replace("&#39;", "'")


def test_places_that_are_no_folders(place: Path, record: Swept) -> None:
    """Reduced sweeps, too; a file:// address is a folder; half-written files do not count."""
    pytest.importorskip("fsspec")
    less = hamel.sweep(place / "rod.yaml", out="memory://hamel-less", reduce=True, **ASKED)
    assert less.kept == record.kept
    here = f"file://{place / 'by-address'}"
    hamel.sweep(place / "rod.yaml", out=here, **ASKED)
    rows = {name: c for name, c in files(place / "here").items() if name.startswith("chunks")}
    assert {n: c for n, c in files(place / "by-address").items() if n.startswith("chunks")} == rows


def test_a_place_that_shows_files_while_they_are_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """There they are moved to their names; what was left of a killed process is removed."""
    pytest.importorskip("fsspec")
    monkeypatch.setattr(places, "WHOLE", set[str]())
    there = places.place_of("memory://hamel-drafts")
    there.write("chunks/1", b"one")
    assert there.read("chunks/1") == b"one" and there.names("chunks") == ["1"]
    assert isinstance(there, places.Remote)
    there.files.pipe_file(f"{there.root}/chunks/.2.draft", b"half")
    there.sweep("chunks")
    assert there.names("chunks") == ["1"]


def test_a_place_that_does_not_answer_is_said_in_one_line() -> None:
    with pytest.raises(ToolchainError, match="cannot use nothing://x"):
        hamel.sweep("models/four_bar.yaml", vary={"m2": "1,2"}, time=0.01, out="nothing://x")


def test_sobol_indices_are_refused_where_they_cannot_be(place: Path) -> None:
    given: dict[str, Any] = {"keep": ["q"], "design": "saltelli", "time": 0.01, "samples": 8}
    drawn = {"q": "uniform(0.1, 0.2)", "c": "uniform(0.1, 0.11)"}
    out = place / "no-indices"
    with pytest.raises(ModelError, match="--reduce keeps none"):
        hamel.sweep(place / "rod.yaml", vary=drawn, out=out, reduce=True, **given)
    with pytest.raises(ModelError, match="grids, files or methods vary"):
        hamel.sweep(place / "rod.yaml", vary={**drawn, "l": "1,2"}, out=out, **given)
    given["keep"] = ["at(m, 0)"]
    found = hamel.sweep(place / "rod.yaml", vary=drawn, out=out, **given)
    assert found.notes == ("no Sobol indices of at(m, 0): it is the same in all motions",)


def test_commands_say_how_the_motion_was_made(place: Path) -> None:
    """All of the method; for eigenvalues the choice of quasi-velocities."""
    found = hamel.sweep(
        "models/bicycle.yaml", vary={"speed": "3,4"}, keep=["growth"], out=place / "choice",
        choice="rates",
    )  # fmt: skip
    assert "--choice=" in found.commands["0"]
    found = hamel.sweep(
        "models/four_bar.yaml", vary={"m2": "2,3"}, keep=["q1"], time=0.01, out=place / "alpha",
        enforcement="feedback", alpha=3.0, real="float32", rtol=1e-4, failures=1.0,
    )  # fmt: skip
    assert "--alpha=3.0" in found.commands["0"] and "--real=float32" in found.commands["0"]


CHARGED = """
model: charged
plane: xy
bodies: {a: {mass: 2 kg, inertia: 0.1}}
joints: {j: {type: revolute, parent: ground, child: a, coordinate: q}}
inputs: {V: {joint: j}}
states: {T: {rate: "(1 1/s)*(1 - T)"}}
"""


def test_first_order_states_without_parameters_and_names_that_energies_have(tmp_path: Path) -> None:
    """casadi takes a call without entries for one call; V and T are those of the model."""
    (tmp_path / "m.yaml").write_text(CHARGED)
    keep = ["q", "V", "T", "kinetic_energy"]
    given = {"vary": {"V": [0.0, 0.5, 1.0]}, "time": 1.0, "reduce": True}
    swept = hamel.sweep(tmp_path / "m.yaml", keep=keep, out=tmp_path / "s", **given)
    means = {column.name: column.mean for column in swept.kept}
    # q = V t²/2 I, T = 1 − e⁻ᵗ, kinetic energy (V t)²/2 I
    wanted = {"q": 2.5, "T": 1 - np.exp(-1.0), "kinetic_energy": 5 * (0 + 0.25 + 1) / 3}
    assert {name: means[name] for name in wanted} == pytest.approx(wanted, rel=1e-6)
    assert means["final(V)"] == pytest.approx(0.5)


def test_a_sweep_says_that_it_stays_in_one_choice():
    assert "a sweep stays in one: --choice names another" in chunk.cause(Status.SINGULAR_CHOICE)
