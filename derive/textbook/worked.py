"""Worked numbers: every printed formula at the model's initial state."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from derive.diagnostics import HamelError
from derive.formulations.records import Equations
from derive.states.initial import initial_state
from derive.textbook.records import Document

WORDS = "at the model's initial state, all inputs zero"


def with_numbers(document: Document, equations: Equations) -> Document:
    """The document with the values of its formulas, over SI units; without any where the file has
    no initial state that satisfies the constraints."""
    system = equations.system
    try:
        initial = initial_state(system)
    except HamelError:  # whoever simulates is told why
        return document
    values = [ca.vec(ca.densify(formula.value).T) for formula in document.printed]
    x = equations.argument("x").symbols[equations.speeds, 0]
    if equations.generalized_velocities:
        w, free = ca.SX(0, 1), ca.SX(0, 1)
    else:
        w, free = ca.mtimes(equations.term("B"), system.v), x
    symbols = [system.t, system.q, system.v, system.u, system.p]
    # the quasi-velocities are not put into the terms, which would unfold what they share
    speeds = ca.Function("speeds", symbols, [ca.densify(w)])
    place = [0.0, initial.q, initial.v, np.zeros(system.u.numel()), np.array(system.parameters)]
    here = speeds(*place)
    function = ca.Function("numbers", [*symbols, free], [ca.vertcat(*values)])
    whole = np.asarray(function(*place, here)).ravel()
    ends = np.cumsum([value.numel() for value in values])
    parts = np.split(whole, ends[:-1])
    numbers = tuple(tuple(float(x) for x in part) for part in parts)
    return replace(document, numbers=numbers, state=WORDS)
