"""Terms that are formed when they are first read. What a long mechanism has a loop for need never
be written out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, overload

import casadi as ca


@dataclass(frozen=True)
class Deferred:
    """A column of that many entries, made on demand."""

    size: int
    make: Callable[[], ca.SX]


class Term:
    """A field of a record: an SX, or one that is deferred. Reading it gives the SX, made once."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"_{name}"

    @overload
    def __get__(self, record: None, owner: type) -> ca.SX: ...
    @overload
    def __get__(self, record: object, owner: type) -> ca.SX: ...
    def __get__(self, record: Any, owner: type) -> ca.SX:
        if record is None:
            raise AttributeError(self._name)  # dataclasses ask the class for a default
        value = vars(record)[self._name]
        if isinstance(value, Deferred):
            value = vars(record)[self._name] = value.make()
        return value

    def __set__(self, record: Any, value: ca.SX | Deferred) -> None:
        vars(record)[self._name] = value


def is_deferred(record: object, name: str) -> bool:
    """Whether the field has not been formed yet."""
    return isinstance(vars(record)[f"_{name}"], Deferred)


def size_of(record: object, name: str) -> int:
    """How many entries the field has, formed or not."""
    value = vars(record)[f"_{name}"]
    return value.size if isinstance(value, Deferred) else value.numel()


def passed_on(record: object, name: str) -> ca.SX | Deferred:
    """The field as another record takes it, not formed on the way."""
    if not is_deferred(record, name):
        return getattr(record, name)
    return Deferred(size_of(record, name), lambda: getattr(record, name))
