"""Columns of numbers from files: what other programs write is read, what is wrong is found.

Of hamel: columns.
"""

from pathlib import Path

import pytest

from derive.diagnostics import ModelError
from hamel.columns import file_columns


@pytest.mark.parametrize("head", ["t,q1", "t, q1", '"t","q1"', '"t", "q1" ', "\ufefft,q1"])
def test_names_may_have_quotes_and_spaces(tmp_path: Path, head: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f'{head}\n0, 1\n\n# of the second run\n1,"2"\n', encoding="utf-8")
    columns = {name: column.tolist() for name, column in file_columns(file).items()}
    assert columns == {"t": [0.0, 1.0], "q1": [1.0, 2.0]}


@pytest.mark.parametrize(
    "lines, message",
    [
        ("0,1\n\n1,x\n", "line 4, column 'q1': 'x' is no finite number"),
        ("0,1\n,2\n", "line 3, column 't': '' is no finite number"),
        ("0,1\n# 2\n1,nan\n", "line 4, column 'q1': 'nan' is no finite number"),
        ("0,1\n1,2,3\n", r"line 3 has another number of cells \(3\) than there are names \(2\)"),
        ("0\n1\n", r"line 2 has another number of cells \(1\) than there are names \(2\)"),
    ],
)
def test_what_is_wrong_is_found_by_its_line_and_column(tmp_path, lines: str, message: str) -> None:
    """Lines are those of the file, the line of names is the first."""
    (tmp_path / "a.csv").write_text(f"t,q1\n{lines}")
    with pytest.raises(ModelError, match=message) as error:
        file_columns(tmp_path / "a.csv")
    assert "usecols" not in str(error.value)


def test_a_file_that_is_no_text_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"t,\xb5\n0,1\n")
    with pytest.raises(ModelError, match="utf-8"):
        file_columns(tmp_path / "a.csv")
