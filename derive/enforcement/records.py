"""The Enforcement record: how a simulation stays on φ = 0 and A v = c.

An enforcement acts on one of three levels: on the equations themselves ("rates": what is integrated
pulls back to the constraints), on the state after every step ("steps"), or on the state before
every evaluation ("stages": fewer coordinates are integrated, the rest follows from the
constraints).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from derive.formulations.records import Equations
from derive.mechanics.records import System


@dataclass(frozen=True)
class Options:
    """`alpha`: rate in 1/s at which violations decay (baumgarte, feedback); `conserve`: cyclic
    coordinates whose momenta are held (invariants); `inputs` and `parameters`: u and p of the
    motion, zero and their defaults where none are given."""

    alpha: float | None = None
    conserve: tuple[str, ...] = ()
    inputs: tuple[float, ...] = ()
    parameters: tuple[float, ...] = ()


def unchanged(equations: Equations, options: Options) -> Equations:
    """The equations as they are: for an enforcement that acts on states and not on what is
    integrated."""
    return equations


def same(system: System, options: Options) -> System:
    """The system as it is: for an enforcement that asks nothing of β."""
    return system


@dataclass(frozen=True)
class Enforcement:
    """`refusal` says why an enforcement does not fit some equations ("" where it does); `system`
    and `equations` are what it makes of the mechanics before a formulation sees it, and of the
    formulation's result; `needs` are the functions its code calls; `conserves` says whether it
    looks at `Options.conserve`; `stop` is what else than the choice of quasi-velocities can be
    singular where a motion stops, and the way out.
    """

    name: str
    about: str
    source: str
    level: str
    refusal: Callable[[Equations, Options], str]
    needs: Callable[[Equations], tuple[str, ...]] = lambda found: ()
    system: Callable[[System, Options], System] = same
    equations: Callable[[Equations, Options], Equations] = unchanged
    conserves: bool = False
    stop: str = ""
