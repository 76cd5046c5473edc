"""Linear forms: Σ coefficient · key, sparse, over unresolved generalized velocities ("v", j),
quasi-velocities ("w", k) and ONE.

A link's twist as six such forms is what the recursions carry from base to tip. Coefficients are SX
scalars or floats; an exact zero is never stored, so structure survives and nothing is multiplied by
it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from derive.expressions.scalars import Scalar
from derive.joints.rotations import is_zero, plus, times

Key = tuple[str, int]
Form = dict[Key, Scalar]
ONE: Key = ("one", 0)


def total(parts: Iterable[tuple[Scalar, Form]]) -> Form:
    """Σ weight · form."""
    result: Form = {}
    for weight, form in parts:
        if is_zero(weight):
            continue
        for key, coefficient in form.items():
            _accumulate(result, key, times(weight, coefficient))
    return {key: value for key, value in result.items() if not is_zero(value)}


def _accumulate(form: Form, key: Key, value: Scalar) -> None:
    form[key] = plus(form[key], value) if key in form else value


def constant(value: Scalar) -> Form:
    """A form that holds a number alone, {ONE: value}; the empty form for an exact zero, so that
    structure is kept."""
    return {} if is_zero(value) else {ONE: value}


def rotated(columns: Sequence[Sequence[Scalar]], forms: Sequence[Form]) -> list[Form]:
    """Rᵀ applied to three forms, R given by rows: from the parent's axes to the link's, which is
    the way that velocities go."""
    return [total((columns[j][i], forms[j]) for j in range(3)) for i in range(3)]


def crossed(forms: Sequence[Form], arm: Sequence[Scalar]) -> list[Form]:
    """forms × arm, three forms and a vector of scalars: ω × r as a form."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return [total(((arm[k], forms[j]), (-arm[j], forms[k]))) for j, k in pairs]


def added(*groups: Sequence[Form]) -> list[Form]:
    """Sums of forms, entry by entry: three and three of two twists, for example."""
    return [total((1.0, form) for form in forms) for forms in zip(*groups)]


def dotted(weights: Sequence[Scalar], forms: Sequence[Form]) -> Form:
    """Σ weightᵢ formᵢ: a direction times the three forms of a velocity, for example, is a velocity
    along it."""
    return total(zip(weights, forms))


def value(form: Form, values: dict[Key, Scalar]) -> Scalar:
    """The number a form stands for; ONE counts as 1."""
    result: Scalar = 0.0
    for key, coefficient in form.items():
        result = plus(result, coefficient if key == ONE else times(coefficient, values[key]))
    return result
