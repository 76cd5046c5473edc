"""What a search for steady motions goes by: forces that are not balanced, in place of the rates of
speeds they would cause.

Rates ẇ = M_w⁻¹ F bend with the mass matrix wherever F is not zero yet, and Newton's steps with
them: light bodies on long links send it far away. Forces F = M_w ẇ vanish where the rates do, and
are about as straight as the springs and weights of the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.formulations.records import Equations


@dataclass(frozen=True)
class Balance:
    """`values`: (x, u, p, s) → rows, `function`: the same and their slopes ∂/∂(x, u). `mass`:
    (x, u, p) → M_w, which stands before the rows of ẇ from `first` on; None where these are
    rates."""

    values: ca.Function
    function: ca.Function
    mass: ca.Function | None = None
    first: int = 0

    def sizes(self, y: np.ndarray, p: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """One of each row, where `rates` are one of each with rates of speeds: forces that give
        one, at y = (x, u)."""
        if self.mass is None:
            return rates
        nx = self.mass.size1_in(0)
        M = np.abs(self.mass(y[:nx], y[nx:], p).full())
        result, place = rates.copy(), slice(self.first, self.first + len(M))
        heavy = M @ rates[place]
        result[place] = np.where(heavy > 0, heavy, rates[place])
        return result


def forces(equations: Equations, known: list[ca.SX], R: ca.SX, first: int) -> Balance | None:
    """The rows R over `known` = (x, u, p, s), with forces from `first` on where ẇ stands there;
    None where the mass matrix M_w is not written out."""
    if not equations.offers("mass_w") or equations.request("mass_w").refusal:
        return None
    t = equations.arguments[0].symbols
    M = ca.substitute(equations.request("mass_w").function.result.value, t, 0.0)
    n = M.size1()
    balanced = ca.mtimes(M, R[first : first + n, 0])
    F = ca.densify(ca.vertcat(R[:first, 0], balanced, R[first + n :, 0]))
    slopes = ca.densify(ca.jacobian(F, ca.vertcat(*known[:2])))
    return Balance(
        values=ca.Function("forces", known, [F]),
        function=ca.Function("balance", known, [F, slopes]),
        mass=ca.Function("mass", known[:3], [ca.densify(M)]),
        first=first,
    )
