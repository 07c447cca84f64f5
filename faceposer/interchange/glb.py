"""Export as binary glTF 2.0: parts with textures, shapes as morph targets, and an animation of their weights.

In metres, with y up and the face looking along +z, as the standard requires. The weights of the targets are those of
the rig that reproduce the pose exactly; they may exceed 0 to 1, which the standard allows. A shape in halves is
additionally written as a whole, under its ARKit name. Morph targets cannot contain the contact step.
"""

from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.files.atomic import atomic_file
from faceposer.files.writing import check_finite, not_finite
from faceposer.geometry.mesh import VertexNormals
from faceposer.interchange.gltf_builder import INDICES, VERTICES, GltfBuilder
from faceposer.interchange.surfaces import base_colour, check_textures, is_png, opacity, roughness
from faceposer.model.character import Character, Part
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import half_shapes_of, whole_shape_of
from faceposer.progress import Progress

METRES_PER_UNIT = 0.01
#: Remark on contact in the file, ``asset.extras.contact``.
CONTACT_NOTE = "not contained in the morph targets"
_LARGEST_UINT16 = 65_535

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Surface:
    """Vertices of a part for glTF: one for each pair of position and texture coordinates.

    Attributes:
        source: Index of the character's vertex for each vertex, shape (V,).
        uv: Texture coordinates, v down, shape (V, 2); None if the part has no layout.
        indices: Vertex indices of the triangles' corners, shape (3 T,).
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
    """Write the face of ``model`` as GLB, atomically.

    Targets add up linearly, so they cannot contain the contact step; ``asset.extras.contact`` in the file states this.

    Args:
        path: The file.
        model: The face with its parts, textures and shapes.
        motion: A pose, shape (r,), written as the default weights; or a performance, written as an animation of the
            weights, linear between its frames, with its first frame as the default.
        progress: Receives the progress.

    Raises:
        FacePoserError: If the file cannot be written, or would be too large.
    """
    check_finite(path, "model", motion.coefficients if isinstance(motion, Performance) else motion)
    check_textures(path, "model", model.character)
    frames = motion.weights(model) if isinstance(motion, Performance) else model.weights_of(motion)[None]
    character, frames = _with_wholes(model.character, frames)
    builder = GltfBuilder(_asset(character))
    normals = VertexNormals(character.triangles, len(character.vertices))
    neutral_normals = normals(character.vertices)
    normal_offsets = _normal_offsets(character, normals, neutral_normals, progress or Progress())
    materials = _Materials(builder, character)
    nodes, animated_nodes = [], []
    for part in character.parts:
        surface = _surface(character, part)
        moves = bool(np.any(character.shapes[:, part.vertices[0] : part.vertices[1]]))
        primitive = _primitive(builder, character, surface, neutral_normals)
        primitive["material"] = materials.index_of(part)
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if moves:
            primitive["targets"] = _targets(builder, character, surface, normal_offsets)
            mesh |= {"weights": frames[0].tolist(), "extras": {"targetNames": list(character.shape_names)}}
        nodes.append(builder.add("nodes", {"name": part.name, "mesh": builder.add("meshes", mesh)}))
        animated_nodes += [nodes[-1]] if moves else []
    head = builder.add("nodes", {"name": character.title or character.name, "children": nodes})
    builder.root["scene"] = builder.add("scenes", {"nodes": [head]})
    if isinstance(motion, Performance) and animated_nodes:
        _animate(builder, animated_nodes, frames, motion.rate)
    try:
        content = builder.to_bytes()
    except ValueError as error:
        raise not_finite(path, "model") from error
    with atomic_file(path, "model") as temporary:
        temporary.write_bytes(content)


def _with_wholes(character: Character, frames: NDArray[np.float64]) -> tuple[Character, NDArray[np.float64]]:
    """Return ``character`` with a whole shape added for each pair of half shapes, and matching weights, shape (F, S).

    The whole shape is the sum of its halves; it gets the weight common to both, and the halves keep the difference.
    """
    names, shapes, weights = list(character.shape_names), [*character.shapes], [*frames.T]
    for whole in dict.fromkeys(map(whole_shape_of, character.shape_names)):
        halves = [names.index(half) for half in half_shapes_of(whole) if half in names]
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


def _normal_offsets(character: Character, normals: VertexNormals, neutral: Floats, progress: Progress) -> list[Floats]:
    """Return the change of the ``neutral`` normals by each shape, (N, 3) each."""
    offsets = []
    for number, shape in enumerate(character.shapes):
        progress.at("Writing", number / len(character.shapes))
        offsets.append(normals(character.vertices + shape) - neutral)
    return offsets


def _surface(character: Character, part: Part) -> _Surface:
    """Return the vertices of ``part``; those on texture seams are duplicated."""
    run = slice(*character.part_triangles(part))
    vertices, uvs = character.triangles[run].ravel(), character.triangle_uvs[run].ravel()
    pairs, indices = np.unique(vertices * np.int64(len(character.uv)) + uvs, return_inverse=True)
    source, uv_ids = np.divmod(pairs, len(character.uv))
    uv = character.uv[uv_ids].astype(np.float32)
    uv[:, 1] = 1.0 - uv[:, 1]
    return _Surface(source.astype(np.intp), uv if np.ptp(uv_ids) else None, indices.ravel())


def _primitive(builder: GltfBuilder, character: Character, surface: _Surface, normals: Floats) -> dict[str, Any]:
    positions = METRES_PER_UNIT * character.vertices[surface.source]
    directions = normals[surface.source]
    # The standard requires unit normals; where all triangles around a vertex have no area, any direction will do.
    directions[np.linalg.norm(directions, axis=1) < 0.5] = (0.0, 0.0, 1.0)
    attributes = {
        "POSITION": builder.accessor(positions, "<f4", VERTICES, bounds=True),
        "NORMAL": builder.accessor(directions, "<f4", VERTICES),
    }
    if surface.uv is not None:
        attributes["TEXCOORD_0"] = builder.accessor(surface.uv, "<f4", VERTICES)
    kind = "<u2" if len(surface.source) <= _LARGEST_UINT16 else "<u4"
    return {"attributes": attributes, "indices": builder.accessor(surface.indices, kind, INDICES)}


def _targets(
    builder: GltfBuilder, character: Character, surface: _Surface, normal_offsets: list[Floats]
) -> list[dict[str, int]]:
    """Return a morph target for each shape; shapes that do not move this part share an accessor of zeros."""
    zeros: int | None = None
    targets = []
    for shape, normal_offset in zip(character.shapes, normal_offsets, strict=True):
        offsets = METRES_PER_UNIT * shape[surface.source]
        if not offsets.any():
            if zeros is None:
                zeros = builder.accessor(offsets, "<f4", VERTICES, bounds=True)
            targets.append({"POSITION": zeros, "NORMAL": zeros})
            continue
        targets.append(
            {
                "POSITION": builder.accessor(offsets, "<f4", VERTICES, bounds=True),
                "NORMAL": builder.accessor(normal_offset[surface.source], "<f4", VERTICES),
            }
        )
    return targets


class _Materials:
    """Materials of a character, written on first use."""

    def __init__(self, builder: GltfBuilder, character: Character) -> None:
        self._builder = builder
        self._character = character
        self._written: dict[str, int] = {}

    def index_of(self, part: Part) -> int:
        """Return the index of the material of ``part``, writing it first if necessary."""
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
        texture = self._character.textures.get(name)
        if texture is None:
            surface["baseColorFactor"] = [*base_colour(material), opacity(material)]
            if opacity(material) < 1.0:
                entry["alphaMode"] = "BLEND"
            return builder.add("materials", entry)
        kind = "image/png" if is_png(texture) else "image/jpeg"
        image = builder.add("images", {"name": name, "mimeType": kind, "bufferView": builder.view(texture)})
        if "samplers" not in builder.root:
            linear, linear_mipmaps, repeat = 9729, 9987, 10497
            sampler = {"magFilter": linear, "minFilter": linear_mipmaps, "wrapS": repeat, "wrapT": repeat}
            builder.add("samplers", sampler)
        surface["baseColorTexture"] = {"index": builder.add("textures", {"sampler": 0, "source": image})}
        if material == "lashes" and is_png(texture):
            entry["alphaMode"] = "BLEND"
        return builder.add("materials", entry)


def _animate(builder: GltfBuilder, nodes: list[int], frames: NDArray[np.float64], rate: float) -> None:
    """Add the animation of the weights ``frames``, (F, S), to all ``nodes``."""
    sampler = {
        "input": builder.accessor(np.arange(len(frames)) / rate, "<f4", bounds=True),
        "output": builder.accessor(frames.ravel(), "<f4"),
        "interpolation": "LINEAR",
    }
    channels = [{"sampler": 0, "target": {"node": node, "path": "weights"}} for node in nodes]
    builder.add("animations", {"name": "performance", "samplers": [sampler], "channels": channels})
