"""Expressions of VRM avatars: named blends of morph targets in a glTF file.

Avatars for "perfect sync" include ARKit's shapes. Sources: VRMC_vrm-1.0 (expressions.md) and VRM 0.x
(blendShapeMaster).
"""

import re
from dataclasses import dataclass

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_file import GltfFile, GltfObject, clean_name

# Weights of exaggerated expressions from 0 to 1 remain below this.
_MOST_WEIGHT = 10.0


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


def read_expressions(
    file: GltfFile, weights_range: float | None = None
) -> tuple[dict[str, list[Bind]], tuple[str, ...]]:
    """Return the morph targets of each expression by name, and notes for the user; both empty without an avatar.

    Weights range from 0 to 1 in VRM 1.0 and from 0 to 100 in VRM 0.x; files that use the range of the other version
    are recognised by their largest weight. Expressions without morph targets, or with references to missing objects,
    are left out.

    Args:
        file: The avatar.
        weights_range: Full weight of all expressions, in place of that of the version or the largest weight.
    """
    extensions = file.root.child("extensions")
    expressions = extensions.child("VRMC_vrm").child("expressions")
    new = [
        (clean_name(name), group.child(name))
        for group in (expressions.child("preset"), expressions.child("custom"))
        for name in group.data
    ]
    try:
        groups = extensions.child("VRM").child("blendShapeMaster").children("blendShapeGroups")
    except FacePoserError:
        groups = []
    old = [(clip.name() or clip.name("presetName"), clip) for clip in groups]
    found, notes = _read_clips(file, new, ("morphTargetBinds", "nodes", "node"), 1.0, weights_range)
    more, more_notes = _read_clips(file, old, ("binds", "meshes", "mesh"), 100.0, weights_range)
    return found | {name: binds for name, binds in more.items() if name not in found}, (*notes, *more_notes)


def _read_clips(
    file: GltfFile, clips: list[tuple[str, GltfObject]], keys: tuple[str, str, str], whole: float, given: float | None
) -> tuple[dict[str, list[Bind]], tuple[str, ...]]:
    """Return the expressions of one version of VRM, of full weight ``given``, by default ``whole``, and notes."""
    found: dict[str, list[Bind]] = {}
    for name, clip in clips:
        try:
            binds = [_bind(file, bind, keys[1], keys[2], whole) for bind in clip.children(keys[0])]
        except FacePoserError:
            continue
        if name and binds:
            found.setdefault(name, binds)
    largest = max((abs(bind.weight) for binds in found.values() for bind in binds), default=0.0)
    other = 101.0 - whole
    foreign = largest > _MOST_WEIGHT if whole == 1.0 else 0.0 < largest <= other
    foreign = foreign and given is None
    full = given or (other if foreign else whole)
    scaled = {
        name: [Bind(bind.holder, bind.index, bind.target, bind.weight / full) for bind in binds]
        for name, binds in found.items()
    }
    note = (
        f"The weights of the avatar's expressions are up to {largest:.3g}; they were read as 0 to {full:g}, not 0 to "
        f"{whole:g}."
    )
    return scaled, (note,) if foreign else ()


def _bind(file: GltfFile, bind: GltfObject, holder: str, key: str, whole: float) -> Bind:
    file.get(holder, bind, key)
    return Bind(holder, bind.integer(key), bind.integer("index"), bind.number("weight", whole))


def spelling_key(name: str) -> str:
    """Return a key common to all spellings of a shape: the last part in lower case, with sides as l and r.

    An avatar's expression often duplicates a target in another spelling, as EyeBlinkLeft does eyeBlink_L.
    """
    plain = re.sub(r"[\W_]", "", re.split(r"[.:](?=..)", name)[-1].casefold())
    return re.sub(r"(?<=.)(left|right)$", lambda side: side[0][0], plain)
