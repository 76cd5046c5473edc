"""The one error of this package: a formula that cannot be read, with the offset of the offending
place."""

from __future__ import annotations

import re

from derive.diagnostics import Diagnostic, ModelError

_WORD = re.compile(r"[A-Za-z_0-9.]+")


class FormulaError(ModelError):
    """A formula is wrong at offset `at`. The model reader turns it into a place in the file."""

    def __init__(
        self, message: str, text: str = "", at: int = 0, expected: str = "", hint: str = ""
    ) -> None:
        self.at = at
        word = _WORD.match(text, at)
        self.length = len(word.group()) if word else 1
        self.detail = (message, expected, hint)
        place = Diagnostic(
            "<formula>", 1, at + 1, self.length, message, expected, hint, text.replace("\n", " ")
        )
        super().__init__(
            place if text else Diagnostic(message=message, expected=expected, hint=hint)
        )

    def __reduce__(self):  # type: ignore[override]
        return ModelError, (self.diagnostics,)
