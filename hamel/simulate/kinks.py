"""What formulas in pieces mean for an integrator: one without a look ahead cannot see where a piece
ends."""

from __future__ import annotations

import warnings

from codegen.integrators import integrator_of
from derive.diagnostics import AssumptionError
from derive.model.kinks import Piece, pieces
from derive.model.records import Model
from hamel.simulate.method import Method

SERIES = "taylor"
ADVICE = "a width makes a piece smooth, step(x, 0.01); dop853 finds its steps by their error"


def check_kinks(method: Method, model: Model) -> None:
    """Refuse the series of one piece for a motion through several; warn of equal steps over kinks.

    Raises AssumptionError.
    """
    own = integrator_of(method.integrator)
    kinks = pieces(model)
    if not kinks or own is None:
        return
    if method.integrator == SERIES:
        message = f"{SERIES} takes the series of one piece for the whole step: {_said(kinks[0])}"
        raise AssumptionError(model.diagnostic(kinks[0].span, message, ADVICE))
    if method.step_size is not None or not own.adaptive:
        message = f"equal steps of {method.integrator} do not see where a piece ends: "
        warnings.warn(f"{message}{_said(kinks[0])}; {ADVICE}", RuntimeWarning, stacklevel=2)


def _said(piece: Piece) -> str:
    where = f" in '{piece.owner}'" if piece.owner else ""
    return f"{piece.call.function}(){where}"
