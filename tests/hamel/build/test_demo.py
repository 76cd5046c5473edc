"""The modules committed under generated/ are what the generator makes today, byte for byte."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FRESH = ("snake3", "four_bar")


def texts(folder: Path) -> dict[str, str]:
    """Relative path → text of all that is not compiled."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {
        str(f.relative_to(folder)): f.read_text("utf-8")
        for f in files
        if f.suffix != ".so" and f.name != "binaries.json" and "__pycache__" not in f.parts
    }


@pytest.mark.parametrize("name", FRESH)
@pytest.mark.parametrize("seed", ["0", "4711"])
def test_generated_is_fresh_whatever_the_hash_seed(tmp_path, name, seed):
    command = [
        sys.executable,
        "-m",
        "hamel",
        "build",
        f"models/{name}.yaml",
        "--numpy",
        "-o",
        str(tmp_path / name),
    ]
    subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "PYTHONHASHSEED": seed},
        check=True,
        capture_output=True,
    )
    made, committed = (
        _without_margins(texts(place)) for place in (tmp_path / name, ROOT / "generated" / name)
    )
    assert sorted(made) == sorted(committed), "run `make fresh`"
    stale = [path for path in made if made[path] != committed[path]]
    assert not stale, "run `make fresh`"


def _without_margins(found):
    """How far below its tolerance a check stays may depend on how a processor rounds; that is no
    text of the generator's."""
    margins = re.compile(r' *"(margin|verification\.json|seal)": .*\n')
    return {
        path: margins.sub("", text) if path.endswith(".json") else text
        for path, text in found.items()
    }


@pytest.mark.parametrize("name", FRESH)
def test_generated_names_no_machine(name):
    said = "\n".join(texts(ROOT / "generated" / name).values())
    assert str(ROOT) not in said and "/home/" not in said
