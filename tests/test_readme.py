"""The README and the page of the commands are true: the README's model is built by its command and
driven by its control loop, the tables have every verb and exit code, the picture is what hamel makes.
"""

import contextlib
import os
import re
from pathlib import Path

import pytest

import hamel
from hamel import failures
from hamel.cli import group, main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
LINES = 120  # of the README: what is read in two minutes


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


def test_every_verb_and_exit_code_is_in_the_tables():
    verbs = set(re.findall(r"^\| `hamel (\w+)", COMMANDS, re.MULTILINE))
    assert verbs == set(group.commands)
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", COMMANDS, re.MULTILINE)}
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


def test_the_readme_is_short():
    assert len(README.splitlines()) <= LINES


def test_the_moving_picture_is_what_hamel_makes(tmp_path):
    """A turn of the crank, with the same bytes."""
    hamel.simulate(
        ROOT / "models/four_bar.yaml", time=0.7493203, step=0.002, view=tmp_path / "moving.svg"
    )
    made = (tmp_path / "moving.svg").read_text("utf-8")
    assert made == (ROOT / "docs/four-bar-moving.svg").read_text("utf-8")
