"""Characters: a polygon mesh in named parts, its facial action shapes, textures, regions and feature points.

A subject is one ``.npz`` file. Its member ``meta`` is JSON (format, version, names, parts, shape names, feature
points, credits); all other members are plain arrays. Nothing in it is pickled.
"""

import dataclasses
import json
import os
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.subject_checks import check_subject
from faceposer.resources import asset_path

FORMAT = "faceposer.subject"
VERSION = 1

#: The 52 facial action shapes of Apple's ARKit, in the order of its documentation.
ARKIT_SHAPES: tuple[str, ...] = (
    *(f"eye{action}Left" for action in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    *(f"eye{action}Right" for action in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    *("jawForward", "jawLeft", "jawRight", "jawOpen"),
    *("mouthClose", "mouthFunnel", "mouthPucker", "mouthLeft", "mouthRight"),
    *("mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft", "mouthFrownRight"),
    *("mouthDimpleLeft", "mouthDimpleRight", "mouthStretchLeft", "mouthStretchRight"),
    *("mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper"),
    *("mouthPressLeft", "mouthPressRight", "mouthLowerDownLeft", "mouthLowerDownRight"),
    *("mouthUpperUpLeft", "mouthUpperUpRight"),
    *("browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight"),
    *("cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight", "tongueOut"),
)

_MAX_BYTES = 1 << 30
_MAX_MEMBERS = 500
#: Centimetres per unit of the integers in which offsets are stored, unless a larger offset needs a larger step.
_SHAPE_STEP = 2e-4

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Part:
    """A named piece of a subject, such as an eye: one material, a run of polygons and the run of their vertices.

    Attributes:
        name: For example "skin" or "eye_left".
        material: "skin", "eye", "teeth", "gums", "tongue" or "lashes".
        polygons: First polygon and the one after the last.
        vertices: First vertex and the one after the last.
    """

    name: str
    material: str
    polygons: tuple[int, int]
    vertices: tuple[int, int]


@dataclass(frozen=True, eq=False, repr=False)
class Subject:
    """A character that can be posed: its neutral mesh and all that belongs to it.

    Centimetres; y up, the face looks along +z, the character's left is +x, x = 0 is the plane of symmetry.

    Attributes:
        name: Short name, as typed by a user.
        title: Name to show.
        vertices: Neutral positions, shape (N, 3).
        polygons: Vertex ids of quads, shape (F, 4), counter-clockwise from outside; a triangle ends in -1.
        uv: Texture coordinates, v up as in OBJ, shape (U, 2).
        polygon_uvs: Ids into ``uv`` per polygon corner, shape (F, 4); -1 where ``polygons`` has it.
        parts: The pieces, in order; their runs of polygons and vertices are contiguous and cover everything.
        regions: Vertex ids by region name ("mouth", "brow_left", ...).
        feature_points: Vertex id by MPEG-4 feature point ("8.3", ...).
        feature_titles: Readable name of each feature point ("left mouth corner").
        shape_names: Names of the shapes, S of them.
        shapes: Offsets from neutral, shape (S, N, 3); all zero where the character lacks a shape.
        textures: Encoded images (PNG or JPEG) by material.
        credits: Where the data comes from and its licence.

    Raises:
        ValueError: If the arrays do not fit together.
    """

    name: str
    title: str
    vertices: Floats
    polygons: Ints
    uv: Floats
    polygon_uvs: Ints
    parts: tuple[Part, ...]
    shape_names: tuple[str, ...]
    shapes: Floats
    regions: Mapping[str, Ints] = field(default_factory=dict)
    feature_points: Mapping[str, int] = field(default_factory=dict)
    feature_titles: Mapping[str, str] = field(default_factory=dict)
    textures: Mapping[str, bytes] = field(default_factory=dict)
    credits: str = ""

    def __post_init__(self) -> None:
        check_subject(self)

    @cached_property
    def triangles(self) -> Ints:
        """Vertex ids, shape (T, 3): a quad (a, b, c, d) becomes (a, b, c) and (a, c, d), a triangle stays."""
        return self._split(self.polygons)

    @cached_property
    def triangle_uvs(self) -> Ints:
        """Ids into ``uv`` per corner of ``triangles``, shape (T, 3)."""
        return self._split(self.polygon_uvs)

    @cached_property
    def triangle_polygons(self) -> Ints:
        """The polygon that each triangle comes from, shape (T,)."""
        return np.repeat(np.arange(len(self.polygons), dtype=np.int32), 1 + self._is_quad)

    @property
    def height(self) -> float:
        """Height of the head from the bottom of the chin to the crown, in centimetres (else of the whole mesh)."""
        y = self.vertices[:, 1]
        if {"2.1", "11.4"} <= self.feature_points.keys():
            return float(y[self.feature_points["11.4"]] - y[self.feature_points["2.1"]])
        return float(np.ptp(y))

    def part(self, name: str) -> Part:
        """Return the part called ``name``.

        Raises:
            KeyError: If there is none.
        """
        for part in self.parts:
            if part.name == name:
                return part
        raise KeyError(name)

    def part_triangles(self, part: Part) -> tuple[int, int]:
        """Return the first triangle of ``part`` and the one after its last."""
        first = np.concatenate([[0], np.cumsum(1 + self._is_quad)])
        return int(first[part.polygons[0]]), int(first[part.polygons[1]])

    @cached_property
    def solid_triangles(self) -> NDArray[np.intp]:
        """Indices of the triangles of all parts but the lashes, which pointers pass through."""
        runs = [self.part_triangles(part) for part in self.parts if part.material != "lashes"]
        return np.concatenate([np.arange(*run) for run in runs]) if runs else np.zeros(0, dtype=np.intp)

    @property
    def _is_quad(self) -> NDArray[np.bool_]:
        is_quad: NDArray[np.bool_] = self.polygons[:, 3] >= 0
        return is_quad

    def _split(self, corners: Ints) -> Ints:
        both = np.stack([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]], axis=1)
        keep = np.stack([np.ones(len(corners), dtype=bool), self._is_quad], axis=1)
        return np.ascontiguousarray(both[keep])


def available_subjects() -> list[tuple[str, str]]:
    """Return (name, title) of every subject that is installed, sorted by name.

    Raises:
        FacePoserError: If a subject file is damaged.
    """
    return [(path.stem, _read_title(path)) for path in sorted(asset_path("subjects").glob("*.npz"))]


def load_subject(name_or_path: str | os.PathLike[str]) -> Subject:
    """Load an installed subject by its name, or any subject file by its path (which ends in ``.npz``).

    Raises:
        FacePoserError: If there is no such subject, or the file is not a sound subject file.
    """
    text = os.fspath(name_or_path)
    path = Path(text).expanduser()
    if path.suffix.lower() != ".npz":
        installed = asset_path(f"subjects/{text}.npz") if text == path.name and text else None
        if installed is None or not installed.is_file():
            names = ", ".join(f"'{p.stem}'" for p in sorted(asset_path("subjects").glob("*.npz")))
            raise FacePoserError(
                f"There is no subject '{text}'; choose one of {names or '(none installed)'}, or give the path of a "
                "subject file, which ends in .npz."
            )
        path = installed
    members = _read_members(path, None)
    meta = _parse_meta(path, members)
    try:
        return _build(meta, members)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        reason = f"'{error.args[0]}' is missing" if isinstance(error, KeyError) else str(error)
        _refuse(path, reason)


def save_subject(path: str | os.PathLike[str], subject: Subject) -> None:
    """Write ``subject`` to ``path``, compressed, replacing the file only when it is complete.

    Offsets are rounded to a step of about 2 micrometres, vertices and texture coordinates are kept as they are.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    largest = float(np.abs(subject.shapes).max(initial=0.0))
    step = max(_SHAPE_STEP, largest / 32767)
    meta = {
        "format": FORMAT,
        "version": VERSION,
        "name": subject.name,
        "title": subject.title,
        "parts": [dataclasses.asdict(part) for part in subject.parts],
        "shape_names": list(subject.shape_names),
        "shape_step": step,
        "feature_points": dict(subject.feature_points),
        "feature_titles": dict(subject.feature_titles),
        "credits": subject.credits,
    }
    text = json.dumps(meta, ensure_ascii=False, indent=1)
    arrays: dict[str, NDArray[Any]] = {
        "meta": np.frombuffer(text.encode("utf-8"), dtype=np.uint8),
        "vertices": subject.vertices,
        "polygons": subject.polygons,
        "uv": subject.uv,
        "polygon_uvs": subject.polygon_uvs,
        "shapes": np.rint(subject.shapes / step).astype(np.int16),
    }
    arrays |= {f"region.{name}": ids for name, ids in subject.regions.items()}
    arrays |= {f"texture.{name}": np.frombuffer(data, np.uint8) for name, data in subject.textures.items()}
    target = Path(path)
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent, suffix=".tmp", delete=False) as file:
            temporary = file.name
            np.savez_compressed(file, allow_pickle=False, **arrays)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(target)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise FacePoserError(f"The subject file '{target}' cannot be written: {error.strerror or error}.") from error


def _refuse(path: Path, reason: str) -> NoReturn:
    raise FacePoserError(f"The subject file '{path}' cannot be used: {reason.rstrip('.')}.") from None


def _read_title(path: Path) -> str:
    return str(_parse_meta(path, _read_members(path, {"meta"}))["title"])


def _read_members(path: Path, wanted: set[str] | None) -> dict[str, NDArray[Any]]:
    """Read the arrays of the archive ``path``, all or those in ``wanted``; sizes are checked before memory is taken."""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            if len(entries) > _MAX_MEMBERS or sum(entry.file_size for entry in entries) > _MAX_BYTES:
                _refuse(path, "it is too large for a subject")
            members = {}
            for entry in entries:
                name = entry.filename.removesuffix(".npy")
                if wanted is None or name in wanted:
                    with archive.open(entry) as stream:
                        members[name] = _read_array(stream, entry.file_size)
            return members
    except FileNotFoundError:
        raise FacePoserError(f"There is no subject file '{path}'; check the path.") from None
    except OSError as error:
        _refuse(path, f"it cannot be read ({error.strerror or error})")
    except (zipfile.BadZipFile, EOFError, zlib.error, NotImplementedError, RuntimeError):
        _refuse(path, "it is damaged or not a subject; copy or build it again")
    except ValueError as error:
        _refuse(path, str(error))


def _read_array(stream: IO[bytes], size: int) -> NDArray[Any]:
    version = np.lib.format.read_magic(stream)
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in read_header:
        raise ValueError(f"an array has the unknown format version {version}")
    shape, fortran_order, dtype = read_header[version](stream)
    if dtype.hasobject:
        raise ValueError("it contains pickled objects, which are never loaded")
    count = int(np.prod(shape, dtype=object)) if shape else 1
    if count * dtype.itemsize > size:
        raise ValueError("an array claims to be larger than its data")
    data = stream.read(count * dtype.itemsize)
    if len(data) != count * dtype.itemsize:
        raise ValueError("an array ends too early")
    return np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if fortran_order else "C")


def _parse_meta(path: Path, members: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    try:
        meta = json.loads(members["meta"].tobytes().decode("utf-8"))
    except (KeyError, ValueError, RecursionError):
        _refuse(path, "it is not a Face Poser subject (its description is missing or unreadable)")
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        _refuse(path, "it is not a Face Poser subject")
    if meta.get("version") != VERSION:
        _refuse(path, f"it has version {meta.get('version')!r}, this program reads version {VERSION}")
    if not all(isinstance(meta.get(key), str) for key in ("name", "title", "credits")):
        _refuse(path, "its name, title or credits are not text")
    return meta


def _build(meta: dict[str, Any], members: Mapping[str, NDArray[Any]]) -> Subject:
    step = float(meta["shape_step"])
    if not 0.0 < step < 1.0:
        raise ValueError(f"the step of its shapes is {step}")
    if members["shapes"].dtype != np.int16:
        raise ValueError("its shapes are not 16-bit integers")
    return Subject(
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
    )


def _as_floats(members: Mapping[str, NDArray[Any]], name: str) -> Floats:
    if members[name].dtype.kind != "f":
        raise ValueError(f"its {name} are not real numbers")
    return np.ascontiguousarray(members[name], dtype=np.float32)


def _as_ints(members: Mapping[str, NDArray[Any]], name: str) -> Ints:
    if members[name].dtype != np.int32:
        raise ValueError(f"its {name} are not 32-bit integers")
    return np.ascontiguousarray(members[name])
