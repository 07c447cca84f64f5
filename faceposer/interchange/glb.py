"""The face as binary glTF 2.0: its parts with textures, its shapes as morph targets, and a performance of them.

Metres, y up, the face looks along +z, as the standard wants it. The weights of the targets are those of the rig that
add up to the pose exactly; they may leave 0 to 1, which the standard allows. A shape in halves is there as a whole too,
under the name that ARKit has for it. The contact step cannot be in them.
"""

from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.files.atomic import atomic_file
from faceposer.geometry.mesh import VertexNormals
from faceposer.interchange.gltf_builder import INDICES, VERTICES, GltfBuilder
from faceposer.interchange.surfaces import base_colour, is_png, opacity, roughness
from faceposer.model.character import Character, Part
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import halves_of, whole_of
from faceposer.progress import Progress

METRES_PER_UNIT = 0.01
#: What the file says of contact, in ``asset.extras.contact``.
CONTACT_NOTE = "not contained in the morph targets"
_SMALL_INDEX = 65_535

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Surface:
    """The corners of a part as glTF wants them: one vertex for each pair of position and texture coordinate.

    Attributes:
        source: The character's vertex of each, shape (V,).
        uv: Their texture coordinates, v down, shape (V, 2); None where the part has no layout.
        indices: Of the corners of triangles, shape (3 T,).
    """

    source: NDArray[np.intp]
    uv: Floats | None
    indices: NDArray[np.intp]


def write_glb(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    progress: Progress | None = None,
) -> None:
    """Write the face of ``model`` as GLB, all or nothing.

    Targets add up linearly: the contact step is not in them, which ``asset.extras.contact`` says in the file.

    Args:
        path: The file.
        model: Whose character's parts, textures and shapes are written.
        motion: A pose, shape (r,), which becomes the default weights; or a performance, which becomes an animation of
            the weights, linear between its frames, with its first frame as the default.
        progress: Reported to.

    Raises:
        FacePoserError: If the file cannot be written, or would be too large.
    """
    frames = motion.weights(model) if isinstance(motion, Performance) else model.weights_of(motion)[None]
    character, frames = _with_wholes(model.character, frames)
    builder = GltfBuilder(_asset(character))
    normals = VertexNormals(character.triangles, len(character.vertices))
    at_rest = normals(character.vertices)
    turned = _normal_offsets(character, normals, at_rest, progress or Progress())
    materials = _Materials(builder, character)
    nodes, moving = [], []
    for part in character.parts:
        surface = _surface(character, part)
        moves = bool(np.any(character.shapes[:, part.vertices[0] : part.vertices[1]]))
        primitive = _primitive(builder, character, surface, at_rest)
        primitive["material"] = materials.of(part)
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if moves:
            primitive["targets"] = _targets(builder, character, surface, turned)
            mesh |= {"weights": frames[0].tolist(), "extras": {"targetNames": list(character.shape_names)}}
        nodes.append(builder.add("nodes", {"name": part.name, "mesh": builder.add("meshes", mesh)}))
        moving += [nodes[-1]] if moves else []
    head = builder.add("nodes", {"name": character.title or character.name, "children": nodes})
    builder.root["scene"] = builder.add("scenes", {"nodes": [head]})
    if isinstance(motion, Performance) and moving:
        _animate(builder, moving, frames, motion.rate)
    with atomic_file(path, "model") as temporary:
        temporary.write_bytes(builder.to_bytes())


def _with_wholes(character: Character, frames: NDArray[np.float64]) -> tuple[Character, NDArray[np.float64]]:
    """Return the ``character`` with the whole of each shape that it has in halves, and weights of it, (F, S), to match.

    The whole, which is the halves' sum, bears what both halves have in common, and the halves what is left.
    """
    names, shapes, weights = list(character.shape_names), [*character.shapes], [*frames.T]
    for whole in dict.fromkeys(map(whole_of, character.shape_names)):
        halves = [names.index(half) for half in halves_of(whole) if half in names]
        if len(halves) < 2 or whole in names:
            continue
        left, right = (weights[half] for half in halves)
        common = np.where(left * right > 0, np.sign(left) * np.minimum(np.abs(left), np.abs(right)), 0.0)
        for half in halves:
            weights[half] = weights[half] - common
        names.append(whole)
        shapes.append(shapes[halves[0]] + shapes[halves[1]])
        weights.append(common)
    limits = np.tile(np.array([0.0, 1.0], dtype=np.float32), (len(names), 1))
    limits[: len(character.shape_limits)] = character.shape_limits
    return replace(character, shape_names=tuple(names), shapes=np.stack(shapes), shape_limits=limits), np.stack(
        weights, 1
    )


def _asset(character: Character) -> dict[str, Any]:
    try:
        version = metadata.version("faceposer")
    except metadata.PackageNotFoundError:
        version = ""
    asset: dict[str, Any] = {"generator": f"Face Poser {version}".strip(), "extras": {"contact": CONTACT_NOTE}}
    return asset | {"copyright": " ".join(character.credits.split())} if character.credits.strip() else asset


def _normal_offsets(character: Character, normals: VertexNormals, at_rest: Floats, progress: Progress) -> list[Floats]:
    """Return how far each shape turns the normals, (N, 3) each."""
    offsets = []
    for number, shape in enumerate(character.shapes):
        progress.at("Writing", number / len(character.shapes))
        offsets.append(normals(character.vertices + shape) - at_rest)
    return offsets


def _surface(character: Character, part: Part) -> _Surface:
    """Return the corners of ``part``; vertices at the seams of its texture are doubled."""
    run = slice(*character.part_triangles(part))
    vertices, uvs = character.triangles[run].ravel(), character.triangle_uvs[run].ravel()
    pairs, indices = np.unique(vertices * np.int64(len(character.uv)) + uvs, return_inverse=True)
    source, uv_ids = np.divmod(pairs, len(character.uv))
    uv = character.uv[uv_ids].astype(np.float32)
    uv[:, 1] = 1.0 - uv[:, 1]
    return _Surface(source.astype(np.intp), uv if np.ptp(uv_ids) else None, indices.ravel())


def _primitive(builder: GltfBuilder, character: Character, surface: _Surface, at_rest: Floats) -> dict[str, Any]:
    positions = METRES_PER_UNIT * character.vertices[surface.source]
    directions = at_rest[surface.source]
    # Where all triangles about a vertex have no area, any direction will do, but the standard wants one.
    directions[np.linalg.norm(directions, axis=1) < 0.5] = (0.0, 0.0, 1.0)
    attributes = {
        "POSITION": builder.accessor(positions, "<f4", VERTICES, bounds=True),
        "NORMAL": builder.accessor(directions, "<f4", VERTICES),
    }
    if surface.uv is not None:
        attributes["TEXCOORD_0"] = builder.accessor(surface.uv, "<f4", VERTICES)
    kind = "<u2" if len(surface.source) <= _SMALL_INDEX else "<u4"
    return {"attributes": attributes, "indices": builder.accessor(surface.indices, kind, INDICES)}


def _targets(
    builder: GltfBuilder, character: Character, surface: _Surface, turned: list[Floats]
) -> list[dict[str, int]]:
    """Return a morph target for each shape; those that move nothing of this part share their zeros."""
    still: int | None = None
    targets = []
    for shape, turn in zip(character.shapes, turned, strict=True):
        offsets = METRES_PER_UNIT * shape[surface.source]
        if not offsets.any():
            if still is None:
                still = builder.accessor(offsets, "<f4", VERTICES, bounds=True)
            targets.append({"POSITION": still, "NORMAL": still})
            continue
        targets.append(
            {
                "POSITION": builder.accessor(offsets, "<f4", VERTICES, bounds=True),
                "NORMAL": builder.accessor(turn[surface.source], "<f4", VERTICES),
            }
        )
    return targets


class _Materials:
    """The materials of a character, each written when the first part asks for it."""

    def __init__(self, builder: GltfBuilder, character: Character) -> None:
        self._builder = builder
        self._character = character
        self._written: dict[str, int] = {}

    def of(self, part: Part) -> int:
        """Return the number of the material of ``part``."""
        name = part.name if part.name in self._character.textures else part.material
        if name not in self._written:
            self._written[name] = self._write(name, part.material)
        return self._written[name]

    def _write(self, name: str, material: str) -> int:
        builder = self._builder
        surface: dict[str, Any] = {
            "metallicFactor": 0.0,
            "roughnessFactor": roughness(material),
        }
        entry: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
        picture = self._character.textures.get(name)
        if picture is None:
            surface["baseColorFactor"] = [*base_colour(material), opacity(material)]
            if opacity(material) < 1.0:
                entry["alphaMode"] = "BLEND"
            return builder.add("materials", entry)
        kind = "image/png" if is_png(picture) else "image/jpeg"
        image = builder.add("images", {"name": name, "mimeType": kind, "bufferView": builder.view(picture)})
        if "samplers" not in builder.root:
            linear, linear_mipmaps, repeat = 9729, 9987, 10497
            sampler = {"magFilter": linear, "minFilter": linear_mipmaps, "wrapS": repeat, "wrapT": repeat}
            builder.add("samplers", sampler)
        surface["baseColorTexture"] = {"index": builder.add("textures", {"sampler": 0, "source": image})}
        if material == "lashes" and is_png(picture):
            entry["alphaMode"] = "BLEND"
        return builder.add("materials", entry)


def _animate(builder: GltfBuilder, nodes: list[int], frames: NDArray[np.float64], rate: float) -> None:
    """Add the animation of the weights, (F, S), to all ``nodes``."""
    sampler = {
        "input": builder.accessor(np.arange(len(frames)) / rate, "<f4", bounds=True),
        "output": builder.accessor(frames.ravel(), "<f4"),
        "interpolation": "LINEAR",
    }
    channels = [{"sampler": 0, "target": {"node": node, "path": "weights"}} for node in nodes]
    builder.add("animations", {"name": "performance", "samplers": [sampler], "channels": channels})
