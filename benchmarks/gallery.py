"""Draws the mechanisms of models/gallery and writes their page: `make gallery`, or some of them by
name."""

from __future__ import annotations

import sys
from pathlib import Path

import hamel
from derive.model import load

GALLERY = Path(__file__).parent.parent / "models" / "gallery"
HEAD = """# The gallery

Thirty mechanisms, each a short file that stands alone. `make gallery` draws them and writes this page; the slow tests build and
verify them.

| file | what it shows | what it is |
|---|---|---|
"""


def models() -> list[Path]:
    """The model files, by name."""
    return sorted(GALLERY.glob("*.yaml"))


def page() -> str:
    """One line for each mechanism, then the figures."""
    lines = "".join(map(_line, models()))
    return f"{HEAD}{lines}\n{''.join(map(_figure, models()))}"


def _line(path: Path) -> str:
    shows = path.read_text("utf-8").splitlines()[0].removeprefix("# Difficulty: ")
    return f"| [{path.stem}]({path.name}) | {shows} | {load(path).description} |\n"


def _figure(path: Path) -> str:
    return f"\n## {path.stem}\n\n![{path.stem}](figures/{path.stem}.svg)\n"


def drawn(path: Path, folder: Path) -> Path:
    """The figure of a mechanism in that folder."""
    figure = folder / f"{path.stem}.svg"
    hamel.draw(path, out=figure)
    return figure


if __name__ == "__main__":
    figures = GALLERY / "figures"
    figures.mkdir(exist_ok=True)
    for model in models():
        if not sys.argv[1:] or model.stem in sys.argv[1:]:
            drawn(model, figures)
    (GALLERY / "README.md").write_text(page(), "utf-8")
