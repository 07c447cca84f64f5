"""Expressions of VRM avatars: named blends of morph targets in a glTF file.

Avatars for "perfect sync" include ARKit's shapes. Sources: VRMC_vrm-1.0 (expressions.md) and VRM 0.x
(blendShapeMaster).
"""

import re
from dataclasses import dataclass

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_file import GltfFile, GltfObject, clean_name


@dataclass(frozen=True)
class Bind:
    """The contribution of a morph target to an expression.

    Attributes:
        holder: "nodes" or "meshes", the list that ``index`` refers to.
        index: Index of the node or mesh with the target.
        target: Index of the target.
        weight: Weight of the target, usually from 0 to 1.
    """

    holder: str
    index: int
    target: int
    weight: float


def read_expressions(file: GltfFile) -> dict[str, list[Bind]]:
    """Return the morph targets of each expression by name; empty for files without an avatar.

    Expressions without morph targets, or with references to missing objects, are left out.
    """
    clips: list[tuple[str, GltfObject]] = []
    extensions = file.root.child("extensions")
    expressions = extensions.child("VRMC_vrm").child("expressions")
    for group in (expressions.child("preset"), expressions.child("custom")):
        clips += [(clean_name(name), group.child(name)) for name in group.data]
    try:
        old = extensions.child("VRM").child("blendShapeMaster").children("blendShapeGroups")
    except FacePoserError:
        old = []
    clips += [(clip.name() or clip.name("presetName"), clip) for clip in old]
    found: dict[str, list[Bind]] = {}
    for name, clip in clips:
        try:
            binds = [_bind(file, bind, "nodes", "node", 1.0) for bind in clip.children("morphTargetBinds")]
            binds += [_bind(file, bind, "meshes", "mesh", 100.0) for bind in clip.children("binds")]
        except FacePoserError:
            continue
        if name and binds:
            found.setdefault(name, binds)
    return found


def _bind(file: GltfFile, bind: GltfObject, holder: str, key: str, whole: float) -> Bind:
    file.get(holder, bind, key)
    return Bind(holder, bind.integer(key), bind.integer("index"), bind.number("weight", whole) / whole)


def spelling_key(name: str) -> str:
    """Return a key common to all spellings of a shape: the last part in lower case, with sides as l and r.

    An avatar's expression often duplicates a target in another spelling, as EyeBlinkLeft does eyeBlink_L.
    """
    plain = re.sub(r"[\W_]", "", re.split(r"[.:](?=..)", name)[-1].casefold())
    return re.sub(r"(?<=.)(left|right)$", lambda side: side[0][0], plain)
