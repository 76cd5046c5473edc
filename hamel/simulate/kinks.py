"""What formulas in pieces mean for an integrator."""

from __future__ import annotations

import warnings

from derive.model.kinks import Piece, are_constraints_in_pieces
from derive.model.records import Model
from hamel.simulate.method import Method, own_integrator


def warn_of_blows(method: Method, model: Model) -> None:
    """Warn where a library would not see a blow; our own integrators end steps there."""
    if not own_integrator(method) and are_constraints_in_pieces(model):
        warnings.warn(
            f"{method.integrator} does not see where constraints go on to another piece: of a "
            "prescribed velocity that jumps it makes no blow, and does not end there",
            RuntimeWarning,
            stacklevel=2,
        )


def said(piece: Piece) -> str:
    """The call, and the entry that it is in."""
    where = f" in '{piece.owner}'" if piece.owner else ""
    return f"{piece.call.function}(){where}"
