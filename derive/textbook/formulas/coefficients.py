"""Hamel's coefficients γ: how the directions of quasi-velocities fail to commute.

With all quasi-velocities [w; ω_c] = [B; A] v of a choice and q̇ = N v = N [S R] [w; ω_c], each has a
direction u_r, a column of N [S R], that is, a vector field on the configurations. Then

    [u_r, u_l] = Σ_s γ^s_rl u_s,        γ^s_rl = −γ^s_lr.

Source: Hamel 1904; Neimark, Fufaev, Dynamics of Nonholonomic Systems, 1972; Bloch, Marsden, Zenkov,
Quasivelocities and symmetries in nonholonomic systems, Dynamical Systems 24 (2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from derive.mechanics.records import System
from derive.states.sampling import states
from derive.textbook.formulas.terms import Terms

SAMPLES = 6  # states at which a coefficient has to vanish to be called zero
ZERO = 1e-10  # of the largest coefficient there


@dataclass(frozen=True)
class Coefficients:
    """γ over (t, q). Rows s: the nw quasi-velocities first, then the independent constraint
    rows."""

    terms: Terms

    @property
    def free(self) -> int:
        """nw, as many directions as the constraints leave."""
        return self.terms.w.numel()

    @cached_property
    def directions(self) -> ca.SX:
        """[S R] over (t, q), nv × nv: the directions in generalized velocities."""
        S = self.terms.named("S")
        return ca.horzcat(S, self.terms.named("R")) if self.terms.has("Y") else S

    @cached_property
    def rows(self) -> ca.SX:
        """[B; A], nv × nv, the inverse of the directions."""
        B = self.terms.named("B")
        return ca.vertcat(B, self.terms.named("A")) if self.terms.has("Y") else B

    @cached_property
    def structure(self) -> dict[tuple[int, int], np.ndarray]:
        """[n_i, n_j] of the columns of N, over these columns: numbers, for the joints are groups.
        Absent where they commute, as rates do."""
        return structure(self.terms.system)

    def bracket(self, r: int, other: int) -> ca.SX:
        """[u_r, u_l] in generalized velocities, nv × 1."""
        first, second = self.directions[:, r], self.directions[:, other]
        return self._change(second, first) - self._change(first, second) + self._own(first, second)

    def _change(self, of: ca.SX, way: ca.SX) -> ca.SX:
        """How one direction changes along another."""
        s = self.terms.system
        return ca.jtimes(of, s.q, ca.mtimes(s.N, way))

    def _own(self, first: ca.SX, second: ca.SX) -> ca.SX:
        """What the generalized velocities themselves contribute."""
        total = ca.SX.zeros(first.numel())
        for (i, j), numbers in self.structure.items():
            area = first[i] * second[j] - first[j] * second[i]
            total = total + area * ca.SX(ca.DM(numbers))
        return total

    def of(self, r: int, other: int) -> ca.SX:
        """γ^s_rl for all s, nv × 1."""
        return ca.mtimes(self.rows, self.bracket(r, other))

    @property
    def drifts(self) -> bool:
        """Whether directions change with time, or constraint rows move by themselves."""
        s = self.terms.system
        return bool(ca.depends_on(self.directions, s.t)) or not s.c.is_zero()

    def drift(self, other: int) -> ca.SX:
        """γ^s_0l = Σ_r c_r γ^s_rl + (Y ∂u_l/∂t)^s, nv × 1: of the motion that constraints
        prescribe."""
        s = self.terms.system
        total = ca.mtimes(self.rows, ca.jacobian(self.directions[:, other], s.t))
        if s.c.is_zero() or not self.terms.has("Y"):
            return total
        c = self.terms.of_independent(s.c)
        for k in range(c.numel()):
            total = total + c[k] * self.of(self.free + k, other)
        return total

    @cached_property
    def table(self) -> dict[tuple[int, int], ca.SX]:
        """γ of every pair r < l of free directions, nv × 1 each."""
        pairs = [(r, k) for r in range(self.free) for k in range(r + 1, self.free)]
        return {(r, k): self.of(r, k) for r, k in pairs}

    @cached_property
    def vanishing(self) -> dict[tuple[int, int], list[bool]]:
        """Which γ^s of a pair are zero at all sampled states."""
        if not self.table:
            return {}
        return self._measured(list(self.table), list(self.table.values()))

    def _measured(
        self, keys: list[tuple[int, int]], columns: list[ca.SX]
    ) -> dict[tuple[int, int], list[bool]]:
        s = self.terms.system
        function = ca.Function("gamma", [s.t, s.q, s.p], [ca.densify(ca.horzcat(*columns))])
        sample = states(s, SAMPLES, parameters=0.1)
        values = [
            np.abs(np.asarray(function(t, q, p), dtype=float))
            for t, q, p in zip(sample.t, sample.q, sample.p)
        ]
        largest = np.max(values, axis=0)
        zero = largest <= ZERO * max(1.0, float(np.max(largest)))
        return {key: [bool(x) for x in zero[:, k]] for k, key in enumerate(keys)}


def structure(system: System) -> dict[tuple[int, int], np.ndarray]:
    """[n_i, n_j] over the columns n of N, for i < j, where it is not zero."""
    N, q, count = system.N, system.q, system.v.numel()
    pairs = [
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if ca.depends_on(N[:, i], q) or ca.depends_on(N[:, j], q)
    ]
    if not pairs:
        return {}
    brackets = [ca.jtimes(N[:, j], q, N[:, i]) - ca.jtimes(N[:, i], q, N[:, j]) for i, j in pairs]
    function = ca.Function("brackets", [q], [ca.densify(N), ca.densify(ca.horzcat(*brackets))])
    values, columns = (np.asarray(x) for x in function(states(system, 1).q[0]))
    exponents = np.rint(np.linalg.lstsq(values, columns, rcond=None)[0])
    return {pair: exponents[:, k] for k, pair in enumerate(pairs) if exponents[:, k].any()}
