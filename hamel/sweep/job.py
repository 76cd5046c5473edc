"""What a worker has to know once, to make any chunk of the motions of one method."""

from __future__ import annotations

import hashlib
import pickle
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from derive.states.many import Starter
from hamel.simulate.motion import Stepping
from hamel.sweep.artefact import Artefact
from hamel.sweep.axes import Design
from hamel.sweep.kept import Kept


@dataclass(frozen=True)
class Motions:
    """How motions are made: the module, initial states, and the rows that are looked at."""

    artefact: Artefact
    starter: Starter
    bodies: ca.Function  # p → masses and moments of inertia
    stepping: Stepping
    times: np.ndarray
    u: np.ndarray  # inputs where they do not vary
    p: np.ndarray  # parameters where they do not vary
    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    states: tuple[str, ...]  # entries of x
    outputs: tuple[str, ...]  # what formulas call the entries of y
    velocities: tuple[str, ...]
    coordinates: tuple[str, ...]
    held: Mapping[str, float]  # initial values that are set for all
    measures: Mapping[str, str]  # what T, V, jacobi and work are called
    tables: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    most_steps: int = 10**6
    error: bool = False


@dataclass(frozen=True)
class Modes:
    """Eigenvalues along a steady motion: the model's text, from which a worker derives the linear
    equations once, and compiled code of them where there are many points."""

    text: str
    file: str
    choice: str | None
    at: str | None
    values: Mapping[str, float]
    bodies: ca.Function  # p → masses and moments of inertia
    artefact: Artefact | None = None


@dataclass(frozen=True)
class Job:
    """All motions of one method."""

    version: str  # of hamel
    design: Design
    method: int
    kept: tuple[Kept, ...]
    chunk: int
    rows: bool  # whether rows are asked for, or a summary
    work: Motions | Modes

    def span(self, chunk: int) -> tuple[int, int]:
        """The numbers of the first motion of a chunk of this method, and of the one behind its
        last."""
        first = self.method * self.design.per_method
        last = first + self.design.per_method
        return first + chunk * self.chunk, min(last, first + (chunk + 1) * self.chunk)


def payload(job: Job) -> tuple[str, bytes]:
    """The job as it travels, and its name by content."""
    data = zlib.compress(pickle.dumps(job, protocol=5), 6)
    return hashlib.sha256(data).hexdigest(), data


def of_payload(data: bytes) -> Job:
    """The job. Only what a client of the same cluster sent is ever unpickled, as everything is
    that dask moves."""
    job = pickle.loads(zlib.decompress(data))
    assert isinstance(job, Job)
    return job
