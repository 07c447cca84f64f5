"""Names of files to write: with one suffix, the one that decides what is written."""

import re
from collections.abc import Sequence
from pathlib import Path

from faceposer.errors import FacePoserError

# Suffixes by which people and programs tell files apart; "v1.2 smile" has none of them.
_KNOWN = {
    *(".abc", ".blend", ".bvh", ".c3d", ".dae", ".fbx", ".glb", ".gltf", ".ma", ".max", ".mb", ".mtl", ".obj", ".ply"),
    *(".stl", ".usd", ".usda", ".usdc", ".usdz", ".vrm", ".ztl"),
    *(".bmp", ".exr", ".gif", ".jpeg", ".jpg", ".png", ".psd", ".svg", ".tga", ".tif", ".tiff", ".webp"),
    *(".avi", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm"),
    *(".csv", ".json", ".npz", ".txt", ".zip"),
}


def save_path(path: Path, chosen: str, others: Sequence[str] = ()) -> Path:
    """Return ``path`` as it is to be written: with one suffix, at its end.

    A suffix of ``chosen`` or ``others`` at the end of the name decides; that of another kind of file is replaced by
    ``chosen``, and a name without a suffix gets it. Suffixes are never doubled: face.obj.obj is face.obj. What follows
    a dot and is no suffix of a known kind of file stays part of the name, as in "v1.2 smile".

    Args:
        path: As it was typed.
        chosen: The suffix, with its dot, that was chosen; "" for a folder, whose name has none.
        others: Suffixes that may be written instead.

    Raises:
        FacePoserError: If nothing is left of the name without its suffixes.
    """
    known = _KNOWN | {chosen, *others}
    name = path.name.rstrip(". ")
    typed = Path(f"_{name}").suffix
    kept = typed if typed.lower() in {chosen, *others} - {""} else chosen
    stem = name
    while Path(f"_{stem}").suffix.lower() in known - {""}:
        stem = stem[: -len(Path(f"_{stem}").suffix)].rstrip(". ")
    if not re.search(r"[^. ]", stem):
        raise FacePoserError(f"'{path.name}' is no name of a file; type one before the suffix.")
    return path.with_name(stem + kept)


def suffix_replaced(path: Path, saved: Path) -> bool:
    """Whether ``saved``, which ``save_path`` gave for ``path``, has lost a suffix of ``path``."""
    return not saved.name.startswith(path.name.rstrip(". "))
