"""What formulas in pieces mean for an integrator: the series of one piece knows nothing of the
next."""

from __future__ import annotations

import warnings

from derive.diagnostics import AssumptionError
from derive.model.kinks import Piece, are_constraints_in_pieces, pieces
from derive.model.records import Model
from hamel.simulate.method import Method, own_integrator

SERIES = "taylor"
ADVICE = "a width makes a piece smooth, step(x, 0.01); steps of the others end where a piece does"


def check_kinks(method: Method, model: Model) -> None:
    """Refuse the series of one piece for a motion through several, and warn where a library would
    not see a blow. Raises AssumptionError."""
    kinks = pieces(model)
    if not own_integrator(method) and are_constraints_in_pieces(model):
        warnings.warn(
            f"{method.integrator} does not see where constraints go on to another piece: of a "
            "prescribed velocity that jumps it makes no blow, and does not end there",
            RuntimeWarning,
            stacklevel=2,
        )
    if not kinks or method.integrator != SERIES:
        return
    message = f"{SERIES} takes the series of one piece for the whole step: {said(kinks[0])}"
    raise AssumptionError(model.diagnostic(kinks[0].span, message, ADVICE))


def said(piece: Piece) -> str:
    """The call, and the entry that it is in."""
    where = f" in '{piece.owner}'" if piece.owner else ""
    return f"{piece.call.function}(){where}"
