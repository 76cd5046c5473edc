"""list: everything hamel knows by name, or everything one model names, a line each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from os import PathLike
from typing import TYPE_CHECKING, Any

from codegen.integrators import AUTO, AUTOMATIC, INTEGRATORS
from codegen.targets import ON_REQUEST, TARGETS
from derive.enforcement import ENFORCEMENTS
from derive.formulations import FORMULATIONS, equations
from derive.linearize.minimal import with_linearization
from derive.model import KINDS, load_text
from derive.robots.reading import load
from hamel.build.stages import mechanics_of
from hamel.records import Known, Listed
from hamel.simulate.libraries import REFERENCES

if TYPE_CHECKING:
    from rich.console import Console

    from derive.model.records import Model


# A model that has every kind of thing a function of the generated module is about.
_EVERYTHING = """
model: everything
coordinates: {x: m, y: m}
kinetic: (der(x)**2 + der(y)**2)/2 * 1 kg
constraints: {rod: {holonomic: x**2 + y**2 - 1 m^2}}
inputs: {push: {coordinate: x}}
outputs: {height: y}
initial: {x: 0.6 m, guess: {y: 0.8 m}}
"""
_AUTO = Known(
    AUTO,
    f"one of {', '.join(AUTOMATIC)}, by the tolerance and the number of motions; radau where that "
    "is stiff",
)


def run(path: str | PathLike[str] | None) -> Listed:
    """Without a path what hamel offers by name, with one what the model names."""
    return Listed(_catalogue()) if path is None else Listed(_named(path))


def _catalogue() -> dict[str, tuple[Known, ...]]:
    """From the registries the stages loop over themselves, so that nothing can be missing here."""
    kinds: dict[str, list[Known]] = {}
    for category, name, about in KINDS:
        kinds.setdefault(f"{category}s", []).append(Known(name, about))
    return {
        **{kind: tuple(names) for kind, names in kinds.items()},
        "formulations": _abouts(FORMULATIONS),
        "enforcements": _abouts(ENFORCEMENTS),
        "integrators": (*_abouts(INTEGRATORS), _AUTO, *_abouts(REFERENCES)),
        "targets": _abouts(TARGETS),
        "targets on request": _abouts(ON_REQUEST),
        **{kind: tuple(names) for kind, names in _functions(load_text(_EVERYTHING)).items()},
    }


def _abouts(registry: Iterable[Any]) -> tuple[Known, ...]:
    return tuple(Known(item.name, item.about, getattr(item, "source", "")) for item in registry)


def _named(path: str | PathLike[str]) -> dict[str, tuple[Known, ...]]:
    model = load(path)
    kinds = {
        "parameters": (
            Known(p.name, _line(f"{p.value:.6g} {p.unit}", p.about)) for p in model.parameters
        ),
        "bodies": (Known(body.name, "body") for body in model.bodies),
        "joints": (
            Known(j.name, f"{j.type}, {j.parent} to {j.child}: {', '.join(j.coordinates)}")
            for j in model.joints
        ),
        "frames": (Known(f.name, f"on {f.body}") for f in model.frames),
        "closures": (Known(c.name, f"{c.type}, {' and '.join(c.bodies)}") for c in model.closures),
        "constraints": (Known(c.name, _kind(c)) for c in model.constraints),
        "loads": (Known(load.name, _kind(load)) for load in model.loads),
        "inputs": (
            Known(i.name, _line(f"{i.velocity or 'used in formulas'}, {i.unit}", i.about))
            for i in model.inputs
        ),
        "states": (
            Known(s.name, _line(f"first order, {s.unit or 'plain'}", s.about)) for s in model.states
        ),
        "outputs": (Known(o.name, _line(o.text, o.unit)) for o in model.outputs),
        "coordinates": (Known(c.name, c.unit) for c in model.coordinates),
        "velocities": (Known(v.name, v.unit) for v in model.velocities),
        "choices": _choices(model),
        **_functions(model),
    }
    listed = {kind: tuple(names) for kind, names in kinds.items()}
    return {kind: names for kind, names in listed.items() if names}


def _line(*parts: str) -> str:
    return ", ".join(part for part in parts if part)


def _kind(item: object) -> str:
    """NoSlip → "no slip": the records are named after what they are."""
    name = type(item).__name__
    return "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()


def _choices(model: Model) -> Iterator[Known]:
    for choice in model.choices:
        yield Known(choice.name, ", ".join(name for name, _ in choice.rows) or choice.kind)


def _functions(model: Model) -> dict[str, Iterable[Known]]:
    """The functions of the generated module, by the model's first choice, those that are emitted
    when asked for by name, and those that a build refuses, with its reason."""
    result = with_linearization(equations(mechanics_of(model)))
    requests = [(request, request.refusal) for request in result.requests]
    return {
        "functions": (Known(f.name, f.about) for f in result.functions if f.result.size),
        "functions on request": (Known(x.name, x.about) for x, refusal in requests if not refusal),
        "functions refused": (
            Known(x.name, refusal.diagnostics[0].message) for x, refusal in requests if refusal
        ),
        "frame functions": (
            Known(f"{family.name}_FRAME", family.about) for family in result.families
        ),
    }


def show(record: Listed, console: Console) -> None:
    """A line per name under the heading of its kind, all aligned."""
    width = max((len(item.name) for names in record.kinds.values() for item in names), default=0)
    for kind, names in record.kinds.items():
        console.print(kind)
        for item in names:
            console.print(f"  {item.name:<{width}}  {item.about}".rstrip())
