"""Left and right of a rig: names from the viewer's side, and meshes that are mirrored as a whole."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.training.canonical_frame import FaceFrame, mean_direction, opposite_name
from faceposer.training.kinds import Sides

Array = NDArray[np.float64]
Shapes = dict[str, NDArray[np.float32]]

#: Shapes that move the face to the side of their name.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
# Distance from the plane of symmetry in centimetres, and share of the displacements, that belong to a side.
_ASIDE = 0.5
_SIDEWARD = 0.2
_SHOWN = 4


@dataclass(frozen=True, eq=False)
class ReadSides:
    """Shapes with their sides.

    Attributes:
        named: Offsets by the name that the character uses.
        moved: Offsets by the name of the side that they move, in the same order.
        upright: Similarity to the canonical frame; with a reflection for a mirrored mesh.
        renamed: New name by the name in the file of exchanged shapes.
        notes: Sentences for the user.
    """

    named: Shapes
    moved: Shapes
    upright: Similarity
    renamed: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def sides_of(vertices: Array, named: Shapes, frame: FaceFrame, sides: Sides) -> ReadSides:
    """Return the shapes by their sides: of the names, or exchanged where the names are those of the viewer's side.

    Args:
        vertices: Vertices in the file's axes and unit, shape (N, 3).
        named: Offsets, shape (N, 3), by ARKit's names.
        frame: Canonical frame of the face.
        sides: "auto" to exchange names that move the other side, "as-named", or "exchanged" for all.
    """
    if sides == "auto" and frame.exchanged and frame.inwards:
        note = (
            "The mesh is mirrored: its faces point inwards and its left shapes move its right side. It was mirrored "
            "back; poses are saved as in the file."
        )
        return ReadSides(named, named, frame.mirrored, notes=(note,))
    inwards = ("The faces of the mesh point inwards; reverse them where it looks wrong.",) if frame.inwards else ()
    placed = frame.upright.apply(vertices)
    other = {name for name, offsets in named.items() if _moves_other_side(name, offsets, placed, frame.upright)}
    # A rig is exchanged as a whole, but its jaw and mouth may be named by the side to which they go.
    exchanged = _with_opposites(other, named) if frame.exchanged else set()
    moved = _renamed(named, exchanged)
    if sides == "exchanged":
        all_sided = {name for name in named if opposite_name(name) != name}
        note = f"Left and right were exchanged in the names of {len(all_sided)} shapes, as requested."
        return ReadSides(_renamed(named, all_sided), moved, frame.upright, _new_names(all_sided), (note, *inwards))
    if not exchanged:
        return ReadSides(named, named, frame.upright, notes=(*_strays(other), *inwards))
    example = next(name for name in named if name in exchanged and name not in _SIDEWAYS)
    side = "right" if example.endswith("Left") else "left"
    if sides == "as-named":
        note = f"{len(exchanged)} shapes move the other side of the face than their names say, such as {example}."
        return ReadSides(named, moved, frame.upright, notes=(note, *inwards))
    note = (
        f"{len(exchanged)} shapes are named from the viewer's side (in the file, {example} moves the {side} side of "
        "the face): left and right were exchanged in their names. The option Sides, as named, keeps them."
    )
    return ReadSides(moved, moved, frame.upright, _new_names(exchanged), (note, *inwards))


def _moves_other_side(name: str, offsets: NDArray[np.float32], placed: Array, upright: Similarity) -> bool:
    """Return True if a shape moves the other side of the face than its name says."""
    sign = 1.0 if name.endswith("Left") else -1.0 if name.endswith("Right") else 0.0
    if not sign or not np.any(offsets):
        return False
    if name in _SIDEWAYS:
        return sign * float((upright.rotation @ mean_direction(offsets))[0]) < -_SIDEWARD
    squares = np.einsum("nd,nd->n", offsets, offsets, dtype=np.float64)
    return sign * float(squares @ placed[:, 0]) / float(squares.sum()) < -_ASIDE


def _with_opposites(names: set[str], named: Shapes) -> set[str]:
    """Return ``names`` with their counterparts of the other side, where the shapes ``named`` have them."""
    return names | {opposite_name(name) for name in names if opposite_name(name) in named}


def _renamed(named: Shapes, exchanged: set[str]) -> Shapes:
    return {opposite_name(name) if name in exchanged else name: offsets for name, offsets in named.items()}


def _new_names(exchanged: set[str]) -> dict[str, str]:
    """Return the new name by the old one, of shapes and of their missing counterparts."""
    pairs = exchanged | {opposite_name(name) for name in exchanged}
    return {name: opposite_name(name) for name in pairs}


def _strays(names: set[str]) -> tuple[str, ...]:
    """Return a sentence about single shapes that move the other side."""
    if not names:
        return ()
    listed = ", ".join(sorted(names)[:_SHOWN])
    if len(names) == 1:
        return (f"The shape {listed} moves the other side of the face than its name says; check it.",)
    rest = len(names) - _SHOWN
    more = f" and {rest} more" if rest > 0 else ""
    return (f"{len(names)} shapes move the other side of the face than their names say: {listed}{more}; check them.",)
