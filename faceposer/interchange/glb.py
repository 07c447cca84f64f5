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
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import halves_of, whole_of
from faceposer.model.subject import Part, Subject
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
        source: The subject's vertex of each, shape (V,).
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
        model: Whose subject's parts, textures and shapes are written.
        motion: A pose, shape (r,), which becomes the default weights; or a performance, which becomes an animation of
            the weights, linear between its frames, with its first frame as the default.
        progress: Reported to.

    Raises:
        FacePoserError: If the file cannot be written, or would be too large.
    """
    frames = motion.weights(model) if isinstance(motion, Performance) else model.weights_of(motion)[None]
    subject, frames = _with_wholes(model.subject, frames)
    builder = GltfBuilder(_asset(subject))
    normals = VertexNormals(subject.triangles, len(subject.vertices))
    at_rest = normals(subject.vertices)
    turned = _normal_offsets(subject, normals, at_rest, progress or Progress())
    materials = _Materials(builder, subject)
    nodes, moving = [], []
    for part in subject.parts:
        surface = _surface(subject, part)
        moves = bool(np.any(subject.shapes[:, part.vertices[0] : part.vertices[1]]))
        primitive = _primitive(builder, subject, surface, at_rest)
        primitive["material"] = materials.of(part)
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if moves:
            primitive["targets"] = _targets(builder, subject, surface, turned)
            mesh |= {"weights": frames[0].tolist(), "extras": {"targetNames": list(subject.shape_names)}}
        nodes.append(builder.add("nodes", {"name": part.name, "mesh": builder.add("meshes", mesh)}))
        moving += [nodes[-1]] if moves else []
    head = builder.add("nodes", {"name": subject.title or subject.name, "children": nodes})
    builder.root["scene"] = builder.add("scenes", {"nodes": [head]})
    if isinstance(motion, Performance) and moving:
        _animate(builder, moving, frames, motion.rate)
    with atomic_file(path, "model") as temporary:
        temporary.write_bytes(builder.to_bytes())


def _with_wholes(subject: Subject, frames: NDArray[np.float64]) -> tuple[Subject, NDArray[np.float64]]:
    """Return the ``subject`` with the whole of each shape that it has in halves, and weights of it, (F, S), to match.

    The whole, which is the halves' sum, bears what both halves have in common, and the halves what is left.
    """
    names, shapes, weights = list(subject.shape_names), [*subject.shapes], [*frames.T]
    for whole in dict.fromkeys(map(whole_of, subject.shape_names)):
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
    limits[: len(subject.shape_limits)] = subject.shape_limits
    return replace(subject, shape_names=tuple(names), shapes=np.stack(shapes), shape_limits=limits), np.stack(
        weights, 1
    )


def _asset(subject: Subject) -> dict[str, Any]:
    try:
        version = metadata.version("faceposer")
    except metadata.PackageNotFoundError:
        version = ""
    asset: dict[str, Any] = {"generator": f"Face Poser {version}".strip(), "extras": {"contact": CONTACT_NOTE}}
    return asset | {"copyright": " ".join(subject.credits.split())} if subject.credits.strip() else asset


def _normal_offsets(subject: Subject, normals: VertexNormals, at_rest: Floats, progress: Progress) -> list[Floats]:
    """Return how far each shape turns the normals, (N, 3) each."""
    offsets = []
    for number, shape in enumerate(subject.shapes):
        progress.at("Writing", number / len(subject.shapes))
        offsets.append(normals(subject.vertices + shape) - at_rest)
    return offsets


def _surface(subject: Subject, part: Part) -> _Surface:
    """Return the corners of ``part``; vertices at the seams of its texture are doubled."""
    run = slice(*subject.part_triangles(part))
    vertices, uvs = subject.triangles[run].ravel(), subject.triangle_uvs[run].ravel()
    pairs, indices = np.unique(vertices * np.int64(len(subject.uv)) + uvs, return_inverse=True)
    source, uv_ids = np.divmod(pairs, len(subject.uv))
    uv = subject.uv[uv_ids].astype(np.float32)
    uv[:, 1] = 1.0 - uv[:, 1]
    return _Surface(source.astype(np.intp), uv if np.ptp(uv_ids) else None, indices.ravel())


def _primitive(builder: GltfBuilder, subject: Subject, surface: _Surface, at_rest: Floats) -> dict[str, Any]:
    positions = METRES_PER_UNIT * subject.vertices[surface.source]
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


def _targets(builder: GltfBuilder, subject: Subject, surface: _Surface, turned: list[Floats]) -> list[dict[str, int]]:
    """Return a morph target for each shape; those that move nothing of this part share their zeros."""
    still: int | None = None
    targets = []
    for shape, turn in zip(subject.shapes, turned, strict=True):
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
    """The materials of a subject, each written when the first part asks for it."""

    def __init__(self, builder: GltfBuilder, subject: Subject) -> None:
        self._builder = builder
        self._subject = subject
        self._written: dict[str, int] = {}

    def of(self, part: Part) -> int:
        """Return the number of the material of ``part``."""
        name = part.name if part.name in self._subject.textures else part.material
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
        picture = self._subject.textures.get(name)
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
