"""Equations → Document: the sections in the order a textbook has them."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

from derive.formulations import source
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.textbook import names
from derive.textbook.author import Author
from derive.textbook.charts import charts
from derive.textbook.choice import choice, inverse
from derive.textbook.complement import complement
from derive.textbook.given import given
from derive.textbook.interaction import interaction
from derive.textbook.kinematics import components, constraints, coordinates, links
from derive.textbook.linear import linearised
from derive.textbook.methods import method, nonideal
from derive.textbook.motion import (
    bordered,
    energies,
    multipliers,
    outputs,
    power,
    projected,
    unprojected,
)
from derive.textbook.records import Document, Math, Text

REFERENCES = (
    "Mirtaheri, Zohoor: Quasi-velocities definition in Lagrangian multibody dynamics. [A; B] stacked and inverted by blocks.",
    "Kane, Levinson: Dynamics, Theory and Applications, 1985. Generalised speeds and partial velocities.",
    "Maggi's equations: the equations of motion projected on the motions that the constraints allow.",
    "Jerkovsky 1978: the velocity transformation.",
    "Saha 1999: the decoupled natural orthogonal complement. Yu, Chen 2002: platform and arm of a mobile manipulator.",
    "Luh, Walker, Paul 1980: recursive Newton–Euler equations. Walker, Orin 1982: composite bodies.",
)


def derivation(equations: Equations) -> Document:
    """Every section, formulas numbered throughout."""
    equations = based(equations)
    found = components(equations.system)
    a = Author(equations, found)
    given(a)
    coordinates(a)
    links(a, found)
    constraints(a)
    choice(a)
    inverse(a)
    charts(a)
    energies(a, found)
    unprojected(a)
    nonideal(a)
    method(a)
    interaction(a)
    complement(a)
    if a.free_velocities:
        bordered(a)
    else:
        projected(a)
    multipliers(a)
    power(a)
    outputs(a)
    linearised(a)
    _symbols(a)
    _references(a)
    return a.document(_title(equations), _subtitle(equations), _version())


def _title(equations: Equations) -> str:
    return f"Equations of motion: {equations.system.model.name}"


def _subtitle(equations: Equations) -> str:
    if equations.generalized_velocities:
        return f"generalized velocities, formulation {equations.formulation}"
    return f"explicit, without multipliers; quasi-velocities “{equations.choice}”"


def _version() -> str:
    try:
        return version("hamel")
    except PackageNotFoundError:
        return ""


def _symbols(a: Author) -> None:
    a.section("Symbols")
    a.say(
        "Bold letters are matrices and columns; the same letter with indices is an entry, its row before its column."
    )
    rows = [((Math(x.latex),), (Text(x.about),), (Text(names.unit(x.unit)),)) for x in a.meanings]
    a.table(("symbol", "meaning", "unit"), rows)


def _references(a: Author) -> None:
    a.section("Sources of the methods")
    a.items((Text(x),) for x in (source(a.equations.formulation), *REFERENCES))
    for text in a.equations.assumptions:
        a.say("Assumed: {text}.", text=text)
