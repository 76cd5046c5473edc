"""Functions in pieces: step, ramp, clip and piecewise, sharp or smooth over a width.

    step(x) = 0 below 0, 1 from there on        step(x, w) = (1 + tanh(x/w))/2
    ramp(x) = 0 below 0, x from there on        ramp(x, w) = (x + √(x² + w²))/2
    clip(x, a, b) = x between a and b           clip(x, a, b, w) = a + ramp(x−a, w) − ramp(x−b, w)
    piecewise(x, f₀, x₁, f₁, x₂, f₂ …) = f₀ below x₁, f₁ from x₁ to x₂ …

What is not chosen is not computed to a number: a root in another piece may be of a negative one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Choice = Callable[[Any, Any, Any, Any], Any]  # (a, b, x, y) → x where a < b, else y


def pieces(
    choice: Choice, tanh: Callable[[Any], Any], sqrt: Callable[[Any], Any]
) -> dict[str, Callable[..., Any]]:
    """The four functions over any kind of number; `choice` compares two and takes one of two."""

    def step(x: Any, width: Any = None) -> Any:
        """0 and 1."""
        return choice(x, 0.0, 0.0, 1.0) if width is None else 0.5 * (1.0 + tanh(x / width))

    def ramp(x: Any, width: Any = None) -> Any:
        """0 and x."""
        if width is None:
            return choice(x, 0.0, 0.0, x)
        return 0.5 * (x + sqrt(x * x + width * width))

    def clip(x: Any, least: Any, most: Any, width: Any = None) -> Any:
        """x, but no less and no more."""
        if width is None:
            return choice(x, least, least, choice(most, x, most, x))
        return least + ramp(x - least, width) - ramp(x - most, width)

    def piecewise(x: Any, *rest: Any) -> Any:
        """The formula of the piece in which x is."""
        result = rest[-1]
        for place in range(len(rest) - 2, 0, -2):
            result = choice(x, rest[place], rest[place - 1], result)
        return result

    return {"step": step, "ramp": ramp, "clip": clip, "piecewise": piecewise}
