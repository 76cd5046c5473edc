"""What an entry of `loads:` or `constraints:` is to the language: its keys, and how a record is
made of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from derive.model.document import Key
from derive.model.language.entries import BodyEntry, JointEntry
from derive.model.language.keys import Entry
from derive.model.language.place_entries import FrameEntry
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader

Record = TypeVar("Record", covariant=True)


class Bodies(Protocol):
    """The part of a file that entries may look at."""

    @property
    def bodies(self) -> Mapping[Any, BodyEntry]: ...

    @property
    def joints(self) -> Mapping[Any, JointEntry]: ...

    @property
    def frames(self) -> Mapping[Any, FrameEntry]: ...


@dataclass(frozen=True)
class Kind(Generic[Record]):
    """`entry` holds the keys, and its docstring is what `hamel list` says of the kind. `read` gives
    the record, or None after reporting that the entry says too little. An entry is told by `type:
    name`, or, with `by_key`, by having `name` as a key."""

    name: str
    entry: type[Entry]
    read: Callable[[Reader, Bodies, Names, Key, Any], Record]
    by_key: bool = False
