"""The code of a page is run as a reader would: its blocks from top to bottom, in one folder.

* a `yaml` block that begins with `model: NAME` is saved as NAME.yaml;
* a `python` block that begins with `# NAME.py` or `# FOLDER/NAME.py` is saved there, others are one
  program, run when the page ends with `generated` on the path;
* an `sh` block is run line by line, and each line must end with code 0;
* a `console` block is run, and must say what the page shows; `…` stands for anything.

The folder has the models and the examples of the repository in it. What a page takes from another
file by `{include}` belongs to it. `python docs/execution.py PAGE FOLDER` runs one page.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# pages whose code is complete; what the others show is held by tests (tests/test_docs.py)
EXECUTED = (
    "tutorials/sled.md",
    "tutorials/four_bar.md",
    "bicycle.md",
    "book.md",
    "figures.md",
    "motions.md",
)
FENCE = re.compile(r"^```(yaml|python|sh|console)\n(.*?)^```", re.DOTALL | re.MULTILINE)
INCLUDE = re.compile(r"^```\{include\} (\S+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
OPTION = re.compile(r"^:(start-after|end-before): (.*)$", re.MULTILINE)
PATIENCE = 600  # seconds for one command


class Wrong(Exception):
    """What a page shows is not so."""


def failure(page: Path, folder: Path) -> str:
    """Why the page cannot be run as it stands, or nothing."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("models", "examples"):
        shutil.copytree(ROOT / name, folder / name)
    try:
        _run(_whole(page), folder)
    except Wrong as wrong:
        return str(wrong)
    return ""


def _whole(page: Path) -> str:
    """The text of the page with what it includes."""

    def included(match: re.Match[str]) -> str:
        text = (page.parent / match[1]).read_text("utf-8")
        options = dict(OPTION.findall(match[2]))
        text = text.partition(options.get("start-after", ""))[2] if options else text
        return text.partition(options["end-before"])[0] if "end-before" in options else text

    return INCLUDE.sub(included, page.read_text("utf-8"))


def _run(text: str, folder: Path) -> None:
    program = ""
    for language, block in FENCE.findall(text):
        first = block.partition("\n")[0]
        if language == "yaml" and first.startswith("model: "):
            (folder / f"{first.split()[1]}.yaml").write_text(block, "utf-8")
        elif language == "python" and re.fullmatch(r"# (\w+/)?\w+\.py", first):
            (folder / first.removeprefix("# ")).write_text(block, "utf-8")
        elif language == "python":
            program += block
        elif language == "sh":
            for line in block.splitlines():
                _command(line, folder)
        elif language == "console":
            _session(block, folder)
    if program:
        _checked([sys.executable, "-c", program], folder, "its program", [folder / "generated"])


def _command(line: str, folder: Path) -> None:
    words = shlex.split(line, comments=True)
    if words:
        _checked(_argv(words), folder, line)


def _argv(words: list[str]) -> list[str]:
    own = {"hamel": [sys.executable, "-m", "hamel"], "python": [sys.executable]}
    return [*own.get(words[0], words[:1]), *words[1:]]


def _checked(argv: list[str], folder: Path, line: str, further: Sequence[Path] = ()) -> None:
    done = _done(argv, folder, further)
    if done.returncode:
        raise Wrong(f"'{line}' ends with code {done.returncode}\n{done.stdout}")


def _done(
    argv: list[str], folder: Path, further: Sequence[Path] = ()
) -> subprocess.CompletedProcess[str]:
    """With the package on the path, and nothing else that a reader has not put there."""
    paths = [*map(str, further), str(ROOT)]
    own = {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "130"}
    return subprocess.run(
        argv,
        check=False,
        cwd=folder,
        env={**os.environ, **own},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE,
    )


def _session(block: str, folder: Path) -> None:
    """Commands with what they say."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        line, _, shown = part.partition("\n")
        said = _done(_argv(shlex.split(line, comments=True)), folder).stdout
        if not _alike(shown, said):
            raise Wrong(f"'{line}' says\n{said}and the page shows\n{shown}")


def _alike(shown: str, said: str) -> bool:
    """Lines without the spaces at their ends; `…` is anything, of many lines too."""
    pieces = [re.escape(piece) for piece in _trimmed(shown).split("…")]
    return re.fullmatch(".*".join(pieces), _trimmed(said), re.DOTALL) is not None


def _trimmed(text: str) -> str:
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


if __name__ == "__main__":
    reason = failure(Path(sys.argv[1]), Path(sys.argv[2]).resolve())
    sys.exit(reason or 0)
