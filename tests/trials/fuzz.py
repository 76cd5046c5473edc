"""`make fuzz`: spoiled model and robot files, through loader, importers, `check` and `build`, for a
given time.

`hamel.check` and `hamel.build` are called in processes that are used again until they hang, die or
run out of memory. A failure is any exception without one of hamel's exit codes, any warning, more
than 2 GB and more than 20 s of reading. What broke before, in tests/findings/, comes first, and is
mutated like the rest. --resume adds to the counts of the last run.
"""

from __future__ import annotations

import random
import re
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import environment
from environment import FINDINGS, HOME, KILLED, Record, Worker, asked

MEMORY = 2_000_000_000
READING, BUILDING = 20.0, 120.0  # seconds
LARGEST = 8_000  # bytes of a file that is mutated: a slip in a long one is rarer and slower
STRANGE = (
    "null", "~", "[]", "{}", "[1, 2]", "{a: 1}", "nan", ".inf", "1e400", "-1e300", "1e-320", "0",
    "-1", "true", "''", "ground", "t", "pi", "der(t)", "sqrt(-1)", "log(0)", "1/0", "0**-1",
    "2^10000", "λ", "*", "&a", "!!int", "%", "@", "|", "kg", "deg", "auto", "a.b.c", "__class__",
    "1_000", "0x10", "1:30", "<<", "?", "min(1)", "atan2(1)", "reaction.C", "free", "9" * 30,
    "example", "1e160 m", "5e-324", "[[1e300]]", "x" * 5000, "(" * 300, "\\x00", "\t",
)  # fmt: skip
NUMBERS = (
    "0", "1", "-1", "1e-9", "1e9", "1e-300", "1e300", "5e-324", "0.5", "1e-16", "1e150", "1e160",
    "1.5707963267948966", "inf", "nan",
)  # fmt: skip
KINDS = (
    "revolute", "prismatic", "ball", "free", "planar", "cylindrical", "universal", "screw", "fixed",
    "floating", "hinge", "slide",
)  # fmt: skip
NUMBER = re.compile(r"(?<![\w.])\d[\d.]*(?:e-?\d+)?")
WORD = re.compile(r"[A-Za-z_][\w.]*|\d+\.?\d*(?:[eE][+-]?\d+)?|[^\sA-Za-z_0-9]")


def put(text: str, span: tuple[int, int], new: str) -> str:
    return text[: span[0]] + new + text[span[1] :]


def other_numbers(text: str, rng: random.Random, other: str) -> str:
    """Other numbers and other kinds of joint: what often still loads."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        pattern, words = (
            (NUMBER, NUMBERS)
            if rng.random() < 0.7
            else (re.compile(rf"\b({'|'.join(KINDS)})\b"), KINDS)
        )
        places = list(pattern.finditer(text))
        if places:
            text = put(text, rng.choice(places).span(), rng.choice(words))
    return text


def other_lines(text: str, rng: random.Random, other: str) -> str:
    """A line lost, doubled, moved, indented, or taken from another file."""
    lines = text.split("\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[i]
        case 1:
            lines.insert(i, lines[j])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            lines[i] = " " * rng.randrange(5) + lines[i].lstrip()
        case _:
            lines.insert(i, rng.choice(other.split("\n")))
    return "\n".join(lines)


def other_words(text: str, rng: random.Random, other: str) -> str:
    """A word lost, strange, or taken from elsewhere."""
    words = list(WORD.finditer(text))
    if not words:
        return text
    new = rng.choice(("", rng.choice(STRANGE), rng.choice(words).group(), rng.choice(STRANGE)))
    return put(text, rng.choice(words).span(), new)


def other_value(text: str, rng: random.Random, other: str) -> str:
    """Something strange after a colon, or between quotation marks."""
    places = [m.span(1) for m in re.finditer(r":[ \t]+([^\n]+)", text)] + [
        m.span(1) for m in re.finditer(r'"([^"\n]*)"', text)
    ]
    return put(text, rng.choice(places), rng.choice(STRANGE)) if places else text


def other_tags(text: str, rng: random.Random, other: str) -> str:
    """A part between brackets lost, doubled, or taken from another file."""
    parts = [m.span() for m in re.finditer(r"<[^<>]*>|\{[^{}]*\}|\[[^\[\]]*\]", text)]
    if not parts:
        return text
    one, more = rng.choice(parts), rng.choice(parts)
    match rng.randrange(3):
        case 0:
            return put(text, one, "")
        case 1:
            return put(text, (one[1], one[1]), text[slice(*more)])
    return put(text, one, text[slice(*more)])


def other_bytes(text: str, rng: random.Random, other: str) -> str:
    i = rng.randrange(len(text) + 1)
    return (
        text[:i]
        + chr(rng.choice((0, 9, 10, 13, 32, 34, 35, 0x7F, 0x85, 0xFEFF, 0x2028, 0x1F600)))
        + text[i + rng.randrange(3) :]
    )


SLIPS = (
    other_numbers,
    other_numbers,
    other_lines,
    other_words,
    other_value,
    other_tags,
    other_bytes,
)


def mutated(seeds: list[tuple[str, str]], rng: random.Random) -> tuple[str, str]:
    """A suffix and a text."""
    suffix, text = rng.choice(seeds)
    _, other = rng.choice(seeds)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        text = rng.choice(SLIPS)(text, rng, other)
    return suffix, text


def seeds() -> list[tuple[str, str]]:
    """The models, the robots of the tests and what broke before; long ones are left out."""
    folders = (environment.ROOT / "models", environment.ROBOTS, FINDINGS)
    files = [one for folder in folders for one in readable(folder)]
    return [(suffix, text) for suffix, text in files if len(text) < LARGEST]


def readable(folder: Path) -> list[tuple[str, str]]:
    """Suffix and text of every file that hamel reads."""
    paths = [p for p in sorted(folder.rglob("*")) if p.suffix in (".yaml", ".urdf", ".xml")]
    return [(path.suffix, path.read_text()) for path in paths]


@dataclass
class Tries:
    """What was tried and what failed, of every class of failure the first file."""

    record: Record
    classes: set[str] = field(default_factory=set)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def note(self, verb: str, end: dict, suffix: str, text: str) -> None:
        wrong = fault(end)
        with self.lock:
            self.record.tried[f"{verb} {end['code']}"] += 1
            kind = re.sub(r"[\d.]+|'[^']*'|/\S+", "_", wrong)[:90]
            if not wrong or kind in self.classes:
                self.record.tried["of a class that failed already"] += bool(wrong)
                return
            self.classes.add(kind)
            path = self.kept(suffix, text)
            self.record.failures.append(f"{verb} {path.relative_to(environment.ROOT)}: {wrong}")
            print(f"FAILED {self.record.failures[-1]}", flush=True)

    def kept(self, suffix: str, text: str) -> Path:
        """The file, where it can be looked at and taken into tests/findings."""
        folder = environment.ROOT / "build" / "trials" / "fuzz"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{len(self.classes)}{suffix}"
        path.write_text(text, errors="surrogatepass")
        return path


def fault(end: dict) -> str:
    """What is wrong with one call; empty for what is right or refused in words."""
    line = next(iter(end["text"].splitlines()), "")[:300]
    if end["code"] == KILLED:
        return line
    if end["code"] not in (0, 1, 2, 3, 4):
        return f"exit {end['code']}: {line}"
    if end["code"] == 3:
        return f"blames the compiler or the disk: {line}"
    if "MemoryError" in end["text"]:
        return f"out of memory: {line}"
    if end["warnings"]:
        return f"warning: {end['warnings'][0][:300]}"
    return (
        ""
        if end["code"] == 0 or ("\n" not in line and line)
        else f"refuses without words: {end['text']!r}"
    )


class Fuzzer(threading.Thread):
    """Mutates and calls until the time is over; one process of its own."""

    def __init__(self, tries: Tries, verb: str, number: int, until: float):
        super().__init__()
        self.tries, self.verb, self.until = tries, verb, until
        self.rng, self.worker = (
            random.Random(number),
            Worker(MEMORY, {"XDG_CACHE_HOME": str(HOME / f"cache-{verb}")}),
        )
        self.folder = HOME / f"fuzz-{verb}"
        self.folder.mkdir()

    def run(self) -> None:
        given = seeds()
        for suffix, text in self.files(given):
            if time.monotonic() > self.until:
                break
            self.call(suffix, text)
        self.worker.stop()

    def files(self, given: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
        before, shortest = readable(FINDINGS), {"check": LARGEST, "build": 1_200}[self.verb]
        yield from before if self.verb == "check" else [x for x in before if len(x[1]) < 1_000]
        while True:
            yield mutated([x for x in given if len(x[1]) < shortest], self.rng)

    def call(self, suffix: str, text: str) -> None:
        path = self.folder / f"m{suffix}"
        path.write_text(text, errors="surrogatepass")
        end = self.worker.call("check", str(path), limit=READING)
        self.tries.note("check", end, suffix, text)
        if self.verb == "build" and end["code"] == 0:
            given = {"out": str(self.folder / "out"), "functions": ["dynamics", "energy"]}
            self.tries.note(
                "build", self.worker.call("build", str(path), limit=BUILDING, **given), suffix, text
            )


def main() -> int:
    given = asked(__doc__ or "", ["check", "build"], seconds=1200)
    record = Record("fuzz")
    if given.resume:
        record.take_up()
    until, tries = time.monotonic() + given.seconds, Tries(record)
    fuzzers = [Fuzzer(tries, verb, random.randrange(10**6), until) for verb in given.kinds]
    for fuzzer in fuzzers:
        fuzzer.start()
    for fuzzer in fuzzers:
        fuzzer.join()
    return record.write()


if __name__ == "__main__":
    sys.exit(main())
