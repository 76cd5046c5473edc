"""What is said when something is wrong: one message with file, line, column, what was expected and
the nearest known name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

WINDOW = 160  # characters of a source line that are shown at most
SHOWN = 20  # problems printed at once
NAMES = 12  # of a list that are told; whoever needs all finds them in the manifest
COMPARED = 500  # names looked at for "did you mean"
SEPARATORS = dict.fromkeys(map(ord, "._- "))  # none of them counts when names are compared


@dataclass(frozen=True)
class Diagnostic:
    """One problem. Lines and columns count from 1; line 0 means that there is no place in a file to
    point at."""

    file: str = ""
    line: int = 0
    column: int = 0
    length: int = 1
    message: str = ""
    expected: str = ""
    hint: str = ""
    source_line: str = ""
    where: str = ""  # of what stands for several, which one this is

    def __post_init__(self) -> None:
        """Each text is one line, whatever was quoted in it."""
        for name in ("message", "expected", "hint", "where"):
            object.__setattr__(self, name, one_line(getattr(self, name)))

    def __str__(self) -> str:
        return "\n".join([self.headline(), *self._excerpt(), *self._advice()])

    def headline(self) -> str:
        """The one-line form, `file:line:column: error: message`."""
        place = (
            f"{one_line(self.file)}:{self.line}:{self.column}: "
            if self.line
            else (f"{one_line(self.file)}: " if self.file else "")
        )
        return f"{place}error: {self.message}"

    def _excerpt(self) -> list[str]:
        if not self.line or not self.source_line.strip():
            return []
        first = max(0, self.column - 1 - WINDOW // 2)
        shown = self.source_line[first : first + WINDOW]
        before = shown[: self.column - 1 - first]
        # a tab under a tab keeps the caret below the place it points at
        padding = "".join("\t" if c == "\t" else " " for c in before)
        width = max(1, min(self.length, len(shown) - len(before)))
        return [f"  {shown}", f"  {padding}{'^' * width}"]

    def _advice(self) -> list[str]:
        expected = [f"  expected: {self.expected}"] if self.expected else []
        where = [f"  where {self.where}"] if self.where else []
        return where + expected + ([f"  {self.hint}"] if self.hint else [])


def one_line(text: str) -> str:
    """Text without line ends, and with other control characters as Python would write them."""
    joined = " ".join(text.splitlines()) if len(text.splitlines()) > 1 else text.strip("\n")
    shown = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)
    return joined if joined.isprintable() else "".join(shown)


def distinct(problems: Iterable[Diagnostic]) -> list[Diagnostic]:
    """In the order of the files; of a place that stands for several, the problems of the first."""
    first: dict[tuple[str, int, int], str] = {}
    shown: dict[Diagnostic, None] = {}
    for problem in problems:
        place = (problem.file, problem.line, problem.column)
        if first.setdefault(place, problem.where) == problem.where:
            shown[problem] = None
    return sorted(shown, key=lambda problem: (problem.line, problem.column))


NO_VALUE = (
    "a formula or load may have no value there, such as the direction of a spring between points "
    "that meet"
)


class HamelError(Exception):
    """Base of all errors that are somebody's to mend: `diagnostics` say what and where, `exit_code`
    is the command's."""

    exit_code = 1

    def __init__(self, problems: str | Diagnostic | Iterable[Diagnostic], hint: str = "") -> None:
        if isinstance(problems, str):
            problems = Diagnostic(message=problems, hint=hint)
        self.diagnostics: tuple[Diagnostic, ...] = (
            (problems,) if isinstance(problems, Diagnostic) else tuple(problems)
        )
        super().__init__(str(self))

    def __str__(self) -> str:
        shown = [str(problem) for problem in self.diagnostics[:SHOWN]]
        left = len(self.diagnostics) - len(shown)
        return "\n".join(shown + ([f"… and {left} more"] if left else []))

    def __reduce__(self) -> tuple[type[HamelError], tuple[tuple[Diagnostic, ...]]]:
        return type(self), (
            self.diagnostics,
        )  # so that it survives the way back from a worker process


class ModelError(HamelError):
    """The model file does not say a mechanical system."""

    exit_code = 1


class AssumptionError(HamelError):
    """The model is readable, but what a method assumes does not hold for it."""

    exit_code = 2


class ToolchainError(HamelError):
    """A compiler, a header or a writable folder is missing."""

    exit_code = 3


class VerificationError(HamelError):
    """The generated equations do not agree with the reference."""

    exit_code = 4


# What other tools call what has another name here.
SYNONYMS = {
    **dict.fromkeys(("hinge", "pin", "continuous", "rotational", "rotary"), "revolute"),
    **dict.fromkeys(("slide", "slider", "translational", "linear"), "prismatic"),
    **dict.fromkeys(("spherical", "socket"), "ball"),
    **dict.fromkeys(("cardan", "hooke"), "universal"),
    "helical": "screw",
    **dict.fromkeys(("weld", "rigid"), "fixed"),
    **dict.fromkeys(("floating", "freejoint"), "free"),
    **dict.fromkeys(("world", "inertial", "origin"), "ground"),
    "damping": "damper",
    "stiffness": "spring",
    "links": "bodies",
    "constants": "parameters",
    "initial_conditions": "initial",
}


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """The known name that was probably meant, or None."""
    every = dict.fromkeys(candidates)
    synonym = SYNONYMS.get(name.lower())
    if synonym in every:
        return synonym
    known = [known for known in every if _similar_length(known, name)][:COMPARED]
    # wrong case or another separator is the commonest slip, and difflib sees X and x as strangers
    for candidate in known:
        if _letters(candidate) == _letters(name) and candidate != name:
            return candidate
    matches = difflib.get_close_matches(name[:80], known, n=1, cutoff=0.6)
    return matches[0] if matches else None


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """The hint "did you mean 'x'?", or nothing where no known name is near."""
    near = nearest(name, candidates)
    return f"did you mean '{near}'?" if near else ""


def listed(names: Iterable[str], most: int = NAMES) -> str:
    """Names for the `expected` line, cut where a reader stops reading."""
    known = list(dict.fromkeys(names))
    return ", ".join(known[:most]) + (f", … ({len(known)} in all)" if len(known) > most else "")


def counted(number: int, one: str, many: str = "") -> str:
    """ "1 joint", "3 joints"."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def _letters(name: str) -> str:
    """What is left of a name where neither case nor separators count."""
    return name.casefold().translate(SEPARATORS)


def _similar_length(a: str, b: str) -> bool:
    return abs(len(a) - len(b)) <= 2 + len(b) // 2
