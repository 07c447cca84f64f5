"""The container, buffers and accessors of glTF 2.0; all counts and offsets are checked before use.

Section numbers in the glTF modules of this package refer to the Khronos glTF 2.0 specification, revision 2.0.1. The
JSON is not converted to objects: existing object models reject some valid files (extras may be anything) and take
seconds for avatars with thousands of accessors.
"""

import base64
import binascii
import re
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted, short_name, there_are
from faceposer.files import paths
from faceposer.files.json_documents import parse_json, shown
from faceposer.files.reading import read_bytes

_MAX_BYTES = 1 << 30
#: Limit on the entries of an accessor without data in the file.
_MAX_UNBACKED = 1_000_000
#: Bound on numbers in the JSON, which keeps products of a few of them finite.
_LARGEST = 1e30
_MAGIC = b"glTF"
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:|//")
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
#: Number of components by accessor type, and NumPy type by component type (3.6.2.2).
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
#: Extensions that may be required: the coordinates of meshes and the images of textures do not need them, or they are
#: read.
_KNOWN_EXTENSIONS = (
    *("KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif"),
    *("MSFT_texture_dds", "KHR_lights_punctual", "KHR_xmp", "KHR_xmp_json_ld", "KHR_animation_pointer", "VRM"),
    *("KHR_node_visibility", "EXT_lights_image_based", "MSFT_lod"),
)
_IGNORED = ("KHR_materials_", "VRMC_", "EXT_materials_", "ADOBE_materials_", "KHR_techniques_")
_COMPRESSION = {"draco": "Draco", "meshopt": "meshopt"}


class GltfObject:
    """A JSON object of the file, with its place in the document for error messages.

    Attributes:
        place: Place such as "accessors[3]"; empty for the root.
        data: The JSON object.
    """

    def __init__(self, path: Path, place: str, data: dict[str, Any]) -> None:
        self._path = path
        self.place = place
        self.data = data

    def error(self, problem: str) -> FacePoserError:
        """Return the error that reports the ``problem`` in this object."""
        return FacePoserError(
            f"The rig '{self._path}' is broken in {self.place or 'its JSON'}: {problem}; export it again."
        )

    def integer(self, key: str, default: int | None = None, high: int = 1 << 40) -> int:
        """Return the integer ``key``, from 0 to ``high``, or ``default``, if given, for a missing one."""
        value = self.data.get(key)
        if value is None and default is not None:
            return default
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= high:
            reason = "is missing" if value is None else f"is {_said(value)}, not an integer from 0 to {high}"
            raise self.error(f"'{key}' {reason}")
        return value

    def text(self, key: str) -> str:
        """Return the text ``key``, empty if there is none."""
        value = self.data.get(key)
        return value if isinstance(value, str) else ""

    def name(self, key: str = "name") -> str:
        """Return the text ``key`` as a name in one line that can be written to any file."""
        return clean_name(self.text(key))

    def names(self, key: str) -> list[str]:
        """Return the list of names ``key``, with "" for items that are not text; empty if it is missing."""
        values = self.data.get(key)
        return [clean_name(v) if isinstance(v, str) else "" for v in values] if isinstance(values, list) else []

    def numbers(self, key: str, default: list[float]) -> NDArray[np.float64]:
        """Return the list of numbers ``key``, of the length of ``default``, or ``default`` if it is missing."""
        values = self.data.get(key)
        if values is None:
            values = default
        good = isinstance(values, list) and len(values) == len(default)
        if not good or not all(isinstance(v, int | float) and abs(v) < _LARGEST for v in values):
            raise self.error(f"'{key}' must be {len(default)} finite numbers")
        return np.array(values, dtype=np.float64)

    def number(self, key: str, default: float) -> float:
        """Return the number ``key``, or ``default`` if it is missing."""
        value = self.data.get(key, default)
        if not isinstance(value, int | float) or not abs(value) < _LARGEST:
            raise self.error(f"'{key}' must be a finite number")
        return float(value)

    def integers(self, key: str, high: int) -> list[int]:
        """Return the list ``key`` of integers from 0 to ``high``, empty if it is missing."""
        values = self.data.get(key)
        if values is None:
            return []
        if not isinstance(values, list):
            raise self.error(f"'{key}' must be a list")
        return [GltfObject(self._path, self.place, {key: v}).integer(key, high=high) for v in values]

    def child(self, key: str) -> "GltfObject":
        """Return the object ``key``, empty if there is none."""
        value = self.data.get(key)
        place = f"{self.place}.{key}" if self.place else key
        return GltfObject(self._path, place, value if isinstance(value, dict) else {})

    def children(self, key: str) -> list["GltfObject"]:
        """Return the list of objects ``key``, empty if it is missing."""
        values = self.data.get(key)
        if values is None:
            return []
        place = f"{self.place}.{key}" if self.place else key
        if not isinstance(values, list) or not all(isinstance(v, dict) for v in values):
            raise self.error(f"'{key}' must be a list of objects")
        return [GltfObject(self._path, f"{place}[{i}]", v) for i, v in enumerate(values)]


def _said(value: Any) -> str:
    return f"the text {shown(value)}" if isinstance(value, str) else shown(value)


def clean_name(text: str) -> str:
    """Return ``text`` in one line, without lone surrogates, which cannot be encoded; otherwise to the letter."""
    return re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029]+", " ", text.encode("utf-8", "replace").decode("utf-8")).strip()


class GltfFile:
    """A glTF file open for reading: .glb, .vrm, or .gltf with its external files.

    Attributes:
        path: Path of the file.
        root: Root of the JSON document.
    """

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            OSError: If it cannot be read.
            FacePoserError: If it is larger than 1 GB, truncated, or not glTF 2.
        """
        self.path = path
        self._total_bytes = 0
        self._lists: dict[str, list[GltfObject]] = {}
        self._buffers: dict[int, memoryview] = {}
        data = memoryview(self._read_file(path, "The rig"))
        self._binary: memoryview | None = None
        text = data
        if bytes(data[:4]) == _MAGIC:
            text, self._binary = self._chunks(data)
        try:
            document = parse_json(bytes(text))
        except FacePoserError as error:
            binary = path.suffix.lower() == ".glb" and not bytes(text[:512]).isascii()
            reason = "it does not begin as a .glb does" if binary else error
            raise FacePoserError(f"'{path}' is not glTF: {reason}; export it again.") from error
        if not isinstance(document, dict) or not isinstance(document.get("asset"), dict):
            raise FacePoserError(f"The rig '{path}' is not glTF: it has no 'asset'; export it again as glTF 2.")
        self.root = GltfObject(path, "", document)
        version = str(document["asset"].get("version"))
        if version.partition(".")[0] != "2":
            raise FacePoserError(f"The rig '{path}' is glTF {version[:20]}; export it as glTF 2.")
        self._check_required()

    def _check_required(self) -> None:
        """Raise a FacePoserError if the file requires an extension without which its meshes cannot be read (3.12)."""
        required = self.root.names("extensionsRequired")
        compressed = {name: kind for name in required for key, kind in _COMPRESSION.items() if key in name.lower()}
        if compressed:
            raise FacePoserError(
                f"The rig '{self.path}' is compressed with {next(iter(compressed.values()))}, which cannot be read; "
                "export it without compression."
            )
        unknown = [name for name in required if name not in _KNOWN_EXTENSIONS and not name.startswith(_IGNORED)]
        if unknown:
            raise FacePoserError(
                f"The rig '{self.path}' requires the extension {short_name(unknown[0])!r} of glTF, which cannot be "
                "read; export it without this extension."
            )

    def _read_file(self, path: Path, noun: str) -> bytes:
        """Return the bytes of a file; all files together must not exceed 1 GB."""
        content = read_bytes(path, _MAX_BYTES)
        self._total_bytes += len(content)
        if self._total_bytes > _MAX_BYTES:
            raise FacePoserError(f"{noun} '{path}' is larger than {_MAX_BYTES >> 30} GB; choose a smaller one.")
        return content

    def _chunks(self, data: memoryview) -> tuple[memoryview, memoryview | None]:
        """Return the JSON chunk and the binary chunk, if any, of a GLB (4.4)."""
        truncated = FacePoserError(
            f"The rig '{self.path}' is truncated after {counted(len(data), 'byte')}; copy or export it again."
        )
        if len(data) < 20:
            raise truncated
        version, length, first, kind = struct.unpack_from("<IIII", data, 4)
        if version != 2:
            raise FacePoserError(f"The rig '{self.path}' is binary glTF {version}; export it as glTF 2.")
        if length > len(data):
            raise truncated
        if kind != _JSON_CHUNK or 20 + first > length:
            raise FacePoserError(f"The rig '{self.path}' is broken at byte 12: no JSON chunk; export it again.")
        start = 20 + first
        if start + 8 > length:
            return data[20:start], None
        size, kind = struct.unpack_from("<II", data, start)
        if kind != _BINARY_CHUNK:
            return data[20:start], None
        if start + 8 + size > length:
            raise FacePoserError(
                f"The rig '{self.path}' is broken at byte {start}: its chunk of {size} bytes is longer than the file; "
                "export it again."
            )
        return data[20:start], data[start + 8 : start + 8 + size]

    def all(self, kind: str) -> list[GltfObject]:
        """Return the file's list ``kind``, such as "nodes"."""
        if kind not in self._lists:
            self._lists[kind] = self.root.children(kind)
        return self._lists[kind]

    def get(self, kind: str, by: GltfObject, key: str) -> GltfObject:
        """Return the entry of the list ``kind`` at the index ``key`` of ``by``."""
        entries = self.all(kind)
        index = by.integer(key)
        if index >= len(entries):
            one = kind.removesuffix("es" if kind == "meshes" else "s")
            raise by.error(f"'{key}' is {index}, but {there_are(len(entries), one, kind)}")
        return entries[index]

    def resource(self, by: GltfObject, uri: str) -> bytes:
        """Return the data of ``uri``: embedded data, or the content of a file next to this one.

        Raises:
            FacePoserError: If it is invalid, not local, or cannot be read.
        """
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                return base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
            except (binascii.Error, ValueError) as error:
                raise by.error("its data URI is not base64") from error
        name = unquote(uri)
        if _URL.match(name):
            raise by.error(f"it is at '{short_name(name)}', not next to the rig")
        path = self.path.parent / name
        try:
            if not path.resolve().is_relative_to(self.path.parent.resolve()):
                raise by.error(f"it is at '{short_name(name)}', outside the rig's folder")
            return self._read_file(path, f"For {by.place} of the rig '{self.path}', the resource")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is not a valid file name"
            raise FacePoserError(
                f"The rig '{self.path}' needs '{str(path)[:200]}' ({by.place}), which cannot be read: {reason}; "
                "copy it there or export the rig as a single .glb."
            ) from error

    def unusable(self, uri: str) -> str:
        """Return why the file at ``uri`` cannot be read, as a clause; "" if it can be, or if it is embedded data."""
        if uri.startswith("data:"):
            return ""
        name = unquote(uri)
        if _URL.match(name):
            return "it is a URL, and nothing is downloaded; save it next to the file"
        path = self.path.parent / name
        if not paths.resolved(path).is_relative_to(paths.resolved(self.path.parent)):
            return f"it lies outside of the folder '{self.path.parent}'; copy it there"
        if not paths.exists(path):
            return paths.problem(path) or f"there is no such file in the folder '{self.path.parent}'; copy it there"
        return "" if paths.is_file(path) else "it is not a file"

    def _buffer(self, by: GltfObject) -> memoryview:
        buffer = self.get("buffers", by, "buffer")
        index = by.integer("buffer")
        if index not in self._buffers:
            uri = buffer.text("uri")
            if uri:
                data = memoryview(self.resource(buffer, uri))
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                raise buffer.error("it has neither 'uri' nor a binary chunk")
            length = buffer.integer("byteLength")
            if length > len(data):
                raise buffer.error(f"it is truncated: it has {len(data)} of {length} bytes")
            self._buffers[index] = data[:length]
        return self._buffers[index]

    def view(self, by: GltfObject, key: str = "bufferView") -> tuple[memoryview, int]:
        """Return the bytes of the buffer view that ``by`` refers to, and its stride (0 if unspecified)."""
        view = self.get("bufferViews", by, key)
        if any("meshopt" in name for name in view.child("extensions").data):
            buffer = self.get("buffers", view, "buffer")
            if not buffer.text("uri") and (view.integer("buffer") or self._binary is None):
                raise FacePoserError(
                    f"The rig '{self.path}' is compressed with meshopt, which cannot be read; export it without "
                    "compression."
                )
        data = self._buffer(view)
        start = view.integer("byteOffset", 0)
        length = view.integer("byteLength")
        if start + length > len(data):
            raise view.error(f"its bytes {start} to {start + length} exceed its buffer of {len(data)}")
        return data[start : start + length], view.integer("byteStride", 0, high=1 << 20)

    def count(self, by: GltfObject, key: str) -> int:
        """Return the number of entries of the accessor at the index ``key`` of ``by``."""
        return self.get("accessors", by, key).integer("count")

    def floats(self, by: GltfObject, key: str, kind: str) -> NDArray[np.floating]:
        """Return the numbers of the accessor of type ``kind`` at the index ``key`` of ``by``, (count, components).

        Floats are in single precision as in the file; integers are converted to double precision, and scaled to 0..1 or
        -1..1 if they are normalised (3.11).

        Raises:
            FacePoserError: If it is of another type or exceeds its data.
        """
        accessor = self.get("accessors", by, key)
        values = self._values(accessor, kind)
        if values.dtype.kind == "f":
            return values
        scaled = values.astype(np.float64)
        if accessor.data.get("normalized") is True:
            scaled = np.maximum(scaled / np.iinfo(values.dtype).max, -1.0)
        return scaled

    def integers(self, by: GltfObject, key: str, kind: str) -> NDArray[np.int64]:
        """Return the integers of an accessor, shape (count, components); otherwise like ``floats``."""
        accessor = self.get("accessors", by, key)
        values = self._values(accessor, kind)
        if values.dtype.kind == "f":
            raise accessor.error("it must have integers, not floats")
        return values.astype(np.int64)

    def _values(self, accessor: GltfObject, kind: str) -> NDArray[Any]:
        count = accessor.integer("count", high=(1 << 32) - 1)
        if accessor.text("type") != kind:
            raise accessor.error(f"its type is '{accessor.text('type')[:20]}', not {kind}")
        dtype = self._dtype(accessor)
        columns = _COLUMNS[kind]
        if accessor.data.get("bufferView") is not None:
            values = self._array(accessor, count, columns, dtype)
        elif count > _MAX_UNBACKED:
            raise accessor.error(f"it has {counted(count, 'entry', 'entries')} without data, more than {_MAX_UNBACKED}")
        else:
            values = np.broadcast_to(np.zeros(1, dtype), (count, columns))
        if accessor.data.get("sparse") is None:
            return values
        sparse = accessor.child("sparse")
        number = sparse.integer("count", high=count)
        indices, replacements = sparse.child("indices"), sparse.child("values")
        index = self._array(indices, number, 1, self._dtype(indices))[:, 0]
        if index.dtype.kind == "f" or (number and int(index.max()) >= count):
            raise indices.error(f"an index is not one of the accessor's {counted(count, 'entry', 'entries')}")
        values = values.copy()
        values[index] = self._array(replacements, number, columns, dtype)
        return values

    def _dtype(self, by: GltfObject) -> np.dtype[Any]:
        kind = by.integer("componentType")
        if kind not in _DTYPES:
            raise by.error(f"'componentType' is {kind}, not one of {', '.join(map(str, _DTYPES))}")
        return np.dtype(_DTYPES[kind])

    def _array(self, by: GltfObject, count: int, columns: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array of ``count`` entries in the buffer view of ``by``, without copying."""
        data, stride = self.view(by)
        start = by.integer("byteOffset", 0)
        size = columns * dtype.itemsize
        stride = stride or size
        if stride < size:
            raise by.error(f"its entries of {size} bytes overlap with a stride of {stride}")
        end = start + (count - 1) * stride + size if count else start
        if end > len(data):
            raise by.error(
                f"its {counted(count, 'entry', 'entries')} end at byte {end} of a buffer view of {len(data)}"
            )
        if count == 0:
            return np.zeros((0, columns), dtype)
        return np.ndarray((count, columns), dtype, buffer=data, offset=start, strides=(stride, dtype.itemsize))
