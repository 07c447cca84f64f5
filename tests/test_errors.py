"""Messages are one printable line, whatever the names in them."""

import pytest

from faceposer.errors import FacePoserError, counted, printable, short_name


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("smile.json", "smile.json"),
        ("Grüße\u00a0✓ 🙂", "Grüße\u00a0✓ 🙂"),
        ("a\nb\tc\r", r"a\nb\tc\r"),
        ("a\x1b[31mb", r"a\x1b[31mb"),
        ("gpj.\u202eexe", r"gpj.\u202eexe"),
        ("\ud800", r"\ud800"),
        ("a\u2028b\x85c", r"a\u2028b\x85c"),
    ],
)
def test_names_are_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert str(FacePoserError(f"The file '{text}' is broken.")) == f"The file '{shown}' is broken."
    assert printable(shown) == shown
    shown.encode("utf-8")


def test_long_texts_are_cut_in_the_middle() -> None:
    for filler in ("n", "\x1b", "\ud800"):
        said = str(FacePoserError(f"The file '{filler * 10_000}' is broken; export it again."))
        assert len(said) <= 1000
        assert said.startswith("The file '")
        assert said.endswith("is broken; export it again.")
        assert " ... " in said
    assert len(short_name("n" * 500)) == 80


def test_counted() -> None:
    assert [counted(n, "vertex", "vertices") for n in (0, 1, 2)] == ["0 vertices", "1 vertex", "2 vertices"]
