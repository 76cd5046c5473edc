"""Names of a robot file → names that a model may have: letters, digits, single underscores, no
keyword, none twice."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from derive.model.mechanism.named_frames import TAKEN
from derive.model.names import LONGEST, identifier, module_objection, objection

# what the joints with several coordinates and velocities put behind their name
SUFFIXES = ("x", "y", "z", "angle", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "w")
AMBIGUOUS = ("local_", "world_", "w_", "quaternion_", "jacobian_")
PLAIN = ("v", "w")  # J.v and J.w of joints with one rate


def legal(name: str, kind: str) -> str:
    """The nearest name without an objection; `kind` ("body", "joint" …) helps where nothing or a
    keyword is left."""
    text = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:LONGEST].rstrip("_")
    if not text[:1].isalpha():
        text = f"{kind}_{text}".rstrip("_")[:LONGEST].rstrip("_")
    return f"{text[: LONGEST - len(kind) - 1].rstrip('_')}_{kind}" if objection(text) else text


def is_ambiguous(frame: str) -> bool:
    """Whether functions of a frame of that name would have the names of others."""
    return f"jacobian_{frame}" in TAKEN or frame.startswith(AMBIGUOUS)


def model_name(name: str) -> str:
    """A name for the generated module."""
    text = legal(name, "robot")
    return f"{text[: LONGEST - 6].rstrip('_')}_robot" if module_objection(text) else text


class Names:
    """One space of names; everything taken is remembered as the identifier it becomes in generated
    code. What the file calls so keeps its name: another gives way, whichever comes first."""

    def __init__(self) -> None:
        self.taken: set[str] = set()
        self.kept: set[str] = set()  # names of the file, which no other name may become
        self.last: dict[str, int] = {}

    def __call__(self, wanted: str, kind: str, suffixes: Sequence[str] = ()) -> str:
        """A free name like the wanted one, of which no form with a suffix is taken either."""
        plain = legal(wanted, kind)
        name, number = plain, self.last.get(plain, 1)
        while not self._free(name, suffixes) or (name != wanted and name in self.kept):
            number += 1
            tail = f"_{number}"
            name = plain[: LONGEST - len(tail)].rstrip("_") + tail
        self.last[plain] = number
        self.taken.update(self._forms(name, suffixes))
        return name

    def is_free(self, wanted: str, kind: str) -> bool:
        """Whether the name can be had without a number behind it."""
        return self._free(legal(wanted, kind), ())

    def _free(self, name: str, suffixes: Sequence[str]) -> bool:
        return not objection(name) and self.taken.isdisjoint(self._forms(name, suffixes))

    def _forms(self, name: str, suffixes: Sequence[str]) -> list[str]:
        return [identifier(name), *(identifier(f"{name}_{suffix}") for suffix in suffixes)]
