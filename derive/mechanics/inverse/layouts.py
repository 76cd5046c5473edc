"""Ways to lay out the links of a tree for their inverse dynamics, of one result each: where points
and axes sit, which numbers are left to each body, and which links are seen from common axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from derive.mechanics.inverse.base_parameters import is_number, regrouped_bodies, turned_leaves
from derive.mechanics.inverse.moments import Body, body
from derive.mechanics.inverse.stems import NONE, Stem, heads_of, stems_at_origins, stems_of
from derive.mechanics.limits import FEW
from derive.mechanics.links import moved
from derive.mechanics.records import Link


@dataclass(frozen=True)
class Layout:
    """Per link its joint, its body about the joint's point, and the link at which its row of
    parallel axes begins: itself, where it is alone."""

    stems: Sequence[Stem]
    bodies: Sequence[Body]
    heads: Sequence[int]


def layouts(links: Sequence[Link]) -> tuple[Layout, ...]:
    """With the base parameters folded in and, of few links whose numbers are parameters, as given;
    with and without rows of parallel axes."""
    stems = stems_of(links)
    given = [
        moved(moved(link.inertia, (), [-x for x in stem.point]), stem.own, NONE)
        for link, stem in zip(links, stems)
    ]
    few, alone = len(links) <= FEW, list(range(len(links)))
    seated = [turned_leaves(stems, regrouped_bodies(stems, given))]
    open_numbers = few and not all(is_number(own) for own in given)
    if open_numbers:
        seated.append(turned_leaves(stems, [body(own) for own in given]))
    rows = [heads_of(stems, True)]
    if few and rows[0] != alone:
        rows.append(heads_of(stems, False))
    found = [Layout(*sitting, heads) for sitting in seated for heads in rows]
    if open_numbers:
        found.append(_about_origins(links, stems, alone))
    return tuple(found)


def _about_origins(links: Sequence[Link], stems: Sequence[Stem], alone: Sequence[int]) -> Layout:
    """With the points about which the file gives the bodies' numbers. About a mass centre these
    make no products with one another: neither m r nor I + m r²."""
    bodies = [body(moved(link.inertia, stem.own, NONE)) for link, stem in zip(links, stems)]
    return Layout(stems_at_origins(links, stems), bodies, alone)
