"""HTML → PDF by a headless Chromium, where one is installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from derive.diagnostics import ToolchainError
from hamel.book.limits import PATIENCE
from hamel.build.files import staged_file
from hamel.build.scratch import scratch

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# the page is our own, without script: it needs no sandbox, which no browser gives to root
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")


def browser() -> str | None:
    """The first Chromium of this machine."""
    return next((path for path in map(shutil.which, BROWSERS) if path), None)


def printed(page: Path, place: Path, command: str) -> None:
    """The page as a PDF at `place`. Raises ToolchainError where the browser does not print it."""
    with staged_file(place) as made, scratch(made.parent) as folder:
        target = folder / "book.pdf"
        own = (f"--user-data-dir={folder / 'profile'}", "--no-pdf-header-footer")
        argv = [command, *FLAGS, *own, f"--print-to-pdf={target}", page.resolve().as_uri()]
        try:
            subprocess.run(argv, capture_output=True, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired as error:
            raise ToolchainError(f"cannot print {place}: {command} does not end") from error
        if not target.exists():
            raise ToolchainError(
                f"cannot print {place}: {command} wrote nothing",
                hint="--no-pdf leaves it out; print.html prints from any browser",
            )
        target.replace(made)
