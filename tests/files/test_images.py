"""Images are opened in a list of formats only, and other formats are named."""

import io
import subprocess

import pytest
from PIL import EpsImagePlugin, Image, UnidentifiedImageError

from faceposer.files.images import FORMATS, foreign_format, open_image

POSTSCRIPT = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 4 4\n%%EndComments\nshowpage\n"


def encoded(form: str) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (4, 2), (200, 100, 50)).save(file, format=form)
    return file.getvalue()


@pytest.mark.parametrize("form", ["JPEG", "PNG", "WEBP", "TIFF", "BMP", "GIF", "TGA", "PPM", "PCX", "SGI", "QOI"])
def test_common_formats_are_opened(form: str) -> None:
    assert form in FORMATS
    with open_image(io.BytesIO(encoded(form))) as image:
        assert image.convert("RGB").size == (4, 2)


def test_no_format_that_another_program_opens_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[object] = []
    monkeypatch.setattr(subprocess, "check_call", lambda *words, **_: started.append(words))
    monkeypatch.setattr(EpsImagePlugin, "Ghostscript", lambda *words: started.append(words))
    for start in (b"", b"\xc5\xd0\xd3\xc6" + bytes(28)):
        with pytest.raises(UnidentifiedImageError):
            open_image(io.BytesIO(start + POSTSCRIPT))
    assert not {"EPS", "WMF", "EMF", "PDF"} & set(FORMATS)
    assert not started


def test_a_truncated_image_is_damaged_and_not_of_another_format() -> None:
    for form in ("PNG", "JPEG", "GIF"):
        with pytest.raises(OSError, match=r"damaged|truncated|Truncated|broken") as raised:
            open_image(io.BytesIO(encoded(form)[:20])).load()
        assert not isinstance(raised.value, UnidentifiedImageError), form


@pytest.mark.parametrize(
    ("start", "name", "noun"),
    [
        (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "a.jpg", "a HEIC image, as iPhones take them"),
        (b"\0\0\0\x18ftypmif1\0\0\0\0mif1heic", "", "a HEIC image, as iPhones take them"),
        (b"8BPS\0\1", "skin.png", "a Photoshop document"),
        (b"gimp xcf v011", "", "a GIMP document"),
        (POSTSCRIPT, "a.jpg", "a PostScript file"),
        (b"\xabKTX 20\xbb", "", "a KTX2 image"),
        (b"no magic", "a.CR2", "a raw image of a camera"),
        (b"\0\0\0\x1cftypavif\0\0\0\0avifmif1", "a.heic", ""),
        (b"\x89PNG\r\n\x1a\n", "a.heic", ""),
        (b"\xff\xd8\xff\xe0", "a.psd", ""),
        (b"plain text", "a.txt", ""),
    ],
)
def test_foreign_formats_have_names(start: bytes, name: str, noun: str) -> None:
    assert foreign_format(start, name) == noun
