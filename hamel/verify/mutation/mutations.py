"""How much would the suite notice? One thing at a time is made wrong in the System's terms and in
the module's functions.

A change that leaves the numbers as they are at every state, or moves them by less than any check
promises to see, is no error and is not planted. Of the others, each has to turn some check red.
Only the checks that look at what was changed are results: which those are is noted once, on the
sound equations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import casadi as ca
import numpy as np

from derive.formulations.evaluate import Evaluator, evaluator, function_of, slots_of
from derive.formulations.records import Equations
from derive.model.records import Model
from hamel.records import Mutation, Mutations
from hamel.verify.checks import CHECKS
from hamel.verify.checks.check import Check
from hamel.verify.checks.evidence import Evidence, evidence
from hamel.verify.checks.linear import with_linearization
from hamel.verify.checks.roundoff import bound
from hamel.verify.checks.samples import MATRICES, TERMS, VECTORS, Terms
from hamel.verify.mutation.errors import Change, changes
from hamel.verify.reference.outcome import reference
from hamel.verify.reference.vectors import Array

STATES = 4  # an error shows at any state; a fifth would only take longer
MOST = 200  # changes that are tried per choice
ROUNDOFF = 8.0  # times the running error bound: below, two numbers are the same
BESIDE = 1e-6  # how far off the constraints a difference is looked at again …
# … that is at least this many times smaller on them, and so only the states' own inexactness
VANISHES = 1e-4
# of an entry's largest value: the finest tolerance of what mechanics gives is ten times that
UNSEEN = 1e-11
SEE_VIOLATIONS = ("constraints", "project", "closure", "slip", "pull")


@dataclass(frozen=True)
class Target:
    """Something that can be wrong: its expression over `arguments`, where it is looked at, and the
    evidence with a wrong one."""

    name: str
    value: ca.SX
    arguments: list[ca.SX]
    places: list[tuple[Any, ...]]
    units: tuple[
        Array | float, ...
    ]  # of what stands in a place behind t; zero for what is not to be moved
    planted: Callable[[ca.SX], Evidence]

    def at_places(self, value: ca.SX, places: list[tuple[Any, ...]]) -> Array:
        """Places × entries: an expression over `arguments` evaluated by CasADi at each of them."""
        function = ca.Function("value", self.arguments, [ca.densify(value)])
        return np.array([np.ravel(np.array(function(*place))) for place in places])

    @cached_property
    def beside(self) -> list[tuple[Any, ...]]:
        """The places moved off the constraints, all but a little."""
        rng = np.random.default_rng(5)
        steps = [BESIDE * unit for unit in self.units]
        return [
            (t, *(x + step * rng.uniform(-1, 1, len(x)) for x, step in zip(rest, steps)))
            for t, *rest in self.places
        ]

    @cached_property
    def sound(self) -> Array:
        """The numbers without an error, which a change has to move to be one."""
        return self.at_places(self.value, self.places)

    @cached_property
    def sound_beside(self) -> Array:
        """The same a little off the constraints."""
        return self.at_places(self.value, self.beside)

    @cached_property
    def roundoff(self) -> Array:
        """Places × entries: a bound of what rounding alone may move there."""
        places = np.array([np.concatenate([np.ravel(x) for x in place]) for place in self.places])
        return bound(self.arguments, self.value, places)


def mutations(model: Model, equations: Equations, seed: int = 0, most: int = MOST) -> Mutations:
    """Plant up to `most` errors, spread over all terms and functions, the same ones for the same
    seed."""
    seen = evidence(reference(model), with_linearization(equations), None, STATES, seed)
    targets = [target for target in (*_terms(seen), *_functions(seen)) if target.value.numel()]
    readers = _readers(seen)
    rng = np.random.default_rng(seed)
    result = [
        _planted(target, change, readers.get(target.name, ()))
        for target, change in _changes(targets, most, rng)
    ]
    planted = tuple(mutation for mutation in result if mutation is not None)
    caught = sum(bool(mutation.caught_by) for mutation in planted)
    return Mutations(equations.choice, len(planted), caught, len(result) - len(planted), planted)


def _terms(seen: Evidence) -> Iterable[Target]:
    """The System's terms; φ, which vanishes at admissible states, is looked at beside them as
    well."""
    system = seen.system
    arguments = [system.t, system.q, system.v, system.u, system.p]
    here = [(s.t, s.q, s.v, s.u, s.given) for s in seen.samples]
    beside = [(s.t, d.q, s.v, s.u, s.given) for s, d in zip(seen.samples, seen.disturbed)]
    units = (seen.units.q, seen.units.v, 0.0, 0.0)
    for name in TERMS:
        if name == "zdot" and not system.model.states:
            continue
        value = ca.densify(ca.SX(getattr(system, name)))
        places = here + beside if name == "phi" else here
        yield Target(
            name, value, arguments, places, units, partial(_with_term, seen, name, arguments)
        )


def _with_term(seen: Evidence, name: str, arguments: list[ca.SX], wrong: ca.SX) -> Evidence:
    function = ca.Function(name, arguments, [ca.densify(wrong)])

    def at(*place: Any) -> Terms:
        value = np.array(function(*place))
        shaped = (
            value.ravel() if name in VECTORS else value if name in MATRICES else float(value[0, 0])
        )
        return replace(seen.terms_at(*place), **{name: shaped})

    return replace(seen, terms_at=at)


def _functions(seen: Evidence) -> Iterable[Target]:
    """The functions of the module; those that see a violation are looked at beside the constraints
    as well. Not `kinks`: where it changes its sign is all that counts, and most changes leave it
    there."""
    equations = seen.graph.equations
    for function in (f for f in equations.functions if f.name != "kinks"):
        places = [
            (s.t, x, s.u, s.p) for s, x in zip(seen.samples, seen.arguments_of(function.name))
        ]
        if function.name in SEE_VIOLATIONS:
            places += [(s.t, x, s.u, s.p) for s, x in zip(seen.samples, seen.astray)]
        if function.name == "state":
            places += [
                (s.t, np.concatenate([d.q, d.v, s.z]), s.u, s.p)
                for s, d in zip(seen.samples, seen.disturbed)
            ]
        arguments = slots_of(equations, function)
        name = _target_name(function.name)
        units = (seen.units.taken(function.name, len(places[0][1])), 0.0, 0.0)
        planted = partial(_with_function, seen, function.name)
        value = ca.densify(ca.SX(function.result.value))  # a matrix of numbers is no SX by itself
        yield Target(name, value, arguments, places, units, planted)


def _target_name(function: str) -> str:
    """The name of a function as a target: terms of the System may bear the same one."""
    return f"{function}()"


def _with_function(seen: Evidence, name: str, wrong: ca.SX) -> Evidence:
    equations = seen.graph.equations
    changed = tuple(
        replace(f, result=replace(f.result, value=wrong)) if f.name == name else f
        for f in equations.functions
    )
    spoiled = replace(equations, functions=changed)
    if name == "velocity":  # v̇ is its derivative
        return replace(seen, graph=evaluator(spoiled))
    functions = {**seen.graph.functions, name: function_of(spoiled, name)}
    return replace(seen, graph=replace(seen.graph, equations=spoiled, functions=functions))


def _readers(seen: Evidence) -> dict[str, tuple[Check, ...]]:
    """Term or function → the checks that look at it, of those that hold for the sound equations."""
    readers: dict[str, list[Check]] = {}
    for check in CHECKS:
        read: set[str] = set()
        error = check.error(_noting(seen, read))
        if error is not None and error <= check.tolerance:
            for name in read:
                readers.setdefault(name, []).append(check)
    return {name: tuple(checks) for name, checks in readers.items()}


def _noting(seen: Evidence, read: set[str]) -> Evidence:
    """The same evidence, which notes what is looked at."""

    class Recorder(Terms):
        def __getattribute__(self, name: str) -> Any:
            read.add(name)
            return super().__getattribute__(name)

    class Functions(dict[str, Any]):
        def __getitem__(self, name: str) -> Any:
            read.add(_target_name(name))
            return super().__getitem__(name)

    def terms_at(*place: Any) -> Terms:
        return Recorder(**vars(seen.terms_at(*place)))

    def rate(*place: Any) -> Array:
        read.add(_target_name("velocity"))
        return seen.graph.rate(*place)

    noted: Evaluator = replace(seen.graph, functions=Functions(seen.graph.functions), rate=rate)
    return replace(seen, terms_at=terms_at, graph=noted)


def _changes(
    targets: list[Target], most: int, rng: np.random.Generator
) -> Iterable[tuple[Target, Change]]:
    """Changes of every target, more of the longer ones."""
    possible = [changes(target.value) for target in targets]
    weights = np.sqrt([len(each) for each in possible])
    shares = np.floor((most - len(targets)) * weights / max(weights.sum(), 1.0)).astype(int) + 1
    for target, each, share in zip(targets, possible, shares):
        for index in sorted(rng.choice(len(each), min(share, len(each)), replace=False)):
            yield target, each[index]


def _planted(target: Target, change: Change, checks: tuple[Check, ...]) -> Mutation | None:
    """None where the change alters no number."""
    wrong = change.made()
    with np.errstate(all="ignore"):
        if _same(target, wrong):
            return None
        spoiled = target.planted(wrong)
        return Mutation(
            target.name, change.about, tuple(check.name for check in checks if _red(check, spoiled))
        )


def _same(target: Target, wrong: ca.SX) -> bool:
    """No number differs by more than roundoff, than what the states, closed to 1e-12, are
    themselves off the constraints, or than is promised to be seen."""
    largest = np.max(np.abs(target.sound), axis=0, initial=0.0)
    difference = np.abs(target.at_places(wrong, target.places) - target.sound)
    beside = np.abs(target.at_places(wrong, target.beside) - target.sound_beside)
    inexact = ROUNDOFF * target.roundoff + VANISHES * beside
    return bool(np.all(difference <= inexact + UNSEEN * largest + np.finfo(float).tiny))


def _red(check: Check, spoiled: Evidence) -> bool:
    try:
        error = check.error(spoiled)
    except np.linalg.LinAlgError:  # not even a number came of it
        return True
    return error is not None and not error <= check.tolerance
