"""Numeric failures as refusals: what a library raises or warns of while a stage computes with the
numbers of a model is told as a broken assumption of that stage.

Bounds on the numbers of a file (derive.expressions.limits) keep most of it away; what their
products and inverses come to is only seen where they are formed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic

Given = ParamSpec("Given")
Result = TypeVar("Result")
# stands for zero under a line: what is divided by it is as large as can be, and yet a number
NONZERO = 1e-300
FAILURES = (ArithmeticError, np.linalg.LinAlgError)
ADVICE = "numbers of like size: look for a mass, length or inertia that is zero or out of scale"


def refuses_numerically(stage: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """A function that raises AssumptionError, which names the stage and the cause, where its
    arithmetic fails: a division by zero, an overflow, a decomposition that does not converge. NumPy
    does not warn inside; results are checked where they are used."""

    def wrapped(function: Callable[Given, Result]) -> Callable[Given, Result]:
        """The function with its numeric failures told as refusals of the stage."""

        @wraps(function)
        def run(*given: Given.args, **named: Given.kwargs) -> Result:
            """Calls the function with NumPy's warnings off: what overflows is seen in the result.
            Raises the stage's refusal, with the library's error as its cause."""
            try:
                with np.errstate(all="ignore"):
                    return function(*given, **named)
            except FAILURES as error:
                raise refusal(stage, error) from error

        return run

    return wrapped


def refusal(stage: str, error: BaseException) -> AssumptionError:
    """What is said of an arithmetic failure: the stage, and the library's own words."""
    cause = str(error.args[-1]) if error.args else type(error).__name__
    return AssumptionError(
        Diagnostic(
            message=f"{stage} cannot be computed with the numbers of this model: {cause}",
            expected=ADVICE,
        )
    )
