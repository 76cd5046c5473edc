"""Terms that are formed when they are first read. What a long mechanism has a loop for need never
be written out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, Generic, TypeVar, cast, overload

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Deferred(Generic[T]):
    """What is made on demand; of a column `size` says how many entries it will have."""

    make: Callable[[], T]
    size: int = 1


class OnDemand(Mapping[str, T]):
    """Values by name, each of them made when it is first read."""

    def __init__(self, makes: Mapping[str, Callable[[], T]]) -> None:
        self._makes = dict(makes)
        self._made: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self._made:
            self._made[name] = self._makes[name]()
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makes)

    def __len__(self) -> int:
        return len(self._makes)


class Term(Generic[T]):
    """A field of a record: a value, or one that is deferred. Reading it gives the value, made
    once."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"_{name}"

    @overload
    def __get__(self, record: None, owner: type) -> T: ...
    @overload
    def __get__(self, record: object, owner: type) -> T: ...
    def __get__(self, record: Any, owner: type) -> T:
        if record is None:
            raise AttributeError(self._name)  # dataclasses ask the class for a default
        own = cast("dict[str, Any]", record.__dict__)
        if isinstance(own[self._name], Deferred):
            own[self._name] = cast("Deferred[T]", own[self._name]).make()
        value: T = own[self._name]
        return value

    def __set__(self, record: Any, value: T | Deferred[T]) -> None:
        vars(record)[self._name] = value


def is_deferred(record: object, name: str) -> bool:
    """Whether the field has not been formed yet."""
    return isinstance(vars(record).get(f"_{name}"), Deferred)


def size_of(record: object, name: str) -> int:
    """How many entries the field has, formed or not."""
    value = vars(record)[f"_{name}"]
    return value.size if isinstance(value, Deferred) else value.numel()


def passed_on(record: object, name: str) -> Any:
    """The field as another record takes it, not formed on the way."""
    if not is_deferred(record, name):
        return getattr(record, name)
    return Deferred(lambda: getattr(record, name), size_of(record, name))


def changed(record: R, **changes: Any) -> R:
    """The record with other values; what is deferred stays so, where `replace` would form it."""
    own = {f.name: passed_on(record, f.name) for f in fields(record) if f.name not in changes}  # type: ignore[arg-type]
    return type(record)(**own, **changes)
