"""Random admissible states, each evaluated by the reference, and the system's terms there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from derive.mechanics.records import System
from derive.mechanics.system import inertial_forces
from derive.model.records import Model
from derive.states import sampling
from hamel.verify.reference.outcome import Outcome, Reference, evaluate, state_of
from hamel.verify.reference.outputs import outputs
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

# Parameters that are arguments vary by this part of their value; where that is no machine, for its
# mass matrix has a negative eigenvalue, by less, and at last not at all.
VARIED = (0.2, 0.02, 0.0)
# of the usual way from the initial state: how far states lie, and their stand-ins
SPREADS = (1.0, 0.3, 0.1, 0.03)
TERMS = ("qdot", "N", "M", "h", "Q", "phi", "A", "c", "beta", "T", "V", "energy", "power", "zdot")
VECTORS = ("qdot", "h", "Q", "phi", "c", "beta", "zdot")
MATRICES = ("N", "M", "A")
NUMBERS = ("T", "V", "energy", "power")


@dataclass(frozen=True)
class Sample:
    """One state with the reference's outcome; `p` are the parameters of the module, z first-order
    states, `given` both as the system has them; `full` are all of the model's, and behind them z.
    """

    t: float
    q: Array
    v: Array
    u: Array
    p: Array
    z: Array
    full: Array
    state: State
    outcome: Outcome

    @property
    def given(self) -> Array:
        """p and z."""
        return np.concatenate([self.p, self.z])

    @property
    def whole(self) -> Array:
        """(q, v, z)."""
        return np.concatenate([self.q, self.v, self.z])

    def full_with(self, z: Array) -> Array:
        """`full` with other first-order states."""
        return np.concatenate([self.full[: len(self.full) - len(z)], z])


@dataclass(frozen=True)
class Terms:
    """The System's terms as arrays at one state; names as in derive.mechanics.records."""

    qdot: Array
    N: Array
    M: Array
    h: Array
    Q: Array
    phi: Array
    A: Array
    c: Array
    beta: Array
    T: float
    V: float
    energy: float
    power: float
    zdot: Array


TermsAt = Callable[[float, Array, Array, Array, Array], Terms]


def terms(system: System) -> TermsAt:
    """(t, q, v, u, p) → Terms, evaluated by CasADi. An M that is not written out is what
    Newton–Euler multiplies v̇ by."""
    columns = [ca.densify(ca.SX(getattr(system, name))) for name in TERMS]
    function = ca.Function("terms", [system.t, system.q, system.v, system.u, system.p], columns)
    vdot = ca.SX.sym("vdot", system.v.numel())
    # without gravity: a difference would leave its rounding, 1e-7 of what the tip of a rope takes
    floating = replace(system, gravity=[0.0, 0.0, 0.0])
    inertial = inertial_forces(floating, vdot) + ca.mtimes(system.M_extra, vdot)
    forces = ca.Function("forces", [system.t, system.q, system.v, system.p, vdot], [inertial])

    def mass(t: float, q: Array, p: Array) -> Array:
        still = np.zeros(system.v.numel())
        return np.array(forces(t, q, still, p, np.eye(len(still))))

    def at(t: float, q: Array, v: Array, u: Array, p: Array) -> Terms:
        result = {name: np.array(x) for name, x in zip(TERMS, function(t, q, v, u, p))}
        if not system.written:
            result["M"] = mass(t, q, p)
        flat = {name: result[name].ravel() for name in VECTORS}
        single: dict[str, Any] = {name: float(result[name][0, 0]) for name in NUMBERS}
        values: dict[str, Any] = {name: result[name] for name in MATRICES}
        return Terms(**values, **flat, **single)

    return at


def samples(system: System, reference: Reference, count: int, seed: int) -> tuple[Sample, ...]:
    """Random admissible states of derive.states.sampling, each evaluated by the reference.

    Where it has no value, as for a rope whose end is within its pulley, no motion comes by: others
    nearer to the initial state stand in. All are kept where none is left.
    """
    found: list[Sample] = []
    everything: list[Sample] = []
    for spread in SPREADS:
        drawn = _of_machines(system, reference, count, seed, spread)
        everything = everything or drawn
        found += [s for s in drawn if _has_values(reference.model, s)]
        if len(found) >= len(everything):
            break
    return tuple(found[: len(everything)] or everything)


def _has_values(model: Model, s: Sample) -> bool:
    """Whether all forces and outputs have: a formula may be no number somewhere."""
    told = outputs(model, s.state, s.outcome.lam, s.outcome.vdot)
    return all(np.isfinite(x).all() for x in (s.outcome.Q, s.outcome.h, told))


def _of_machines(
    system: System, reference: Reference, count: int, seed: int, spread: float
) -> list[Sample]:
    """The first has the file's own parameters. They are varied one by one, and the reference says
    whether what comes of it is a machine; at their own values nothing is left out."""
    drawn: list[Sample] = []
    for share in VARIED:
        some = drawn_samples(system, reference, count, seed, share, spread)
        drawn += [s for s in some if share == 0.0 or s.outcome.admissible]
        if len(drawn) >= len(some):
            return drawn[: max(len(some), 1)]
    return drawn[:count]


def drawn_samples(
    system: System,
    reference: Reference,
    count: int,
    seed: int,
    share: float,
    spread: float = 1.0,
) -> list[Sample]:
    """The same with parameters varied by that share of their values, and none left out."""
    result = sampling.states(system, count, seed, spread, share)
    rows = zip(result.t, result.q, result.v, result.u, result.p)
    return [_sample(system, reference, *row) for row in rows]


def varied(samples: Sequence[Sample], system: System) -> tuple[str, ...]:
    """The parameters that differ between the samples."""
    free = [x.name for x in system.model.parameters if x.name not in system.constants]
    columns = zip(free, zip(*(s.p for s in samples)))
    return tuple(name for name, column in columns if len(set(column)) > 1)


def _sample(
    system: System, reference: Reference, t: float, q: Array, v: Array, u: Array, p: Array
) -> Sample:
    full = all_parameters(system, p)
    state = state_of(reference, float(t), q, v, u, full)
    own, z = np.split(p, [len(system.own_parameters)])
    return Sample(float(t), q, v, u, own, z, full, state, evaluate(reference, state))


def all_parameters(system: System, p: Array) -> Array:
    """The model's parameters in order: those of p where the system takes them, defaults for the
    rest. Then the first-order states."""
    rest = iter(p)
    own = [x.value if x.name in system.constants else next(rest) for x in system.model.parameters]
    return np.array([*own, *rest], dtype=float)
