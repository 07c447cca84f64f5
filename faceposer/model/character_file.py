"""Character files: one ``.npz`` archive per character.

The member ``meta`` is JSON (format, version, names, parts, shape names, feature points, credits); all other members are
plain arrays. Nothing is pickled.
"""

import dataclasses
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, MissingCharacterError
from faceposer.files import paths
from faceposer.files.arrays import DamagedError, TooLargeError, read_arrays
from faceposer.files.atomic import atomic_file
from faceposer.files.json_documents import parse_json
from faceposer.files.writing import check_finite, json_text, with_null
from faceposer.model.character import Character, Floats, Ints, Part
from faceposer.model.errors import InconsistentError
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.origin import Origin
from faceposer.resources import asset_path

FORMAT = "faceposer.subject"
#: Version 2 added optional shape limits, statistics, an origin and a summary.
VERSION = 2

_MAX_BYTES = 1 << 30
_MAX_MEMBERS = 500
# Errors of ``_build`` for members that are missing, or of other types or values than in a character file.
_INVALID = (LookupError, TypeError, ValueError, AttributeError, OverflowError)
#: Quantisation step of stored offsets in centimetres, unless a large offset requires a larger step.
_SHAPE_STEP = 2e-4
_MAX_STEP = 1.0


def available_characters() -> list[tuple[str, str]]:
    """Return (name, title) of every installed character, sorted by name.

    Raises:
        FacePoserError: If a character file is damaged.
    """
    return [(path.stem, read_title(path)) for path in sorted(asset_path("characters").glob("*.npz"))]


def load_character(name_or_path: str | os.PathLike[str]) -> Character:
    """Load an installed character by its name, or a character file by its path (ending in ``.npz``).

    Raises:
        FacePoserError: If there is no such character, or the file is not a valid character file.
    """
    text = os.fspath(name_or_path)
    path = paths.expand_user(text)
    if path.suffix.lower() != ".npz":
        installed = asset_path(f"characters/{text}.npz") if text == path.name and text else None
        if installed is None or not paths.is_file(installed):
            names = ", ".join(f"'{p.stem}'" for p in sorted(asset_path("characters").glob("*.npz")))
            raise MissingCharacterError(
                f"There is no character '{text}'; choose one of {names or '(none installed)'}, or give the path of a "
                "character file (.npz).",
                text,
            )
        path = installed
    members = _read_members(path, None)
    meta = _parse_meta(path, members)
    try:
        return _build(meta, members)
    except _INVALID as error:
        _refuse(path, _reason(error))


def save_character(path: str | os.PathLike[str], character: Character) -> None:
    """Write ``character`` to the compressed file ``path``, atomically.

    Offsets are rounded to steps of about 2 micrometres; vertices and texture coordinates are stored exactly.

    Raises:
        FacePoserError: If the file cannot be written, or could not be read again.
    """
    check_finite(
        Path(path), "character file", character.vertices, character.uv, character.shapes, character.shape_limits
    )
    largest = float(np.abs(character.shapes).max(initial=0.0))
    step = max(_SHAPE_STEP, largest / 32767)
    meta: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": character.name,
        "title": character.title,
        "parts": [dataclasses.asdict(part) for part in character.parts],
        "shape_names": list(character.shape_names),
        "shape_step": step,
        "feature_points": dict(character.feature_points),
        "feature_titles": dict(character.feature_titles),
        "credits": character.credits,
        "summary": with_null(dict(character.summary)),
    }
    optional: dict[str, NDArray[Any]] = {}
    if character.statistics is not None:
        meta["statistics"], members = character.statistics.as_members()
        optional |= {f"statistics.{name}": array for name, array in members.items()}
    if character.origin is not None:
        meta["origin"], members = character.origin.as_members()
        optional |= {f"origin.{name}": array for name, array in members.items()}
    # Names of files may contain bytes that are not text, which no character set can encode.
    text = json_text(Path(path), meta, "character file", ascii_only=False).encode("utf-8", "replace")
    arrays: dict[str, NDArray[Any]] = {
        "meta": np.frombuffer(text, dtype=np.uint8),
        "vertices": character.vertices,
        "polygons": character.polygons,
        "uv": character.uv,
        "polygon_uvs": character.polygon_uvs,
        "shapes": np.rint(character.shapes / step).astype(np.int16),
        "shape_limits": character.shape_limits,
        **optional,
    }
    arrays |= {f"region.{name}": ids for name, ids in character.regions.items()}
    arrays |= {f"texture.{name}": np.frombuffer(data, np.uint8) for name, data in character.textures.items()}
    _check_readable(Path(path), text, arrays)
    with atomic_file(Path(path), "character file") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _reason(error: Exception) -> str:
    """Return the reason for an error of ``_build`` without wording of Python or NumPy."""
    if isinstance(error, KeyError):
        return f"'{str(error.args[0])[:60]}' is missing"
    if isinstance(error, InconsistentError):
        return str(error)
    return "its metadata or its arrays are inconsistent; copy it again"


def _check_readable(path: Path, text: bytes, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise a FacePoserError for the content of a file that ``load_character`` would refuse."""
    try:
        if len(arrays) > _MAX_MEMBERS or sum(array.nbytes + 128 for array in arrays.values()) > _MAX_BYTES:
            raise InconsistentError("it is too large for a character")
        _build(json.loads(text), arrays)
    except _INVALID as error:
        raise FacePoserError(f"The character is not written to '{path}': {_reason(error).rstrip('.')}.") from error


def _refuse(path: Path, reason: str) -> NoReturn:
    raise FacePoserError(f"The character file '{path}' cannot be used: {reason.rstrip('.')}.") from None


def read_title(path: Path) -> str:
    """Return the title in the character file ``path`` without reading its meshes.

    Raises:
        FacePoserError: If it is not a character file.
    """
    return str(_parse_meta(path, _read_members(path, {"meta"}))["title"])


def _read_members(path: Path, named: set[str] | None) -> dict[str, NDArray[Any]]:
    """Read all arrays of the archive ``path``, or those ``named``; sizes are checked before memory is allocated."""
    try:
        return read_arrays(path, _MAX_BYTES, _MAX_MEMBERS, named)
    except TooLargeError:
        _refuse(path, "it is too large for a character")
    except DamagedError as error:
        _refuse(path, str(error) or "it is damaged or is not a character file; copy it again")
    except FileNotFoundError:
        raise MissingCharacterError(f"There is no character file '{path}'; check the path.", str(path)) from None
    except OSError as error:
        _refuse(path, f"it cannot be read ({error.strerror or error})")


def _parse_meta(path: Path, members: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    try:
        meta = parse_json(members["meta"].tobytes(), unique_keys=True)
    except (KeyError, FacePoserError):
        _refuse(path, "it is not a Face Poser character file (its metadata is missing or unreadable)")
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        _refuse(path, "it is not a Face Poser character file")
    if meta.get("version") not in range(1, VERSION + 1):
        _refuse(path, f"it has version {meta.get('version')!r}; this program reads versions 1 to {VERSION}")
    if not all(isinstance(meta.get(key), str) for key in ("name", "title", "credits")):
        _refuse(path, "its name, title or credits are not text")
    return meta


def _build(meta: dict[str, Any], members: Mapping[str, NDArray[Any]]) -> Character:
    step = float(meta["shape_step"])
    if not 0.0 < step < np.inf:
        raise InconsistentError("the quantisation step of its shapes is not a positive number")
    if step >= _MAX_STEP:
        raise InconsistentError(f"its shapes move vertices by up to {32767 * step:.3g} cm, which no face does")
    if members["shapes"].dtype != np.int16:
        raise InconsistentError("its shapes are not 16-bit integers")
    return Character(
        name=meta["name"],
        title=meta["title"],
        vertices=_as_floats(members, "vertices"),
        polygons=_as_ints(members, "polygons"),
        uv=_as_floats(members, "uv"),
        polygon_uvs=_as_ints(members, "polygon_uvs"),
        parts=tuple(
            Part(
                str(part["name"]),
                str(part["material"]),
                (int(part["polygons"][0]), int(part["polygons"][1])),
                (int(part["vertices"][0]), int(part["vertices"][1])),
            )
            for part in meta["parts"]
        ),
        shape_names=tuple(str(name) for name in meta["shape_names"]),
        shapes=np.multiply(members["shapes"], np.float32(step), dtype=np.float32),
        regions={
            name.removeprefix("region."): _as_ints(members, name) for name in members if name.startswith("region.")
        },
        feature_points={str(key): int(value) for key, value in dict(meta["feature_points"]).items()},
        feature_titles={str(key): str(value) for key, value in dict(meta["feature_titles"]).items()},
        textures={
            name.removeprefix("texture."): members[name].tobytes() for name in members if name.startswith("texture.")
        },
        credits=meta["credits"],
        shape_limits=_as_floats(members, "shape_limits") if "shape_limits" in members else np.zeros((0, 2), np.float32),
        statistics=ExpressionStatistics.of_members(dict(meta["statistics"]), _members_of(members, "statistics"))
        if "statistics" in meta
        else None,
        origin=Origin.of_members(dict(meta["origin"]), _members_of(members, "origin")) if "origin" in meta else None,
        # Numbers that are not finite become null.
        summary=dict(json.loads(json.dumps(meta.get("summary", {}), default=lambda _: None))),
    )


def _members_of(members: Mapping[str, NDArray[Any]], name: str) -> dict[str, NDArray[Any]]:
    return {key.removeprefix(f"{name}."): value for key, value in members.items() if key.startswith(f"{name}.")}


def _as_floats(members: Mapping[str, NDArray[Any]], name: str) -> Floats:
    if members[name].dtype.kind != "f":
        raise InconsistentError(f"its {name} are not real numbers")
    return np.ascontiguousarray(members[name], dtype=np.float32)


def _as_ints(members: Mapping[str, NDArray[Any]], name: str) -> Ints:
    if members[name].dtype != np.int32:
        raise InconsistentError(f"its {name} are not 32-bit integers")
    return np.ascontiguousarray(members[name])
