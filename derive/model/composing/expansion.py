"""A model file written out: repetitions and submodels become plain entries, with their places."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions.quantities import quantity, unit
from derive.model.composing.composition import Composition, SubmodelEntry
from derive.model.composing.files import file_beside
from derive.model.composing.renaming import as_part, merged, sections_of_names, with_parameters
from derive.model.composing.repetition import Index, Repetition, indices
from derive.model.document import MOST_VALUES, Entries, Key, Node, Scalar, Source, parsed
from derive.model.language.structure import shaped
from derive.model.records import Span

DEEPEST = 8  # files that use each other, one inside the other
MOST = 10_000  # submodels in all
# a file without any of these has nothing to write out: `repeat:`, `submodels:`, a name with {i}
_COMPOSED = re.compile(r"repeat|submodels|\w\{|\\")


def expanded(node: Entries, source: Source) -> Entries:
    """The entries of a file with its repetitions and submodels written out.

    Raises ModelError at repetitions without end, at what is too much, at a file that cannot be
    read or that uses itself, at unknown indices and parameters.
    """
    if not _COMPOSED.search(source.text):
        return node
    return _Writer(source).whole(node, _Use((Path(source.file).name,), ""))


@dataclass(frozen=True)
class _Use:
    """The files from the model's own to the one that is read, and how messages say that."""

    files: tuple[str, ...]
    where: str


class _Writer:
    """Counts what is written over all the files."""

    def __init__(self, source: Source) -> None:
        self.source, self.values, self.submodels = source, 0, 0
        self.read: dict[str, Entries] = {}

    def whole(self, node: Entries, use: _Use) -> Entries:
        """A file written out, submodels included."""
        own = Entries({k: v for k, v in node.items() if k == "repeat"}, node.span)
        repeat = shaped(Composition, own, self.source).repeat
        known = indices(repeat, self.source)
        rest = Entries({k: v for k, v in node.items() if k != "repeat"}, node.span)
        written = self._written(rest, known, use)
        given = Entries({k: written.pop(k) for k in list(written) if k == "submodels"}, node.span)
        parts = shaped(Composition, given, self.source).submodels
        for key, entry in parts.items():
            part = self._part(key, entry, use, written.get("plane"))
            written = merged(written, part, self.source)
        self._check_indices(repeat, written, use)
        return written

    def _check_indices(self, given: Mapping[Key, Any], written: Entries, use: _Use) -> None:
        """That no index has a name that formulas could mean: its number would stand there."""
        sections = sections_of_names(written) if given else {}
        for key in given:
            if key in sections:
                self.source.refuse(
                    replace(key.span, where=use.where),
                    f"the index '{key}' is a name under '{sections[key]}:', too",
                    "another name for one of the two",
                    f"in formulas of repeated entries '{key}' is the number of the index",
                )

    def _written(self, node: Entries, known: dict[str, Index], use: _Use) -> Entries:
        repetition = Repetition(known, self.source, MOST_VALUES - self.values)
        written = repetition.written_out(node, {}, use.where)
        self.values += repetition.count
        assert isinstance(written, Entries)
        return written

    def _check_plane(self, own: Node | None, part: Entries) -> None:
        other = part.get("plane")
        said = f"in the plane {own.text}" if isinstance(own, Scalar) else "in space"
        given = f"in the plane {other.text}" if isinstance(other, Scalar) else "in space"
        if said != given:
            span = other.span if isinstance(other, Scalar) else part.span
            expected = "the same plane in both, or both in space"
            self.source.refuse(span, f"a submodel {given} of a model {said}", expected)

    def _part(self, key: Key, entry: SubmodelEntry, use: _Use, plane: Node | None) -> Entries:
        self.submodels += 1
        if self.submodels > MOST:
            self.source.refuse(key.span, f"more than {MOST} submodels", "fewer")
        name, text = self._file(entry.use, use)
        if name not in self.read:
            self.read[name] = self._parsed(name, text, entry.use.span)
        inner = self.whole(self.read[name], _Use((*use.files, name), self._said(key)))
        self._check_plane(plane, inner)
        self._check_parameters(entry, inner, name)
        return as_part(with_parameters(inner, key, entry), key, entry, self.source)

    def _file(self, given: Scalar, use: _Use) -> tuple[str, str]:
        """The file's name from the model's folder on, and its text."""
        name, text = file_beside(self.source, given)
        if name in use.files:
            circle = " → ".join((*use.files[use.files.index(name) :], name))
            self.source.refuse(
                given.span, f"'{name}' uses itself: {circle}", "files without a circle"
            )
        if len(use.files) > DEEPEST:
            self.source.refuse(given.span, "submodels inside each other", f"at most {DEEPEST} deep")
        return name, text

    def _parsed(self, name: str, text: str, span: Span) -> Entries:
        folder = self.source.folder
        assert folder is not None  # or there would be no text
        number = len(self.source.others) + 1
        other = Source(text, str(folder / name) if str(folder) != "." else name, folder, number)
        self.source.others.append(other)
        try:
            return parsed(other)
        except ModelError as error:
            used = f"the file is used at {self.source.file}:{span.line}:{span.column}"
            raise ModelError([replace(each, where=used) for each in error.diagnostics]) from None

    def _said(self, key: Key) -> str:
        by = self.source.others[key.span.file - 1].file if key.span.file else self.source.file
        place = f"{key} is used at {by}:{key.span.line}:{key.span.column}"
        return f"{place}, {key.span.where}" if key.span.where else place

    def _check_parameters(self, entry: SubmodelEntry, inner: Entries, name: str) -> None:
        """That parameters are those of the file."""
        section = inner.get("parameters")
        known: dict[str, Any] = section if isinstance(section, Entries) else {}
        for given, number in entry.parameters.items():
            if given in known:
                self._check_unit(given, number, known[given], name)
            else:
                self.source.refuse(
                    given.span,
                    f"'{given}' is no parameter of {name}",
                    listed(known) or "no parameters: the file has none",
                    did_you_mean(given, known),
                )

    def _check_unit(self, given: Key, number: Scalar, own: Node, name: str) -> None:
        """That a number for a parameter has the unit that it has in the file."""
        held = own.get("value") if isinstance(own, Entries) else own
        there = quantity(held.text) if isinstance(held, Scalar) else None
        here = quantity(number.text)
        if there is None or here is None or not there.unit or not here.unit:
            return
        if unit(there.unit).dimension != unit(here.unit).dimension:
            message = f"the parameter '{given}' of {name} in {here.unit}"
            self.source.refuse(number.span, message, there.unit)
