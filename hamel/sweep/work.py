"""What an executor runs: one function of a task. The job behind the task is sent along only where
the worker does not know it yet; it asks for it."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

import hamel
from derive.diagnostics import ToolchainError
from hamel.build import store
from hamel.optional import library
from hamel.sweep.artefact import unpacked
from hamel.sweep.axes import MOVED, NUMBER, STATUS
from hamel.sweep.chunk import Chunk, Move, cause, is_good, made
from hamel.sweep.job import Job, Motions, of_payload
from hamel.sweep.limits import REASONS
from hamel.sweep.modes import ready
from hamel.sweep.summary import Growing, of_json, summary

JOB = "sweep"  # the kind of entry in the store
MOVES = b"moves"  # what a file of rows says of its first motions with another start

_known: dict[str, tuple[Job, Any, str]] = {}
_lock = threading.Lock()


@dataclass(frozen=True)
class Task:
    """Chunk `number` of the job of that name; its data where the worker may not have it."""

    version: str  # of hamel
    job: str
    number: int
    data: bytes | None = None


@dataclass(frozen=True)
class Answer:
    """`content` is the file of the chunk. `missing`: the worker does not know the job."""

    content: bytes = b""
    missing: bool = False
    count: int = 0
    failed: int = 0
    reasons: tuple[tuple[int, str], ...] = ()  # number of the motion, and why it failed
    seconds: float = 0.0  # in the worker
    note: str = ""  # what is worth saying about the worker


def work(task: Task) -> Answer:
    """The chunk, by whichever worker this is. Raises ToolchainError where its hamel is another."""
    begin = time.perf_counter()
    if task.version != hamel.__version__:
        raise ToolchainError(
            f"a worker has hamel {hamel.__version__}, and the sweep was started by {task.version}",
            "the same version on all machines",
        )
    result = prepared(task)
    if result is None:
        return Answer(missing=True)
    job, module, note = result
    chunk = made(job, module, task.number)
    content = rows_file(chunk) if job.rows else summary_file(chunk)
    failed = np.flatnonzero(~is_good(chunk.status))
    reasons = [(chunk.first + int(k), cause(int(chunk.status[k]))) for k in failed[:REASONS]]
    return Answer(
        content,
        False,
        len(chunk.status),
        len(failed),
        tuple(reasons),
        time.perf_counter() - begin,
        note,
    )


def prepared(task: Task) -> tuple[Job, Any, str] | None:
    """The job and its module, ready to run; None where its data is not here."""
    with _lock:  # threads of one process wait for the first that prepares it
        if task.job not in _known:
            data = task.data or _stored(task.job)
            if data is None:
                return None
            if task.data is not None:
                store.put(JOB, task.job, store.Entry({"job": task.data}))
            remember(task.job, of_payload(data))
        return _known[task.job]


def _stored(name: str) -> bytes | None:
    """Another process of this machine may have got it."""
    entry = store.stored(JOB, name)
    return None if entry is None else entry.files["job"]


def remember(name: str, job: Job) -> str:
    """Make a job ready in this process; what is worth saying about it here."""
    while len(_known) > 8:
        _known.pop(next(iter(_known)))
    if isinstance(job.work, Motions):
        module, note = unpacked(job.work.artefact)
    else:
        found = ready(job.work)
        module, note = found.study, found.note
    _known[name] = job, module, note
    return note


# ---- files


def rows_file(chunk: Chunk) -> bytes:
    """Rows as Parquet: number, what varied, what is kept, status, whether the start is another."""
    arrow = library("pyarrow", "keeping rows")
    count = len(chunk.status)
    columns = {NUMBER: np.arange(chunk.first, chunk.first + count, dtype=np.int64)}
    columns |= chunk.varied | chunk.kept | {STATUS: chunk.status, MOVED: chunk.moved}
    sink = BytesIO()
    table = arrow.table({name: arrow.array(column) for name, column in columns.items()})
    table = table.replace_schema_metadata({MOVES: json.dumps(chunk.moves)})
    parquet = library("pyarrow.parquet", "keeping rows")
    # numbers seldom repeat: no dictionary of them; zstd would save a tenth and take thrice as long
    how = {"compression": "snappy", "use_dictionary": False, "write_statistics": False}
    parquet.write_table(table, sink, **how)
    return sink.getvalue()


def moves_in(content: bytes) -> list[Move]:
    """In which motions of such a file a held value had to give way, the first of them."""
    parquet = library("pyarrow.parquet", "reading rows")
    return json.loads(parquet.read_schema(BytesIO(content)).metadata[MOVES])


def columns_in(content: bytes) -> dict[str, np.ndarray]:
    """The columns of such a file."""
    parquet = library("pyarrow.parquet", "reading rows")
    table = parquet.read_table(BytesIO(content))
    return {name: table[name].to_numpy() for name in table.column_names}


Held = dict[str, Any]  # a summary file as JSON has it


def summary_of(
    first: int,
    kept: dict[str, np.ndarray],
    status: np.ndarray,
    moved: np.ndarray,
    moves: Sequence[Move],
) -> Held:
    """Of some motions that follow each other."""
    statuses, counts = np.unique(status, return_counts=True)
    bad = np.flatnonzero(~is_good(status))[:REASONS]
    return {
        "count": len(status),
        "moved": int(moved.sum()),
        "moves": list(moves),
        "statuses": [[int(s), int(n)] for s, n in zip(statuses, counts)],
        "failures": [[first + int(k), int(status[k])] for k in bad],
        "columns": {name: summary(column, first).about() for name, column in kept.items()},
    }


def all_of(parts: Iterable[Held]) -> Held:
    """Of all parts, in their order; no two of them are ever in memory."""
    count = moved = 0
    statuses: Counter[int] = Counter()
    failures: list[list[int]] = []
    moves: list[Move] = []
    columns: defaultdict[str, Growing] = defaultdict(Growing)
    for part in parts:
        count, moved = count + part["count"], moved + part["moved"]
        moves = [*moves, *part["moves"]][:REASONS]
        statuses.update(dict(part["statuses"]))
        failures = sorted([*failures, *part["failures"]])[:REASONS]
        for name, column in part["columns"].items():
            columns[name].add(of_json(column))
    return {
        "count": count,
        "moved": moved,
        "moves": moves,
        "statuses": sorted([k, n] for k, n in statuses.items()),
        "failures": failures,
        "columns": {name: column.summary().about() for name, column in columns.items()},
    }


def summary_file(chunk: Chunk) -> bytes:
    """A chunk without its rows."""
    moved = chunk.moved, chunk.moves
    return written(summary_of(chunk.first, chunk.kept, chunk.status, *moved))


def written(held: Held) -> bytes:
    """The bytes of a summary file."""
    return json.dumps(held, sort_keys=True, separators=(",", ":")).encode()
