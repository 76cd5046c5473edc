"""What a live page calls beside the functions of a module: where the bodies are, and what every
printed formula is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.formulations.records import Equations, Function, Result
from derive.textbook.records import Display, Document
from hamel.draw.mechanism.poses import Bodies

POSES, FORMULAS = "live_poses", "live_formulas"
Place = tuple[int, int]  # where the values of a formula begin, and how many of them are in a row


def with_live(equations: Equations, document: Document, bodies: Bodies) -> Equations:
    """The equations with two functions more, over (t, x, u, p):

    `live_poses` are twelve numbers a body, a rotation row by row and a position (m);
    `live_formulas` are the values of all printed formulas, one after the other, row by row.
    """
    further = [_poses(equations, bodies)]
    values = [ca.vec(ca.densify(formula.value).T) for formula in document.printed]
    if values:
        further.append(_function(FORMULAS, "values of all formulas", _at_x(equations, values)))
    return replace(equations, functions=(*equations.functions, *further))


def _poses(equations: Equations, bodies: Bodies) -> Function:
    s = equations.system
    value = bodies.function(s.t, s.q, s.own_p)
    return _function(POSES, "rotation and position of every body", value)


def _at_x(equations: Equations, values: Sequence[ca.SX]) -> ca.SX:
    """Over the quasi-velocities: formulas are written with v and with w."""
    system = equations.system
    velocity = equations.function("velocity").result.value
    return ca.substitute(ca.vertcat(*values), system.v, velocity)


def _function(name: str, about: str, value: ca.SX) -> Function:
    labels = tuple(str(k) for k in range(value.numel()))
    return Function(name, about, Result(name, ca.densify(value), labels, ("",) * value.numel()))


def places(document: Document) -> dict[int, list[list[int]]]:
    """By number of a displayed equation, for each of its lines that has numbers: where they begin
    among the values, how many there are and how many are in a row."""
    starts = [0]
    for formula in document.printed:
        starts.append(starts[-1] + formula.value.numel())
    found: dict[int, list[list[int]]] = {}
    for section in document.sections:
        for block in section.blocks:
            if isinstance(block, Display):
                lines = [line.place for line in block.lines if line.place is not None]
                if lines:
                    found[block.number] = [_range(document, starts, *place) for place in lines]
    return found


def _range(document: Document, starts: Sequence[int], formula: int, entry: int) -> list[int]:
    if entry >= 0:
        return [starts[formula] + entry, 1, 1]
    value = document.printed[formula].value
    return [starts[formula], value.numel(), value.shape[1]]
