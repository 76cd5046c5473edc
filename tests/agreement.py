"""The mechanics of a model beside that of the reference, or of another way to write it, at random
consistent states, without any generated code."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from derive.mechanics.records import System
from derive.model import load, load_text
from derive.model.records import Model
from derive.states.nonideal import system
from derive.states.sampling import states
from hamel.verify.reference.outcome import Outcome, evaluate, reference, state_of
from hamel.verify.reference.outputs import events, nearest_turn, outputs

SMALL = 1e-6  # of a term, in SI: a smaller one counts as so large
TERMS = ("M", "h", "Q", "phi", "A", "c", "beta", "energy", "power")


@dataclass(frozen=True)
class Place:
    """One state (t, q, v, u, p)."""

    t: float
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    p: np.ndarray


def model(text: str | Path) -> Model:
    """Of a file or of the text itself."""
    return load(text) if isinstance(text, Path) else load_text(text)


def places(found: System, count: int = 6) -> list[Place]:
    """Random consistent states, with parameters as they are."""
    sampled, rng = states(found, count, seed=3), np.random.default_rng(5)
    return [
        Place(float(t), q, v, rng.normal(size=found.u.numel()), np.array(found.parameters))
        for t, q, v in zip(sampled.t, sampled.q, sampled.v)
    ]


def terms(found: System, place: Place) -> dict[str, np.ndarray]:
    """TERMS and v̇, λ of [M Aᵀ; A 0] [v̇; −λ] = [Q − h; β]."""
    arguments = [found.t, found.q, found.v, found.u, found.p]
    values = [ca.densify(ca.SX(getattr(found, name))) for name in TERMS]
    at = ca.Function("terms", arguments, values)(place.t, place.q, place.v, place.u, place.p)
    result = {name: np.array(x) for name, x in zip(TERMS, at)}
    M, A = result["M"], result["A"].reshape(-1, found.v.numel())
    saddle = np.block([[M, A.T], [A, np.zeros((len(A), len(A)))]])
    right = np.concatenate([result["Q"] - result["h"], result["beta"].reshape(-1, 1)])
    solution = np.linalg.pinv(saddle, rcond=1e-13) @ right
    nv = found.v.numel()
    return result | {"vdot": solution[:nv].ravel(), "lam": -solution[nv:].ravel()}


def difference(got: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference over the largest entry."""
    got, wanted = np.ravel(got), np.ravel(wanted)
    size = np.max(np.abs(wanted), initial=SMALL)
    return float(np.max(np.abs(got - wanted), initial=0.0) / size)


def disagreement(text: str | Path, count: int = 6) -> dict[str, float]:
    """Of every term, output and event, between the mechanics and the reference, over the largest
    entry of any place: a contact that is not pressed leaves the rounding of its stiffness."""
    own = model(text)
    found, ref = system(own), reference(own)
    apart: dict[str, float] = {}
    sizes: dict[str, float] = {}
    for place in places(found, count):
        got = terms(found, place)
        outcome = evaluate(ref, state_of(ref, place.t, place.q, place.v, place.u, place.p))
        wanted = {
            name: getattr(outcome, name) for name in ("M", "h", "Q", "energy", "power", "vdot")
        }
        kin = outcome.kinematics
        wanted |= {"phi": kin.phi, "A": kin.A, "c": kin.c, "beta": kin.beta}
        got |= _seen(found, place, outcome)
        spelled = state_of(ref, place.t, place.q, place.v, place.u, place.p)
        flat = outputs(own, spelled, outcome.lam, outcome.vdot)
        wanted["outputs"] = nearest_turn(own, flat, got["outputs"]) if len(flat) else flat
        wanted["events"] = events(own, spelled, outcome.lam, outcome.vdot)
        got["phi"], wanted["phi"] = got["phi"] + 1.0, kin.phi[:, None] + 1.0  # φ is zero
        for name, x in wanted.items():
            ours, theirs = np.ravel(got[name]), np.ravel(np.asarray(x))
            apart[name] = max(apart.get(name, 0.0), np.max(np.abs(ours - theirs), initial=0.0))
            sizes[name] = max(sizes.get(name, SMALL), np.max(np.abs(theirs), initial=0.0))
    return {name: float(apart[name] / sizes[name]) for name in apart}


def _seen(found: System, place: Place, outcome: Outcome) -> dict[str, np.ndarray]:
    arguments = [found.t, found.q, found.v, found.u, found.p]
    reactions = found.symbols.reactions([row.name for row in found.rows])
    values = [
        ca.vertcat(ca.SX(0, 1), *[ca.vec(x) for _, x, _ in found.outputs]),
        ca.vertcat(ca.SX(0, 1), *[x for _, x in found.events]),
    ]
    taken = [*arguments, reactions, found.symbols.vdot]
    at = ca.Function("seen", taken, [ca.densify(x) for x in values])
    seen = at(place.t, place.q, place.v, place.u, place.p, outcome.lam, outcome.vdot)
    return {name: np.array(x).ravel() for name, x in zip(("outputs", "events"), seen)}


def apart(first: str, second: str, count: int = 8) -> float:
    """Largest relative difference of the accelerations of two models of the same coordinates, at
    random states of the first."""
    one, other = (system(model(text)) for text in (first, second))
    return max(
        difference(terms(other, place)["vdot"], terms(one, place)["vdot"])
        for place in places(one, count)
    )
