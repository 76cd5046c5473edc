"""What a build is asked for, in one record."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal

from hamel.build.limits import DENSE, FEWEST, MANY, QUICK_STATES

if TYPE_CHECKING:
    from derive.formulations.records import Equations

Constants = Collection[str] | Literal["all"]
Fixed = Mapping[str, float | str]  # inputs and parameters that become numbers


@dataclass(frozen=True)
class BuildOptions:
    """How a module is derived, what it holds, and how it is compiled and verified."""

    choice: str | None = None  # of the quasi-velocities: the file's first when None
    constants: Constants = ()  # parameters that are baked in as numbers
    functions: Collection[str] | None = None  # the usual ones when None
    formulation: str = "quasi_velocities"
    integrators: Collection[str] = ()  # of the module's simulate(): the default one when empty
    numpy: bool = False  # without a compiler, a module that runs on NumPy will do
    tune: bool = False  # take what is fastest on this machine
    header: bool = False  # also NAME_inline.h
    fix: Fixed = field(default_factory=dict)  # inputs and parameters with these values
    real: str = "float64"  # what the code computes in
    targets: Collection[str] = ()  # on request, such as casadi
    roll: str = "auto"  # functions as loops over links: never, always, where they are long
    states: int = QUICK_STATES  # random admissible states of the verification

    def said(self) -> dict[str, Any]:
        """The options as plain values that print the same whenever they are the same."""
        plain = {option.name: getattr(self, option.name) for option in fields(self)}
        lists = {
            name: tuple(plain[name])
            for name in ("functions", "integrators", "targets")
            if plain[name] is not None
        }
        constants = "all" if self.constants == "all" else tuple(self.constants)
        return plain | lists | {"constants": constants, "fix": sorted(self.fix.items())}


def affordable(equations: Equations, states: int) -> int:
    """Fewer states where there are many bodies, many velocities in loops, or several charts: the
    reference is not made for speed."""
    system = equations.system
    bodies, velocities = len(system.model.bodies), system.v.numel() if system.rows else 0
    most = min(MANY // max(1, bodies), DENSE // max(1, velocities) ** 2)
    return max(FEWEST, min(states, most // (1 + len(equations.charts))))
