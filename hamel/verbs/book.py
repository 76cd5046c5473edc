"""book: a chapter for every model, ordered by topic, as pages and as a PDF."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from derive.diagnostics import ModelError, counted
from derive.model.builder import Model
from derive.robots import File
from derive.robots.reading import load
from hamel.book.chapter import Chapter, attempt
from hamel.book.printing import browser, printed
from hamel.book.topics import length_of
from hamel.book.writing import CONTENTS, INDEX, PRINT, pages, placed
from hamel.build.files import write_text
from hamel.engines import PROCESSES, engine
from hamel.records import Bound

if TYPE_CHECKING:
    from rich.console import Console

PAGES = {Path(name).stem for name in (CONTENTS, INDEX, PRINT)}  # names that no chapter can have
Progress = Callable[[float], None]


def run(
    paths: Sequence[str | PathLike[str]],
    out: Path,
    title: str,
    pdf: bool,
    workers: int | None,
    progress: Progress | None = None,
) -> Bound:
    """The book in the folder `out`; a model without a derivation has no chapter, and the record
    says why. Raises ModelError where a file is wrong, two models have one name or no chapter is
    left."""
    _check(paths)
    chapters: list[Chapter] = []
    refused: dict[str, str] = {}
    for name, made in _made(paths, workers, progress):
        if isinstance(made, Chapter):
            chapters.append(made)
        else:
            refused[name] = made
    if not chapters:
        raise ModelError(f"no model has a chapter: {'; '.join(refused.values())}")
    order = placed(chapters)
    texts = pages(title, order)
    for name, text in texts.items():
        write_text(out / name, text)
    command = browser() if pdf else None
    if command:
        printed(out / PRINT, out / "book.pdf", command)
    return Bound(
        folder=out,
        contents=out / CONTENTS,
        chapters=tuple(place.chapter.name for place in order),
        refused=refused,
        pages=len(texts),
        pdf=out / "book.pdf" if command else None,
    )


def _check(paths: Sequence[str | PathLike[str]]) -> None:
    """Names are those of files."""
    names = Counter(load(path).name for path in paths)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise ModelError(f"two models are called '{twice[0]}', and would share a chapter")
    taken = [name for name in names if name in PAGES]
    if taken:
        raise ModelError(f"no chapter can be called '{taken[0]}', which is a page of the book")


def _made(
    paths: Sequence[str | PathLike[str]], workers: int | None, progress: Progress | None
) -> Iterator[tuple[str, Chapter | str]]:
    """Each model's chapter, or why there is none, in the order of their ends. Long models are begun
    first, each as soon as a process is free."""
    waiting = sorted(paths, key=lambda path: length_of(load(path)))
    running: dict[Future[Chapter | str], File] = {}
    with engine(PROCESSES, workers) as processes:
        while waiting or running:
            while waiting and len(running) < processes.width():
                path = waiting.pop()
                running[processes.executor.submit(attempt, path)] = path
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield _called(running.pop(future)), future.result()
            if progress:
                progress(1.0 - (len(waiting) + len(running)) / len(paths))


def _called(path: File) -> str:
    """A file by its name, a model made in Python by its own."""
    return path.name if isinstance(path, Model) else Path(path).stem


def show(record: Bound, console: Console) -> None:
    """What is in it, and where it is."""
    console.print(f"{counted(len(record.chapters), 'chapter')}: {', '.join(record.chapters)}")
    for name, why in record.refused.items():
        console.print(f"  no chapter of {name}: {why}")
    console.print(f"  read    {record.contents}")
    if record.pdf:
        console.print(f"  printed {record.pdf}")
    else:
        console.print("  not printed: no Chromium is installed, or --no-pdf was said")
