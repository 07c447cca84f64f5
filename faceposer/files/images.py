"""Images: the formats that may be opened, and the names of others.

Pillow opens some formats by other programs, such as PostScript by Ghostscript, which would run what the file contains.
All images of the program are opened here.
"""

from collections.abc import Container
from pathlib import Path
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

#: Formats that may be opened, as Pillow names them.
FORMATS = (
    *("JPEG", "PNG", "WEBP", "AVIF", "TIFF", "BMP", "DIB", "GIF", "TGA", "PPM", "JPEG2000", "DDS"),
    *("ICO", "PCX", "SGI", "QOI"),
)

_HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs")
_RAW = "a raw image of a camera"
_POSTSCRIPT = "a PostScript file"
_FOREIGN = {
    ".heic": "a HEIC image, as iPhones take them",
    ".heif": "a HEIF image",
    ".jxl": "a JPEG XL image",
    ".psd": "a Photoshop document",
    ".xcf": "a GIMP document",
    ".exr": "an OpenEXR image",
    ".hdr": "a Radiance HDR image",
    ".svg": "an SVG drawing",
    ".pdf": "a PDF document",
    ".eps": _POSTSCRIPT,
    ".ps": _POSTSCRIPT,
    ".ktx": "a KTX image",
    ".ktx2": "a KTX2 image",
    ".basis": "a Basis image",
    **dict.fromkeys((".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2"), _RAW),
}
#: Suffixes of common image formats that cannot be opened; drawings in SVG are opened as such.
FOREIGN_SUFFIXES = tuple(suffix for suffix in _FOREIGN if suffix != ".svg")
# First bytes of formats that cannot be opened, and of formats that can, whatever the suffix.
_STARTS = (
    (b"8BPS", ".psd"),
    (b"gimp xcf", ".xcf"),
    (b"\x76\x2f\x31\x01", ".exr"),
    (b"#?RADIANCE", ".hdr"),
    (b"%PDF", ".pdf"),
    (b"%!PS", ".eps"),
    (b"\xc5\xd0\xd3\xc6", ".eps"),
    (b"\xff\x0a", ".jxl"),
    (b"\x00\x00\x00\x0cJXL ", ".jxl"),
    (b"\xabKTX 20", ".ktx2"),
    (b"\xabKTX 11", ".ktx"),
    (b"sB", ".basis"),
)
_READABLE_STARTS = (b"\xff\xd8\xff", b"\x89PNG", b"BM", b"GIF8", b"RIFF")


def open_image(file: IO[bytes]) -> "ImageFile":
    """Open the image in ``file`` with Pillow, if it has one of the `FORMATS`.

    Raises:
        OSError: If it is damaged (without ``strerror``), or cannot be read.
        PIL.UnidentifiedImageError: If it is no image in one of the formats.
        PIL.Image.DecompressionBombError: If it has too many pixels.
    """
    from PIL import Image, UnidentifiedImageError

    # Pillow may have been built without some of them; finding out takes a while, and is needed for rare formats only.
    Image.preinit()
    try:
        return Image.open(file, formats=_among(Image.OPEN))
    except UnidentifiedImageError:
        file.seek(0)
        if file.read(8).startswith(_READABLE_STARTS[:4]):
            raise OSError("the image is damaged") from None
        Image.init()
        file.seek(0)
        return Image.open(file, formats=_among(Image.OPEN))


def _among(opened: Container[str]) -> list[str]:
    return [name for name in FORMATS if name in opened]


def foreign_format(start: bytes, name: Path | str = "") -> str:
    """Return a noun for the format of an image that cannot be opened, such as "a HEIC image"; "" for other images.

    Args:
        start: The first 64 bytes of the file.
        name: Name of the file; its suffix decides where the content does not.
    """
    if start.startswith(_READABLE_STARTS):
        return ""
    if start[4:8] == b"ftyp":
        if b"avif" in start or b"avis" in start:
            return ""
        brand = start[8:12]
        if brand in _HEIC_BRANDS:
            return _FOREIGN[".heic"]
        if brand in (b"mif1", b"msf1"):
            return _FOREIGN[".heic" if any(kind in start for kind in _HEIC_BRANDS) else ".heif"]
        if brand == b"crx ":
            return _RAW
    suffix = next((suffix for first, suffix in _STARTS if start.startswith(first)), Path(name).suffix.lower())
    return _FOREIGN.get(suffix, "")
