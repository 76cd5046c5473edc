"""What a model file says of motions beside the mechanics, as pydantic classes: choices, initial
states, events, steady motions, published values and extreme cases."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from derive.model.language.keys import (
    Constant,
    ConstantOrList,
    Entry,
    Formula,
    Formulas,
    Name,
    NameList,
    Text,
    Word,
    is_list,
    is_mapping,
    is_scalar,
    term,
    told_by,
)


class ReferenceEntry(Entry):
    """Published values that `hamel verify` holds the model to."""

    source: Text = Field(
        description="Where the numbers are from.",
        json_schema_extra=term("nothing; it stands in the report of verify"),
    )
    time: Constant | None = Field(
        None,
        description="When, in seconds after the initial state.",
        json_schema_extra=term("t of the comparison", "s", "0"),
    )
    tolerance: Constant = Field(
        description="Relative error that is allowed.",
        json_schema_extra=term("bound of the relative error", "1"),
    )
    values: dict[Name, Constant] = Field(
        {},
        description="Coordinates, velocities, outputs (tip[0]) and the energies T and V.",
        json_schema_extra=term("q, v, y, T, V at that time, in their units"),
    )
    accelerations: dict[Name, Constant] = Field(
        {},
        description="Rates of the generalized velocities, such as der(q1).",
        json_schema_extra=term("v̇ at that time, in their units"),
    )


class ExtremeEntry(Entry):
    """An extreme case of the model, which `hamel extremes` simulates and judges."""

    about: Text | None = Field(
        None,
        description="What is extreme about it.",
        json_schema_extra=term("nothing; for readers"),
    )
    set: dict[Name, Constant] = Field(
        {},
        description="Initial values, parameters and inputs, as with `hamel simulate --set`.",
        json_schema_extra=term("x, p and u at t = 0, in their units"),
    )
    time: Constant | None = Field(
        None,
        description="The end of the motion, in seconds.",
        json_schema_extra=term("end of the motion", "s"),
    )
    spoiled: Word | None = Field(
        None,
        description="`all`, instead of a motion: NaN, ±Inf, the least denormal and 1e300 in "
        "every argument of every function.",
        json_schema_extra=term("arguments of all functions"),
    )
    integrator: Word | None = Field(
        None,
        description="How to step.",
        json_schema_extra=term("the method of steps", otherwise="dop853"),
    )
    enforcement: Word | None = Field(
        None,
        description="How to stay on the constraints.",
        json_schema_extra=term("how φ = 0 and A v = c are kept", otherwise="projection"),
    )
    choice: Word | None = Field(
        None,
        description="The choice of quasi-velocities.",
        json_schema_extra=term("w", otherwise="the file's first"),
    )
    real: Word | None = Field(
        None,
        description="What the code computes in: float64 or float32.",
        json_schema_extra=term("the floating-point numbers of the C code", otherwise="float64"),
    )
    rtol: Constant | None = Field(
        None,
        description="Relative tolerance of a step.",
        json_schema_extra=term("error that a step may have", "1", "1e-11, in float32 1e-6"),
    )
    tolerance: Constant | None = Field(
        None,
        description="Relative error that is allowed.",
        json_schema_extra=term("bound of the relative error at the end", "1", "only reported"),
    )
    end: dict[Name, Constant] = Field(
        {},
        description="Coordinates and velocities at the end, in closed form.",
        json_schema_extra=term(
            "q and v at the end, in their units", otherwise="computed with many digits"
        ),
    )
    refused: Text | None = Field(
        None,
        description="For a case that must be refused: words of the message.",
        json_schema_extra=term("nothing; what `hamel extremes` expects"),
    )


class EventEntry(Entry):
    formula: Formula = Field(
        description="What changes its sign: of coordinates, velocities, outputs and t.",
        json_schema_extra=term("the function whose zeros are looked for along a motion"),
    )
    direction: Word | None = Field(
        None,
        description="rising, falling, or both.",
        json_schema_extra=term("sign of its rate where a zero counts", otherwise="both"),
    )
    stop: Word | None = Field(
        None,
        description="true: the motion ends there; false: it is counted.",
        json_schema_extra=term("the end of the motion", otherwise="false"),
    )


EventOrFormula = Annotated[
    Annotated[Formula, Tag("<a formula>")] | Annotated[EventEntry, Tag("<a mapping>")],
    told_by(**{"a formula": is_scalar, "a mapping": is_mapping}),
]


Choice = Annotated[
    Annotated[Word, Tag("<a kind>")]
    | Annotated[Formulas, Tag("<a list of formulas>")]
    | Annotated[dict[Name, Formula], Tag("<a mapping of names to formulas>")],
    told_by(
        **{
            "a kind": is_scalar,
            "a list of formulas": is_list,
            "a mapping of names to formulas": is_mapping,
        }
    ),
]


Initial = Annotated[
    Annotated[Constant, Tag("<a number>")] | Annotated[dict[Name, Constant], Tag("<a mapping>")],
    told_by(**{"a number": is_scalar, "a mapping": is_mapping}),
]


Held = Annotated[
    Annotated[Constant, Tag("<a formula>")]
    | Annotated[NameList, Tag("<a list of names>")]
    | Annotated[dict[Name, ConstantOrList], Tag("<a mapping>")],
    told_by(**{"a formula": is_scalar, "a list of names": is_list, "a mapping": is_mapping}),
]
