"""What each name of a model is called, on its page and in its figure: no two of them look alike."""

from __future__ import annotations

from collections.abc import Iterable

from derive.model.records import Coordinate, Model
from derive.textbook import names

PAGE: tuple[str, ...] = ("t", "T", "V", "P")  # what the page itself calls so


def labels(model: Model) -> dict[str, str]:
    """LaTeX of coordinates, generalized velocities, parameters, first-order states and inputs.

    Coordinates choose first, and their rates with them: they stand in every formula, with dots.
    """
    given, taken, found = dict(model.symbols), set(PAGE), dict[str, str]()
    rates = {x.rate_of for x in model.velocities}
    for x in _rates_last(model.coordinates):
        found[x.name] = unlike(x.name, names.symbol(x.name, given), taken)
        if x.name in rates:
            taken.add(names.dotted(found[x.name]))
    for x in model.velocities:
        found[x.name] = (
            names.dotted(found[x.rate_of])
            if x.rate_of
            else unlike(x.name, names.velocity(x.name, ""), taken)
        )
    for x in (*model.parameters, *model.states, *model.inputs):
        found[x.name] = unlike(x.name, names.symbol(x.name, given), taken)
    return found


def unlike(name: str, latex: str, taken: set[str]) -> str:
    """The LaTeX of a name, from now on taken; the name as it is spelled, upright, where something
    else looks so."""
    if latex in taken:
        latex = names.upright(name)
    latex = untaken(latex, taken)
    taken.add(latex)
    return latex


def untaken(latex: str, taken: set[str]) -> str:
    """With a tilde where something else looks the same."""
    while latex in taken:
        latex = rf"\tilde{{{latex}}}"
    return latex


def _rates_last(coordinates: Iterable[Coordinate]) -> list[Coordinate]:
    """x_dot after x: it would take the symbol of the rate of x."""
    return sorted(coordinates, key=lambda x: x.name.endswith("_dot"))
