"""Equations whose directions are data of the generated module, with the usual numbers in their
place: what everything but the generated module looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.choices.records import Frame, Guard
from derive.expressions.deferred import Deferred, is_deferred, size_of
from derive.formulations.records import Equations, Family, Function, Request
from derive.mechanics.records import Named


def in_numbers(expressions: Sequence[ca.SX], frame: Frame) -> list[ca.SX]:
    """Expressions with the usual numbers in the place of the frame, together: what they share they
    go on sharing."""
    if not expressions:
        return []
    return ca.substitute(
        [ca.SX(x) for x in expressions], [frame.symbols], [ca.DM(list(frame.values))]
    )


def based(equations: Equations) -> Equations:
    """The equations for the usual frame: over the parameters of the model alone. A generated module
    can base its frame anew; references, linear equations and derivations look at one frame only."""
    frame = equations.frame
    if frame is None:
        return equations
    first = len(equations.system.own_parameters)
    slots = tuple(
        replace(
            slot,
            symbols=slot.symbols[:first, 0],
            labels=slot.labels[:first],
            units=slot.units[:first],
        )
        if slot.name == "p"
        else slot
        for slot in equations.arguments
    )
    return replace(
        equations,
        arguments=slots,
        functions=tuple(_function(function, frame) for function in equations.functions),
        named=_named(equations.named, frame),
        parameters=equations.system.own_parameters,
        requests=tuple(_request(request, frame) for request in equations.requests),
        families=tuple(_family(family, frame) for family in equations.families),
        charts=tuple(based(chart) for chart in equations.charts),
        frame=None,
    )


def _request(request: Request, frame: Frame) -> Request:
    if request.make is None:
        return request
    return replace(request, make=lambda: _function(request.function, frame))


def _family(family: Family, frame: Frame) -> Family:
    def make(name: str) -> Function:
        return _function(family.make(name), frame)

    return replace(family, make=make)


def _function(function: Function, frame: Frame) -> Function:
    """Result, guards, residual and named intermediates in one substitution."""
    residual = [] if function.residual is None else [function.residual]
    values = in_numbers(
        [
            function.result.value,
            *residual,
            *(guard.value for guard in function.guards),
            *(item.value for item in function.named),
        ],
        frame,
    )
    result, rest = values[0], values[1 + len(residual) :]
    count = len(function.guards)
    return replace(
        function,
        result=replace(function.result, value=result),
        residual=values[1] if residual else None,
        guards=tuple(_guard(guard, x) for guard, x in zip(function.guards, rest[:count])),
        named=tuple(replace(item, value=x) for item, x in zip(function.named, rest[count:])),
    )


def _guard(guard: Guard, value: ca.SX) -> Guard:
    return replace(guard, value=value)


def _named(named: tuple[Named, ...], frame: Frame) -> tuple[Named, ...]:
    """Together; what is deferred stays so."""
    formed = [item for item in named if not is_deferred(item, "value")]
    values = in_numbers([item.value for item in formed], frame)
    there = {item.name: value for item, value in zip(formed, values)}

    def later(item: Named) -> Deferred[ca.SX]:
        return Deferred(lambda: in_numbers([item.value], frame)[0], size_of(item, "value"))

    return tuple(
        Named(item.name, item.about, there[item.name] if item.name in there else later(item))
        for item in named
    )
