"""What an engine says of one state."""

from __future__ import annotations

from dataclasses import dataclass

from hamel.verify.reference.vectors import Array


@dataclass(frozen=True)
class Forces:
    """M (nv × nv), h (nv) and v̇ (nv) in our order of velocities; where loops are closed, `rows` @
    v̇ are what they hold."""

    M: Array
    h: Array
    vdot: Array
    rows: Array | None = None
