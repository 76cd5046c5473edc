"""Momenta that nothing changes: along the module's own motion they have to stay.

A rigid motion of the whole mechanism, a screw S fixed in space, is possible where every body can
take part: J v_S = G S with G the twists of the bodies. Its momentum is p = v_Sᵀ M v, that of all
bodies about S. Which of the six are kept, and in which combinations, is asked of the reference's
accelerations at random states; that they are is then seen in `simulate`.
"""

from __future__ import annotations

import numpy as np

from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import slope, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.identities import step
from hamel.verify.checks.motion import best_conditioned, end_of, simulates, time_scale, worst_of
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import FLOOR
from hamel.verify.reference.outcome import kinematics, mass, state_of
from hamel.verify.reference.states import STILL
from hamel.verify.reference.vectors import Array, skew

ASKED, FEWEST = 10, 7  # states: more than there are screws
# of the largest: a smaller rate, or gap between rigid motion and what the joints allow, is none
KEPT = 1e-9


def kept_momenta(e: Evidence) -> float | None:
    """Change of each kept momentum along short motions, against the largest part of it that one of
    the velocities makes."""
    if (
        not simulates(e)
        or e.reference.model.kinetic is not None
        or not e.reference.model.bodies
        or len(e.samples) < FEWEST
    ):
        return None
    screws = kept_screws(e)
    return None if not screws.size else worst_of(e, lambda e, k: _changed(e, k, screws))


def _changed(e: Evidence, k: int, screws: Array) -> float:
    s = e.samples[k]
    span = time_scale(e, s)
    q, v, _ = np.split(end_of(e, s, e.x[k], span), [len(s.q), len(s.q) + len(s.v)])
    before, size, _ = _momenta(e, s, s.t, s.q, s.v)
    after, also, _ = _momenta(e, s, s.t + span, q, v)
    return worst(screws @ (after - before)) / (
        FLOOR * e.units.energy + max(worst(size), worst(also))
    )


def kept_screws(e: Evidence) -> Array:
    """Combinations of the six unit screws, one per row."""
    rows = [row for k in best_conditioned(e)[:ASKED] for row in _broken(e, e.samples[k])]
    _, values, turns = np.linalg.svd(np.vstack(rows))
    return turns[values < KEPT]


def _broken(e: Evidence, s: Sample) -> list[Array]:
    """What must vanish of a screw whose momentum is kept: the gap that the joints leave, and the
    momentum's rate."""
    (*_, gap), vdot = _momenta(e, s, s.t, s.q, s.v), s.outcome.vdot

    def momentum(time: float) -> Array:
        return _momenta(e, s, s.t + time, s.q + time * s.outcome.qdot, s.v + time * vdot)[0]

    rate, doubt = slope(momentum, step(e, s, vdot))
    flow = e.units.power + worst(rate) + worst(doubt) / KEPT
    return [gap, rate[None] / flow]


def _momenta(e: Evidence, s: Sample, t: float, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Of the six unit screws in the model's own units: momenta, the sizes of what is summed, and J
    v_S − G S."""
    there = state_of(e.reference, t, q, v, s.u, s.full)
    k, own = kinematics(e.reference, there), e.units.own
    units = np.repeat([1.0, own.length], 3) / own.time
    frames = [there.frames.get(body.name, STILL) for body in e.reference.model.bodies]
    G = (
        np.vstack(
            [
                np.block([[np.eye(3), np.zeros((3, 3))], [-skew(frame.origin), np.eye(3)]])
                for frame in frames
            ]
        )
        * units
    )
    of_bodies = np.tile(units, len(frames))[:, None]
    J = k.J * e.units.v / of_bodies
    # v_S of J v_S = G S by least squares: what is left is the gap that the joints leave
    moved = np.linalg.pinv(J, rcond=KEPT) @ (G / of_bodies)
    parts = (e.units.v[:, None] * moved).T @ mass(e.reference, there, k) * v
    return parts.sum(axis=1), np.abs(parts).max(axis=1, initial=0.0), J @ moved - G / of_bodies


CHECKS = (
    Check(
        "momenta",
        1e-8,
        "what no force changes, by the reference, stays along short motions, per condition "
        "number/1000",
        kept_momenta,
    ),
)
