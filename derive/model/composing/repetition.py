"""Repetition: entries whose names hold an index in braces, such as `link{i}`, stand once for every
value that `repeat:` gives the index.

    repeat: {i: 1..40}
    bodies:
      link{i}: {mass: m*i, com: [l/2, 0]}

In braces stand formulas of indices, {i-1} or {mod(i, 40) + 1}; in the formulas of an entry the
index alone is its number. An entry of a list is repeated too, where it, or what stands under its
keys, holds an index that is not fixed by the names above it.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.evaluate import float_functions, value
from derive.expressions.functions import FUNCTIONS, INDEX_FUNCTIONS, OUTPUT_FUNCTIONS, Function
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.units import UNITS
from derive.model.document import Entries, Items, Key, Node, Scalar, Source
from derive.model.names import objection
from derive.model.records import Span

Value = int | str
Binding = Mapping[str, Value]

MOST = 10_000  # repetitions of one entry
LARGEST = 10**9  # of an index, and of what is computed of indices
AXES = ("x", "y", "z")  # `axis: x`, and the letters of a `surface:`
# what stands under these keys is a word or for readers, and no formula
WORDS = frozenset(
    {"type", "about", "description", "euler", "unit", "source", "plane", "use", "file", "smooth"}
)
READERS = frozenset({"about", "description", "source"})
_BRACES = re.compile(r"\{([^{}]*)\}")
_RANGE = re.compile(r"\s*([+-]?\d{1,18})\s*\.\.\s*([+-]?\d{1,18})\s*\Z")
_OPEN = re.compile(r"\s*[+-]?\d+\s*\.\.\s*\Z")
_CALLED = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\s*\(")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_FORMULA_FUNCTIONS = {**FUNCTIONS, **OUTPUT_FUNCTIONS}


@dataclass(frozen=True)
class Index:
    """A name of `repeat:` and its values, whole numbers or words."""

    name: str
    values: tuple[Value, ...]


def indices(given: Mapping[Key, Scalar | Items], source: Source) -> dict[str, Index]:
    """The indices of `repeat:`. Raises ModelError at one without an end."""
    return {str(key): _index(key, entry, source) for key, entry in given.items()}


def _index(key: Key, given: Scalar | Items, source: Source) -> Index:
    if problem := objection(key):
        source.refuse(key.span, *problem)
    if key in UNITS:
        source.refuse(key.span, f"the index '{key}' is a unit", "another name, such as i")
    if key in AXES:
        source.refuse(key.span, f"the index '{key}' is an axis", "another name, such as i")
    values = _range(given, source) if isinstance(given, Scalar) else _list(given, source)
    if len(values) > MOST:
        source.refuse(given.span, f"{len(values)} repetitions", f"at most {MOST}")
    return Index(str(key), tuple(values))


def _range(given: Scalar, source: Source) -> range:
    expected = "a range such as 1..40, or a list in [ ]"
    if _OPEN.match(given.text):
        source.refuse(given.span, f"the range '{given.text}' has no end", expected)
    match = _RANGE.match(given.text)
    if match is None:
        source.refuse(given.span, f"'{given.text}' is no range of whole numbers", expected)
    first, last = int(match[1]), int(match[2])
    if last < first:
        source.refuse(given.span, f"the range '{given.text}' holds nothing", f"{last}..{first}")
    return range(first, last + 1)


def _list(given: Items, source: Source) -> list[Value]:
    if not given:
        source.refuse(given.span, "a list of nothing", "numbers or words")
    values = [_element(entry, source) for entry in given]
    for value_, entry in zip(values, given):
        if values.count(value_) > 1:
            source.refuse(entry.span, f"'{entry.text}' stands twice in the list", "each once")
    return values


def _element(entry: Scalar, source: Source) -> Value:
    if re.fullmatch(r"[+-]?\d{1,9}", entry.text):
        return int(entry.text)
    if not re.fullmatch(r"[A-Za-z0-9_]+", entry.text):
        source.refuse(
            entry.span, f"'{entry.text}' as the value of an index", "a whole number or a word"
        )
    return entry.text


class Repetition:
    """Writes out what stands for several. Raises ModelError beyond `most` values in all."""

    def __init__(self, known: Mapping[str, Index], source: Source, most: int) -> None:
        self.known, self.source, self.most = known, source, most
        self.count = 0
        words = "|".join(map(re.escape, known))
        self.bare = re.compile(rf"\b(?:{words})\b") if known else None

    def written_out(self, node: Node, bound: Binding, where: str = "", key: str = "") -> Node:
        """The value with indices put in; `key` is what it stands under."""
        self._count(node)
        if isinstance(node, Scalar):
            return self._scalar(node, bound, where, key)
        if isinstance(node, Items):
            return Items(list(self._entries(node, bound, where, key)), _at(node.span, where))
        return Entries(dict(self._pairs(node, bound, where)), _at(node.span, where))

    def _count(self, node: Node) -> None:
        self.count += 1
        if self.count > self.most:
            message = f"repetitions write out more than {self.most} values"
            self.source.refuse(node.span, message, "fewer repetitions")

    def _pairs(self, node: Entries, bound: Binding, where: str) -> Iterator[tuple[Key, Node]]:
        places: dict[str, Span] = {}
        for key, entry in node.items():
            assert isinstance(key, Key)
            for binding, inner in self._bindings(key, key.span, bound, where):
                name = Key(self._braced(key, key.span, binding, inner), _at(key.span, inner))
                if name in places:
                    self._refuse_twice(name, places[name])
                places[name] = key.span
                yield name, self.written_out(entry, binding, inner, key)

    def _refuse_twice(self, name: Key, first: Span) -> None:
        place = f"line {first.line}, column {first.column}"
        self.source.refuse(
            name.span, f"'{name}' is given twice; first on {place}", "one of the two"
        )

    def _entries(self, node: Items, bound: Binding, where: str, key: str) -> Iterator[Node]:
        for entry in node:
            texts = list(self._texts(entry, key))
            span = texts[0].span if texts else entry.span
            text = " ".join(x.text for x in texts)
            for binding, inner in self._bindings(text, span, bound, where):
                yield self.written_out(entry, binding, inner, key)

    def _texts(self, node: Node, key: str) -> Iterator[Scalar]:
        """What may hold indices that repeat an entry of a list: the text that it is, or those under
        its keys. Lists in it, and keys with braces, repeat entries of their own."""
        if isinstance(node, Scalar):
            if "{" in node.text and key not in READERS and not self._is_latex(key, node.text):
                yield node
        elif isinstance(node, Entries):
            for inner, entry in node.items():
                if "{" not in inner:
                    yield from self._texts(entry, inner)

    def _bindings(
        self, text: str, span: Span, bound: Binding, where: str
    ) -> Iterator[tuple[Binding, str]]:
        """What the indices are that a text holds in braces and that are not bound yet."""
        free = self._free(text, span, bound)
        if not free:
            yield bound, where
            return
        count = 1
        for index in free:
            count *= len(index.values)
        if count > MOST:
            self.source.refuse(span, f"'{text}' stands for {count} entries", f"at most {MOST}")
        for values in product(*(index.values for index in free)):
            bindings = {index.name: value_ for index, value_ in zip(free, values)}
            said = ", ".join(f"{name} = {value_}" for name, value_ in bindings.items())
            yield {**bound, **bindings}, f"{where}, {said}" if where else said

    def _free(self, text: str, span: Span, bound: Binding) -> list[Index]:
        if "{" not in text:
            return []
        names = [word for inside in _BRACES.findall(text) for word in _WORD.findall(inside)]
        wanted = dict.fromkeys(name for name in names if name not in INDEX_FUNCTIONS)
        for name in wanted:
            if name not in self.known:
                self._refuse_unknown(name, span)
        return [self.known[name] for name in wanted if name not in bound]

    def _refuse_unknown(self, name: str, span: Span) -> None:
        hint = (
            did_you_mean(name, self.known) or f"say repeat: {{{name}: 1..3}} at the top of the file"
        )
        expected = listed(self.known) or "an index of `repeat:`"
        self.source.refuse(span, f"unknown index '{name}'", expected, hint)

    def _scalar(self, node: Scalar, bound: Binding, where: str, key: str) -> Scalar:
        if self._is_latex(key, node.text):
            return replace(node, span=_at(node.span, where))
        if key in READERS:
            text = self._for_readers(node.text, node.span, bound, where)
        else:  # the braces of an index below a symbol stay around its number: q_{12}
            kept = _BRACES.sub(r"{{\1}}", node.text) if key == "symbol" else node.text
            text = self._braced(kept, node.span, bound, where)
        if key not in WORDS and self.bare is not None and self.bare.search(text):
            text = _with_numbers(text, bound)
        return Scalar(text, _at(node.span, where), node.exact and text == node.text, node.plain)

    def _is_latex(self, key: str, text: str) -> bool:
        """Whether braces in it name no index, as those of the symbol q_{12}."""
        held = [_names(inside) for inside in _BRACES.findall(text)]
        return key == "symbol" and (
            "\\" in text or not any(x and x <= self.known.keys() for x in held)
        )

    def _for_readers(self, text: str, span: Span, bound: Binding, where: str) -> str:
        """With the values of braces that hold an index; others are the text's own: in
        "chassis {1}", too."""

        def written(found: re.Match[str]) -> str:
            names = _names(found[1])
            own = not names or not names <= bound.keys()
            return found[0] if own else self._braced(found[0], span, bound, where)

        return _BRACES.sub(written, text)

    def _braced(self, text: str, span: Span, bound: Binding, where: str) -> str:
        if "{" not in text:
            return text
        if free := self._free(text, span, bound):
            self.source.refuse(
                _at(span, where),
                f"the index '{free[0].name}' is not fixed here",
                f"{{{free[0].name}}} in the name of the entry that this is part of",
            )
        try:
            return _BRACES.sub(lambda found: str(_inside(found[1], bound)), text)
        except FormulaError as error:
            message, expected, hint = error.detail
            self.source.refuse(_at(span, where), message, expected, hint)


def _names(inside: str) -> frozenset[str]:
    """The indices that are named between braces."""
    return frozenset(_WORD.findall(inside)) - INDEX_FUNCTIONS.keys()


def _at(span: Span, where: str) -> Span:
    return Span(span.line, span.column, span.length, span.file, where) if where else span


@cache
def _parsed(text: str) -> tree.Expression:
    return expression(text, functions=INDEX_FUNCTIONS)


def _inside(text: str, bound: Binding) -> Value:
    """The value of what stands in a pair of braces."""
    if text.strip() in bound:
        return bound[text.strip()]
    formula = _parsed(text)
    for node in tree.walk(formula):
        if isinstance(node, tree.Name) and isinstance(bound[node.name], str):
            raise FormulaError(f"the index '{node.name}' is a word", expected="a number here")
    functions: Mapping[str, Callable[..., Any]] = {**float_functions(), "mod": operator.mod}
    floats = {name: float(given) for name, given in bound.items() if isinstance(given, int)}
    try:
        number = value(formula, floats, {}, functions)
    except (ArithmeticError, ValueError, KeyError):
        raise FormulaError(f"{{{text}}} has no value", expected="a whole number") from None
    if abs(number) > LARGEST or number != int(number):
        raise FormulaError(f"{{{text}}} is {number:.6g}", expected="a whole number")
    return int(number)


def with_called(text: str, functions: Mapping[str, Function]) -> Mapping[str, Function]:
    """The functions, and what else a text calls like one: tables, which are looked up later."""
    called = {name for name in _CALLED.findall(text) if name not in functions and name != "der"}
    return {**functions, **{name: Function(name, (1, 32), "table", "") for name in called}}


def _with_numbers(text: str, bound: Binding) -> str:
    """A formula with the numbers of its indices in it; what is no formula stays as it is."""
    try:
        functions = with_called(text, _FORMULA_FUNCTIONS)
        formula = expression(text, names=bound, functions=functions, vectors=True)
    except FormulaError:
        return text
    places = {
        node.at: node.name
        for node in tree.walk(formula)
        if isinstance(node, tree.Name) and node.name in bound
    }
    for at in sorted(places, reverse=True):
        number = bound[places[at]]
        said = f"({number})" if isinstance(number, int) and number < 0 else str(number)
        text = f"{text[:at]}{said}{text[at + len(places[at]) :]}"
    return text
