"""The terms a derivation speaks of: what the equations and their system named, and the
accelerations and multipliers that follow from them."""

from __future__ import annotations

from functools import cached_property

import casadi as ca

from derive.expressions.deferred import size_of
from derive.formulations.records import Equations, Function
from derive.mechanics.records import Named, System

DEEP = 8  # levels down to which two rows are compared, operation by operation


class Terms:
    """Terms by name, as columns and matrices over t, q, v, w, u and p."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations

    @property
    def system(self) -> System:
        """The mechanics before any choice: M, h, Q, A and their symbols."""
        return self.equations.system

    def named(self, name: str) -> ca.SX:
        """A named term of the equations, else of the system."""
        term = self._of_equations.get(name)
        return getattr(self.system, name) if term is None else term.value

    def size(self, name: str) -> int:
        """How many entries one of the equations' terms has; it is not formed for that."""
        return size_of(self._of_equations[name], "value")

    def has(self, name: str) -> bool:
        """Whether the equations themselves named it."""
        return name in self._of_equations

    @cached_property
    def _of_equations(self) -> dict[str, Named]:
        return {x.name: x for x in reversed(self.equations.named)}

    def function(self, name: str) -> Function | None:
        """A function of the generated module."""
        equations = self.equations
        return equations.function(name) if equations.has(name) else None

    @property
    def w(self) -> ca.SX:
        """The symbols of the quasi-velocities: what follows q in x, before first-order states."""
        return self.equations.argument("x").symbols[self.equations.speeds, 0]

    @cached_property
    def wdot(self) -> ca.SX:
        """ẇ, as `dynamics` computes it."""
        dynamics = self.function("dynamics")
        assert dynamics is not None  # every formulation has it
        return dynamics.result.value[self.equations.speeds, 0]

    @cached_property
    def vdot(self) -> ca.SX:
        """v̇ = S ẇ + σ; where the state is (q, v), v̇ = ẇ."""
        if self.equations.generalized_velocities:
            return self.wdot
        return ca.mtimes(self.named("S"), self.wdot) + self.named("sigma")

    @cached_property
    def lam(self) -> ca.SX:
        """The multipliers λ, one for each constraint row."""
        reactions = self.function("reactions")
        return ca.SX(0, 1) if reactions is None else reactions.result.value

    @cached_property
    def independent(self) -> list[int]:
        """The constraint rows that stand in Y or, where rows are combined there, those that the
        combinations are made around."""
        if not self.has("Y"):
            return []
        if self.has("E"):
            return _first_of_each(self.named("E"))
        return _places(self.named("A"), self.system.A)

    def of_independent(self, column: ca.SX) -> ca.SX:
        """c or β of the rows of Y."""
        return ca.mtimes(self.named("E"), column) if self.has("E") else column[self.independent]


def _places(rows: ca.SX, of: ca.SX) -> list[int]:
    """Where each of the rows stands among those of the other matrix."""
    if rows.size1() == of.size1():
        return list(range(rows.size1()))
    places: list[int] = []
    for i in range(rows.size1()):
        others = [k for k in range(of.size1()) if k not in places]
        places.append(next(k for k in others if ca.is_equal(rows[i, :], of[k, :], DEEP)))
    return places


def _first_of_each(E: ca.SX) -> list[int]:
    """The rows of A that the combinations are made around: the first entry of each."""
    return [min(E[k, :].sparsity().get_triplet()[1]) for k in range(E.size1())]
