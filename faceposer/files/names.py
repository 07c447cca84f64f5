"""Names of files: output files with exactly one suffix, and hidden files."""

import re
from collections.abc import Sequence
from pathlib import Path

from faceposer.errors import FacePoserError

# Suffixes of common file types; the dot in "v1.2 smile" is not one of them.
_KNOWN = {
    *(".abc", ".blend", ".bvh", ".c3d", ".dae", ".fbx", ".glb", ".gltf", ".ma", ".max", ".mb", ".mtl", ".obj", ".ply"),
    *(".stl", ".usd", ".usda", ".usdc", ".usdz", ".vrm", ".ztl"),
    *(".bmp", ".exr", ".gif", ".jpeg", ".jpg", ".png", ".psd", ".svg", ".tga", ".tif", ".tiff", ".webp"),
    *(".avi", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm"),
    *(".csv", ".json", ".npz", ".txt", ".zip"),
}


def save_path(path: Path, chosen: str, others: Sequence[str] = ()) -> Path:
    """Return ``path`` as a name for writing, with exactly one suffix.

    A suffix of ``chosen`` or ``others`` at the end of the name is kept; that of another file type is replaced by
    ``chosen``, which is also added to a name without a suffix. Repeated suffixes are reduced: face.obj.obj becomes
    face.obj. Text after a dot that is not a known suffix remains part of the name, as in "v1.2 smile".

    Args:
        path: The path as entered.
        chosen: The chosen suffix, with its dot; "" for a folder.
        others: Other suffixes that may be written.

    Raises:
        FacePoserError: If the name consists only of suffixes.
    """
    known = _KNOWN | {chosen, *others}
    name = path.name.rstrip(". ")
    typed = Path(f"_{name}").suffix
    kept = typed if typed.lower() in {chosen, *others} - {""} else chosen
    stem = name
    while Path(f"_{stem}").suffix.lower() in known - {""}:
        stem = stem[: -len(Path(f"_{stem}").suffix)].rstrip(". ")
    if not re.search(r"[^. ]", stem):
        raise FacePoserError(f"'{path.name}' is not a file name; enter a name before the suffix.")
    return path.with_name(stem + kept)


def is_hidden(path: Path) -> bool:
    """Return True for names that begin with a dot, such as the AppleDouble file that macOS keeps beside a file."""
    return path.name.startswith(".")


def shortened_stem(stem: str, longest: int) -> str:
    """Return ``stem``, cut to at most ``longest`` bytes of UTF-8."""
    data = stem.encode("utf-8", "surrogateescape")
    return stem if len(data) <= longest else data[:longest].decode("utf-8", "ignore")


def displayable(name: str) -> str:
    """Return ``name`` with replacement characters for bytes that are not text, which some file systems allow."""
    return re.sub("[\ud800-\udfff]", "\ufffd", name)


def suffix_replaced(path: Path, saved: Path) -> bool:
    """Return True if ``saved``, the result of ``save_path`` for ``path``, lacks a suffix of ``path``."""
    return not saved.name.startswith(path.name.rstrip(". "))
