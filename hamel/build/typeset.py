"""LaTeX → PDF by pdflatex, where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from derive.diagnostics import ToolchainError
from hamel.build.files import staged_file
from hamel.build.limits import PATIENCE, RUNS
from hamel.build.scratch import scratch

COMMAND = "pdflatex"
# no shell, no file outside its folder: the text holds words of the user
SAFE = {"openin_any": "p", "openout_any": "p", "shell_escape": "f"}
FLAGS = ("-interaction=batchmode", "-halt-on-error", "-no-shell-escape")


def typeset(text: str, place: Path) -> None:
    """The article as a PDF at `place`. Raises ToolchainError where pdflatex is missing or stops."""
    command = shutil.which(COMMAND)
    if command is None:
        raise ToolchainError(
            f"cannot typeset {place}: {COMMAND} is not installed",
            hint="install a TeX distribution, or leave out --pdf and typeset derivation.tex later",
        )
    with staged_file(place) as draft, scratch(draft.parent) as folder:
        (folder / "article.tex").write_text(text, encoding="utf-8")
        for _ in range(RUNS):
            _run([command, *FLAGS, "article.tex"], folder, place)
        (folder / "article.pdf").replace(draft)


def _run(command: list[str], folder: Path, place: Path) -> None:
    # the same bytes from the same text: no date of today
    surroundings = os.environ | SAFE | {"SOURCE_DATE_EPOCH": "0", "FORCE_SOURCE_DATE": "1"}
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=surroundings,
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ToolchainError(f"cannot typeset {place}: {COMMAND} does not end") from error
    if done.returncode:
        log = (folder / "article.log").read_text("latin-1")
        problem = next((x for x in log.splitlines() if x.startswith("!")), "see its log")
        raise ToolchainError(
            f"cannot typeset {place}: {problem.removeprefix('! ')}",
            hint="amsmath, mathtools (empheq) and tikz are needed",
        )
