"""Text tables are read in the encodings and with the separators and decimal signs that programs write."""

import os
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files.tables import decimal_number, decimal_numbers, open_table

ROWS = [["time", "größe", "jaw open"], ["0.5", "1", "0.25"], ["1.5", "2", "0.75"]]


def read(path: Path, blank: bool = False) -> list[tuple[int, list[str]]]:
    with open_table(path, "capture", 10_000_000, blank) as rows:
        return list(rows)


def written(path: Path, separator: str, comma: bool = False, encoding: str = "utf-8", before: str = "") -> Path:
    lines = [separator.join(row) for row in ROWS]
    text = before + "\n".join(line.replace(".", ",") if comma else line for line in lines)
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"])
def test_separators_and_encodings_are_inferred(tmp_path: Path, separator: str, encoding: str) -> None:
    rows = read(written(tmp_path / "a.csv", separator, encoding=encoding))
    assert rows == list(enumerate(ROWS, start=1))


@pytest.mark.parametrize("separator", [";", "\t", "|"])
def test_decimal_commas_are_no_separators(tmp_path: Path, separator: str) -> None:
    rows = read(written(tmp_path / "a.csv", separator, comma=True))
    assert [decimal_number(cell) for cell in rows[1][1]] == [0.5, 1.0, 0.25]


@pytest.mark.parametrize("before", ["sep=;\n", "SEP=;\r\n", '"sep=;"\n'])
def test_a_first_line_states_the_separator(tmp_path: Path, before: str) -> None:
    rows = read(written(tmp_path / "a.csv", ";", before=before))
    assert rows == [(number + 1, row) for number, row in enumerate(ROWS, start=1)]


def test_semicolons_in_timecodes_and_line_ends_of_other_systems(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"timecode,jaw\r" + b"\r".join(b"00;00;%02d;05,0.5" % i for i in range(9)))
    assert read(path)[-1] == (10, ["00;00;08;05", "0.5"])
    path.write_text("time  jaw\n0   0.5\n1   0.6\n")
    assert [cells for _, cells in read(path)][2] == ["1", "0.6"]


def test_blank_rows_are_left_out_unless_wanted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("a,b\n\n,\n1,2\n")
    assert [number for number, _ in read(path)] == [1, 4]
    assert [number for number, _ in read(path, blank=True)] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (bytes(range(256)), "not a text file"),
        (b"\xff\xfe\x00", "not a text file"),
        (b"a,b\n" + b"1" * 5_000_000, "more than 1,048,575 characters"),
        (b"a," * 30_000, "has 30,001 cells, more than 20,000"),
        (b'a,b\n1,"' + b"x" * 200_000, "check its quotation marks"),
        (b"a,b\n1," + b"x" * 100_000, "cell of more than"),
        (b"a" * 10_000_001, "it is larger than"),
    ],
)
def test_what_is_no_table_gets_one_sentence(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(FacePoserError, match=said) as error:
        read(path)
    assert str(path) in str(error.value)
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(FacePoserError, match="cannot be read"):
            read(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs FIFOs")
def test_special_files_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.csv")
    with pytest.raises(FacePoserError, match="not a file"):
        read(tmp_path / "a.csv")


def test_numbers_are_strict() -> None:
    assert decimal_number(" -1,5e2 ") == -150.0
    for text in ("", "1_0", "nan", "inf", "1e999", "1.000,5", "0x1", "²", "１"):  # noqa: RUF001
        assert decimal_number(text) is None
        assert decimal_numbers(["0.5", text]) is None
    assert decimal_numbers(["0.5", " 1e2"]) == [0.5, 100.0]
    assert decimal_number("\xa00.5") == 0.5
