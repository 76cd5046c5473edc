"""Files that a model file refers to: in its own folder or below, of bounded size."""

from __future__ import annotations

from pathlib import Path

from derive.diagnostics import ModelError
from derive.model.document import LARGEST, Scalar, Source, content, decoded


def file_beside(source: Source, given: Scalar, most: int = LARGEST) -> tuple[str, str]:
    """Name, from the folder of the model file on, and text of the file that a scalar names.

    Links are followed before the folder is compared. Raises ModelError at the scalar where the file
    is elsewhere, cannot be read, is no text, or has more than `most` bytes.
    """
    folder = source.folder
    expected = "a file in the folder of the model, or below"
    if folder is None:
        source.refuse(given.span, "a model in memory refers to a file", "a model in a folder")
    if Path(given.text).is_absolute() or "\\" in given.text:
        source.refuse(given.span, f"'{given.text}' is not beside the model", expected)
    home = folder.resolve()
    place = (_home_of(source, given) / given.text).resolve()
    if not place.is_relative_to(home):
        source.refuse(given.span, f"'{given.text}' is not beside the model", expected)
    try:
        raw = content(place, most)
        if len(raw) > most:
            source.refuse(given.span, f"'{given.text}' has too many bytes", f"at most {most}")
        return place.relative_to(home).as_posix(), decoded(raw, given.text)
    except ModelError as error:
        message = error.diagnostics[0].message
        said = message if given.text in message else f"'{given.text}' {message}"
        source.refuse(given.span, said, expected)


def _home_of(source: Source, given: Scalar) -> Path:
    """The folder of the file in which the name stands."""
    if given.span.file:
        return Path(source.others[given.span.file - 1].file).resolve().parent
    return source.folder or Path()
