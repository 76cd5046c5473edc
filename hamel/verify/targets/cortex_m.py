"""The Cortex-M target, by arm-none-eabi-gcc and QEMU: every function on an M4F and an M7 against
the module, no double arithmetic, no heap, and a controller that fits."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from derive.diagnostics import ToolchainError
from hamel.verify.records import CheckResult
from hamel.verify.targets.records import Subject, TargetCheck, result

TOOLS = ("make", "arm-none-eabi-gcc", "qemu-system-arm")
INSTALL = "apt install make gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
PROCESSORS = {"cortex-m4": "M4F", "cortex-m7": "M7"}
LIMIT = 100.0  # s, of what runs in QEMU
IMAGES = {"run": "check", "control": "control"}  # by goal of the Makefile
FLASH, STACK = 32 << 10, 2 << 10  # bytes that a controller may take
# helpers of the compiler for double, the heap, printing
UNWANTED = re.compile(
    r"__aeabi_(?:d|\w*2d)\w*"
    r"|__(?:add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|cmp|unord|powi)df[23]"
    r"|__(?:extendsfdf2|truncdfsf2|fix(?:uns)?df[sd]i|float(?:un)?[sd]idf)"
    r"|_?malloc\w*|_?sbrk\w*|\w*printf\w*"
)
# a line of the program: names, then words in hexadecimal
PRINTED = re.compile(r"^(?:instructions )?\w+(?: [0-9a-f]{8})+$", re.MULTILINE)
SMALL = 30  # states of a model whose controller is held to FLASH and STACK


@dataclass
class Run:
    """What a program printed: results by function, row by row; instructions and stack."""

    results: dict[str, list[np.ndarray]] = field(default_factory=dict)
    cost: dict[str, tuple[int, int]] = field(default_factory=dict)


def check(subject: Subject) -> Iterator[CheckResult]:
    """ToolchainError without one of the tools."""
    _demand_tools()
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base) / subject.name
        shutil.copytree(subject.folder, folder)
        place = folder / "cortex-m"
        names = _with_states(subject, place)
        for processor, short in PROCESSORS.items():
            yield from _outcomes(subject, place, processor, short, names)


def _demand_tools() -> None:
    for tool in TOOLS:
        if shutil.which(tool) is None:
            raise ToolchainError(f"{tool} is not installed", INSTALL)


def measured(subject: Subject, processor: str) -> Run:
    """What the functions cost there: instructions of a call, bytes of stack. ToolchainError without
    one of the tools."""
    _demand_tools()
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base) / subject.name
        shutil.copytree(subject.folder, folder)
        return _run(_made(folder / "cortex-m", "run", processor).stdout)


def _outcomes(
    subject: Subject, place: Path, processor: str, short: str, names: Sequence[str]
) -> Iterator[CheckResult]:
    done = _made(place, "run", processor)
    run = _run(done.stdout)
    errors = [_error(subject, name, run.results.get(name, [])) for name in names]
    instructions, stack = run.cost.get("dynamics", (0, 0))
    said = f"dynamics: {instructions} instructions, {stack} bytes of stack"
    if done.returncode:
        said = " ".join((done.stderr or done.stdout).split())[:400]
    yield result(subject, f"values on {short}", errors, said)
    unwanted = _unwanted(place / f"check-{processor}.elf")
    about = f"symbols for double, heap or printing: {', '.join(unwanted) or 'none'}"
    yield CheckResult(f"no double, no heap on {short}", len(unwanted), 0.0, not unwanted, about)
    if (place / "control.c").is_file():
        yield from _control(subject, place, processor, short)


def _control(subject: Subject, place: Path, processor: str, short: str) -> Iterator[CheckResult]:
    """Flash and stack of the controller's image; of a large model they are said alone. Where the
    initial state is singular no inputs are found there, and the stack is told all the same."""
    done = _made(place, "control", processor)
    sizes = re.search(r"^\s*(\d+)\s+(\d+)\s+(\d+)\s+\d+\s+\w+\s+control", done.stdout, re.MULTILINE)
    words = re.findall(r"\b[0-9a-f]{8}(?= \n)", done.stdout)
    flash = float(int(sizes[1]) + int(sizes[2])) if sizes else np.inf
    stack = float(int(words[-1], 16)) if words else np.inf
    small = len(subject.module.states) <= SMALL if hasattr(subject.module, "states") else True
    for what, value, most in (("flash", flash, FLASH), ("stack", stack, STACK)):
        passed = value <= most or (not small and np.isfinite(value))
        about = f"{what} of the controller: {value:.0f} bytes of {most}"
        yield CheckResult(f"{what} of the controller on {short}", value, most, passed, about)


def _with_states(subject: Subject, place: Path) -> list[str]:
    """states.h with the subject's rows; of functions without any it keeps its own."""
    text = (place / "states.h").read_text("utf-8")
    names = [name for name in subject.rows if subject.sizes(name)]
    for name in names:
        rows = [subject.row(name, k) for k, _ in enumerate(subject.sizes(name))]
        body = ",\n    ".join(_row([t, *x, *u, *p]) for t, x, u, p in rows)
        head = (
            rf"enum \{{ MANY_{name} = \d+ \}};\n"
            rf"(static const float rows_{name}.*?= \{{\n    ).*?,\n\}};"
        )
        new = rf"enum {{ MANY_{name} = {len(rows)} }};\n\g<1>{body},\n}};"
        text = re.sub(head, new, text, count=1, flags=re.DOTALL)
    (place / "states.h").write_text(text, "utf-8")
    return names


def _row(values: Sequence[float]) -> str:
    return "{" + ", ".join(f"{value!r}f" for value in map(float, values)) + "}"


def _made(place: Path, goal: str, processor: str) -> subprocess.CompletedProcess[str]:
    """A goal of the Makefile; what does not come to its end has failed. A compiler may take as long
    as it needs, and what it says is said again by the goal."""
    make = ["make", "--no-print-directory", "-s", f"CPU={processor}"]
    image = f"{IMAGES[goal]}-{processor}.elf"
    subprocess.run([*make, image], check=False, cwd=place, capture_output=True)
    command = [*make, goal]
    with subprocess.Popen(
        command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said, errors = process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # QEMU, too
            process.communicate()
            said, errors = "", f"{goal} did not end within {LIMIT:.0f} s"
    # QEMU prints what a program says among its errors
    return subprocess.CompletedProcess(command, process.returncode, said + errors, errors)


def _run(said: str) -> Run:
    """Lines of other kinds, such as a compiler's or QEMU's, are none of the program's."""
    run = Run()
    for line in PRINTED.findall(said):
        match line.split():
            case ["instructions", name, count, stack]:
                run.cost[name] = (int(count, 16), int(stack, 16))
            case [name, status, *words]:  # a function at a state
                values = np.array([int(word, 16) for word in words], np.uint32).view(np.float32)
                good = int(status, 16) == 0
                run.results.setdefault(name, []).append(
                    values.astype(float) if good else np.full(len(words), np.nan)
                )
    return run


def _error(subject: Subject, name: str, rows: list[np.ndarray]) -> float:
    if len(rows) != len(subject.sizes(name)):
        return np.inf
    rest = iter(rows)
    return subject.error(name, lambda *_: next(rest))


def _unwanted(image: Path) -> list[str]:
    done = subprocess.run(["arm-none-eabi-nm", image], check=False, capture_output=True, text=True)
    if done.returncode:
        return ["no image"]
    names = {line.split()[-1] for line in done.stdout.splitlines() if line.split()}
    return sorted(name for name in names if UNWANTED.fullmatch(name))


CORTEX_M = TargetCheck("cortex-m", "QEMU", check)
