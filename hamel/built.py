"""What `build` returns, in a file of its own: making the classes of all records takes longer than
to start the command."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Built:
    """A module on disk. `seconds` is the time of each stage, `left_out` what this model has no use
    for.

    `kept`: it was built and verified earlier, from the same file with the same options by the same
    hamel, and copied.
    """

    model: str
    choice: str
    reason: str
    folder: Path
    verified: bool
    operations: Mapping[str, int]
    seconds: Mapping[str, float]
    quasi_velocities: tuple[str, ...]
    left_out: tuple[str, ...]
    ledger: tuple[Mapping[str, Any], ...]
    compiled: bool
    size: int = 0  # bytes of the library for C
    tuned: Mapping[str, float] = field(
        default_factory=dict
    )  # nanoseconds of `dynamics` per state for what was compared
    kept: bool = False
    real: str = "float64"  # what the code computes in


def as_json(record: Any) -> Any:
    """The record as JSON values; what JSON has no number for (inf, nan) becomes null."""
    if is_dataclass(record):
        return {
            f.name: as_json(getattr(record, f.name))
            for f in fields(record)
            if f.metadata.get("json", True)
        }
    if isinstance(record, Mapping):
        return {str(key): as_json(value) for key, value in record.items()}
    if isinstance(record, list | tuple):
        return [as_json(item) for item in record]
    if isinstance(record, Path):
        return str(record)
    if isinstance(record, float):  # NumPy's float64 is one
        return float(record) if math.isfinite(record) else None
    return record
