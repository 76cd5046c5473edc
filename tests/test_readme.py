"""The README is executed: its model is built by its command and driven by its control loop, its
tables are true."""

import contextlib
import os
import re
import shlex
from pathlib import Path

import pytest

from hamel import failures
from hamel.cli import group, main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def sled(tmp_path_factory):
    """The folder after the README's model was saved and its build command was run."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "sled.yaml").write_text(blocks("yaml")[0])
    command = next(block for block in blocks("sh") if block.startswith("hamel build"))
    with contextlib.chdir(folder), pytest.raises(SystemExit) as ended:
        main(command.split()[1:])
    assert ended.value.code == 0
    return folder


def test_the_model_is_short():
    assert len(blocks("yaml")[0].splitlines()) <= 21
    assert len(blocks("python")[0].splitlines()) <= 11


def test_the_control_loop_reaches_its_heading(sled, monkeypatch):
    monkeypatch.syspath_prepend(sled / "generated")
    names: dict = {}
    exec(blocks("python")[0], names)
    motions = names["motions"]
    assert names["sled"].states == ("x", "y", "heading", "speed", "spin")
    assert motions.x.shape == (16, 2, 5) and not motions.status.any()
    heading, speed, _ = motions.x[:, -1, 2:].T
    assert heading == pytest.approx(1.0, abs=1e-3)
    assert speed == pytest.approx(1.5 / 2, rel=1e-2)  # push against snow
    assert motions.u[:, -1, 0] == pytest.approx(1.5)


def test_the_mistake_is_answered_as_shown(sled, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    Path("sled.yaml").write_text(
        (sled / "sled.yaml").read_text().replace("velocity: base.w}", "velocity: base.omega}")
    )
    command, said = blocks("console")[0].split("\n", 1)
    with pytest.raises(SystemExit):
        main(command.split()[2:])
    assert capsys.readouterr().err == said


def test_every_verb_and_exit_code_is_in_the_tables():
    verbs = set(re.findall(r"^\| `hamel (\w+)", README, re.MULTILINE))
    assert verbs == set(group.commands)
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", README, re.MULTILINE)}
    assert codes >= {
        0,
        1,
        2,
        3,
        failures.VERIFICATION,
        failures.USAGE,
        failures.INTERNAL,
        failures.INTERRUPTED,
    }


def test_make_targets_and_pictures_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make ([\w-]+)", README, re.MULTILINE):
        assert f"\n{target}:" in makefile
    for path in re.findall(r"\]\(([^)#:]+)\)", README):
        assert os.path.exists(ROOT / path), path


def test_the_sweep_runs_as_shown(sled, monkeypatch):
    """With fewer samples than shown."""
    pytest.importorskip("pyarrow")
    command = next(block for block in blocks("sh") if block.startswith("hamel sweep"))
    words = shlex.split(command.replace("--samples 1000", "--samples 20"))
    monkeypatch.chdir(sled)
    with pytest.raises(SystemExit) as ended:
        main(words[1:])
    assert ended.value.code == 0 and Path("study/sweep.html").is_file()
