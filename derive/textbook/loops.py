"""The recursion of a long tree: its formulas once, and what differs from link to link in tables."""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Scalar
from derive.formulations.records import Equations
from derive.mechanics.loops.records import Kind, Recursion
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import bold
from derive.textbook.records import Display, Line, Math, Runs, Text

# title of a loop, then its formulas as pairs of sides
LOOPS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (
        "From base to tips, the angular velocity and what the origin's acceleration has of it:",
        (
            (r"!\omega", r"!R^{T} !\omega_{\lambda} + !e\,v"),
            (r"!b", r"!\omega_{\lambda} \times (!\omega_{\lambda} \times !p)"),
        ),
    ),
    (
        "From tips to base, the inertia and the bias wrench of a link with all that it carries, as "
        "they are felt through its joint:",
        (
            (r"!\psi", r"!M\,!e"),
            ("d", r"!e^{T} !\psi"),
            (r"\phi", r"\tau - !e^{T} !\eta"),
            (r"!M_{\lambda}", r"!M_{\lambda} + !X^{T} (!M - !\psi\,!\psi^{T}/d)\,!X"),
            (
                r"!\eta_{\lambda}",
                r"!\eta_{\lambda} + !X^{T} ((!M - !\psi\,!\psi^{T}/d)\,!c + !\eta + !\psi\,\phi/d)",
            ),
        ),
    ),
    (
        "From base to tips, the accelerations; the ground's is that of gravity, turned round:",
        (
            (r"!\mu", r"!X\,!\alpha_{\lambda} + !c"),
            (r"\dot v", r"\phi/d - !\psi^{T} !\mu/d"),
            (r"!\alpha", r"!\mu + !e\,\dot v"),
        ),
    ),
)
SHOWN = 12  # columns of a table


def loops(doc: Manuscript) -> None:
    """The three loops, the kinds of links and the tables. Featherstone 1983; Saha 1999; frames
    after Khalil, Kleinfinger 1986."""
    of = recursion_of(doc.equations)
    if of is None:
        return
    doc.section("Equations of motion as loops over the links")
    doc.say(
        f"The {len(of.parents)} links are a tree, and each hangs on one joint. "
        "What follows is done at every link $i$; $\\lambda$ is the link that carries it. Frames "
        "have $z$ along the joint's axis $!e$ and stand on it; $!p$ is their origin and $!R$ their "
        "orientation in the frame of the link before, $!X$ takes accelerations from there to here, "
        "$!c$ are the velocity products, and $\\tau$ is what acts at the joint."
    )
    if of.has_several:
        doc.say(
            "A joint with several velocities has an axis of its frame for each; the second loop "
            "eliminates one after the other, and the third finds them in the opposite order."
        )
    for number, (title, lines) in enumerate(LOOPS, 1):
        doc.say(title)
        doc.display(Display(tuple(_line(*x) for x in lines), number, boxed=number == len(LOOPS)))
    _tables(doc, of)


def recursion_of(equations: Equations) -> Recursion | None:
    """The loops of a long tree; None where the equations are written out."""
    dynamics = equations.function("dynamics")
    if dynamics.result.written or dynamics.recursion is None:
        return None
    return dynamics.recursion()


def _line(left: str, right: str) -> Line:
    return Line(bold(left), (bold(right),))


def _tables(doc: Manuscript, of: Recursion) -> None:
    doc.say("Links of one kind share the formulas; a number that all of them have is in these.")
    for number, kind in enumerate(of.kinds):
        links = of.kinds_of.count(number)
        distinct, columns = len(kind.table), kind.constants.numel()
        doc.say(
            f"Kind {number + 1}, {{about}}: {links} links, {distinct} different, "
            f"{columns} constants each.",
            about=kind.about,
        )
        if columns:
            _table(doc, kind, min(columns, SHOWN))


def _table(doc: Manuscript, kind: Kind, columns: int) -> None:
    head = tuple(f"k{n + 1}" for n in range(columns))
    doc.listing(head, kind.table, lambda row: _cells(row[:columns]))


def _cells(row: Sequence[Scalar]) -> list[Runs]:
    return [(Math(f"{x:.6g}"),) if isinstance(x, float) else (Text(str(x)),) for x in row]
