"""Adaptation of sessions to a changed version of their character (docs/session-format.md#another-version)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.model.shape_names import weight_map
from faceposer.photo.photo import Photo, Pin
from faceposer.session.character_version import CharacterVersion
from faceposer.session.document import Document, MadeOn
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint

Array = NDArray[np.float64]

# Tolerance on the weights of a pose against those in the file, which are rounded.
_SAME_WEIGHT = 1e-4
# A weight up to this is ignored if the character has lost the shape.
_NO_WEIGHT = 0.01
# A point farther from its part of the surface than this share of the character's size is reported.
_FAR = 0.02
# Maximum number of names listed in a sentence.
_NAMED = 8
_IDENTITY = Similarity(np.eye(3), np.zeros(3), np.asarray(1.0))


@dataclass(frozen=True)
class Rebinding:
    """A document adapted to the current version of its character.

    Attributes:
        document: Document to edit.
        remark: Sentence for the user about the changes; empty if there were none.
    """

    document: Document
    remark: str = ""


def rebind(document: Document, model: FaceModel) -> Rebinding:
    """Return ``document``, as read from a file, adapted to the current version ``model`` of its character.

    If the mesh has changed since the file was written, each place moves to the nearest point of the neutral surface of
    the same part, and cameras move with the character; poses of another subspace are converted through their shape
    weights. A file without the version of its character remains unchanged, except for a pose that can be solved again.

    Raises:
        FacePoserError: If the weights of a pose do not match the names of the shapes.
    """
    made_on, name = document.made_on, Path(document.character).stem
    zeros = _zeros_note(document, model)
    document = _with_neutral(replace(document, made_on=None), model)
    if made_on is None:
        rebinding = _without_version(document, model, name)
        return replace(rebinding, remark=" ".join(filter(None, (rebinding.remark, zeros))))
    remarks: list[str] = []
    poses = _PoseConverter(model, made_on.version)
    document = _without_unusable_pose(poses.convert(document, made_on), model)
    if made_on.version.same_topology(CharacterVersion.of(model.character)):
        document, remarks = _with_shifted_neutral(document, model)
    else:
        document, remarks = _reattached(document, model, made_on.version)
    if poses.converted:
        remarks.append("its poses were converted from shape weights")
    if poses.lost:
        remarks.append(f"this version lacks {_listed(sorted(poses.lost))}")
    intro = f'This session was made with another version of "{name}"'
    return Rebinding(document, f"{intro}; {'; '.join(remarks)}." if remarks else "")


def _without_version(document: Document, model: FaceModel, name: str) -> Rebinding:
    """Return a document adapted to its character if the file does not state the version it was made with."""
    places = [
        _title(i, constraint) for i, constraint in enumerate(document.constraints) if constraint.places is not None
    ]
    places += [f"photos[{i}]" for i, photo in enumerate(document.photos) if any(map(_is_anchored, photo.pins))]
    doubt = f"the places of {_listed(places)} may be wrong" if places else ""
    bare = replace(document, constraints=tuple(constraint.without_rest() for constraint in document.constraints))
    solvable = _without_unusable_pose(bare, model)
    if solvable is not bare:
        remark = f'This session was made with another version of "{name}"; its pose was solved again'
        return Rebinding(solvable, f"{remark}; {doubt}." if doubt else f"{remark}.")
    if doubt:
        intro = f'This session does not state with which version of "{name}" it was made'
        return Rebinding(bare, f"{intro}; if it was another one, {doubt}.")
    return Rebinding(bare)


def _with_neutral(document: Document, model: FaceModel) -> Document:
    """Return the document with neutral poses of another subspace, which are zeros, replaced by those of ``model``."""

    def fitting(pose: Array | None) -> Array | None:
        neutral = pose is not None and len(pose) != model.n_coefficients and not pose.any()
        return model.neutral() if neutral else pose

    start = fitting(document.start)
    # Without constraints, the pose is the start.
    pose = start if document.coefficients is document.start else fitting(document.coefficients)
    return replace(document, start=start, coefficients=pose)


def _zeros_note(document: Document, model: FaceModel) -> str:
    """Return the sentence about a neutral pose with another number of coefficients; "" if there is none."""
    for pose in (document.coefficients, document.start):
        if pose is not None and len(pose) != model.n_coefficients and not pose.any():
            found = counted(len(pose), "number")
            return (
                f"Its pose has {found} instead of {model.n_coefficients}; since all are 0, it was read as the neutral "
                "face."
            )
    return ""


def _without_unusable_pose(document: Document, model: FaceModel) -> Document:
    """Return the document without a pose of another subspace that its constraints determine."""
    pose = document.coefficients
    fits = pose is None or len(pose) == model.n_coefficients
    if fits or document.start is not None or not document.constraints or document.keyframes is not None:
        return document
    return replace(document, coefficients=None)


class _PoseConverter:
    """Conversion of poses from another version of a character.

    Attributes:
        converted: True if a pose was converted from its weights.
        lost: Names of shapes that a pose uses and the character no longer has.
    """

    def __init__(self, model: FaceModel, version: CharacterVersion) -> None:
        self._model = model
        self._names = version.shapes
        self._map = weight_map(model.character.shape_names, version.shapes)
        self.converted = False
        self.lost: set[str] = set()

    def convert(self, document: Document, made_on: MadeOn) -> Document:
        """Return ``document`` with all poses of known weights in the subspace of the model."""
        keyframes = document.keyframes
        if keyframes is not None:
            keys = tuple(
                replace(key, pose=self._pose(key.pose, key.weights, f"animation.keys[{i}].weights"), weights=None)
                for i, key in enumerate(keyframes.keys)
            )
            document = replace(document, keyframes=replace(keyframes, keys=keys))
        if document.coefficients is not None:
            pose = self._pose(document.coefficients, made_on.weights, "weights")
            # Without constraints, the pose is the start.
            same = document.start is document.coefficients
            document = replace(document, coefficients=pose, start=pose if same else document.start)
            if same:
                return document
        if document.start is not None:
            start = self._pose(document.start, made_on.start_weights, "start_weights")
            document = replace(document, start=start)
        return document

    def _pose(self, pose: Array, weights: Array | None, where: str) -> Array:
        model = self._model
        if weights is None:
            return pose
        if len(weights) != len(self._names):
            raise FacePoserError(
                f"{where} has {counted(len(weights), 'number')}, but character.shapes has "
                f"{counted(len(self._names), 'name')}."
            )
        same_rig = self._names == tuple(model.character.shape_names) and len(pose) == model.n_coefficients
        if same_rig and np.abs(model.weights_of(pose) - weights).max(initial=0.0) <= _SAME_WEIGHT:
            return pose
        self.converted = True
        unknown = ~self._map.any(axis=0)
        self.lost.update(self._names[i] for i in np.flatnonzero(unknown & (np.abs(weights) > _NO_WEIGHT)))
        converted = model.coefficients_of(self._map @ weights)
        converted.setflags(write=False)
        return converted


def _with_shifted_neutral(document: Document, model: FaceModel) -> tuple[Document, list[str]]:
    """Return a document for a mesh of the same topology, with fixed positions moved with the neutral face, and remarks.

    Sketches of features that the character no longer has are removed.
    """
    constraints: list[Constraint] = []
    removed: list[str] = []
    for i, constraint in enumerate(document.constraints):
        if _lacks_feature(constraint, model):
            removed.append(_title(i, constraint))
        elif isinstance(constraint, FixedConstraint) and constraint.rest is not None:
            constraint.points.check(model.triangles)
            shift = constraint.points.positions(model.character.vertices, model.triangles) - constraint.rest
            constraints.append(
                constraint.rebound(constraint.points, _IDENTITY, np.where(np.abs(shift) > 1e-3, shift, 0.0))
            )
        else:
            constraints.append(constraint.without_rest())
    return replace(document, constraints=tuple(constraints)), [_removal(removed)] if removed else []


def _lacks_feature(constraint: Constraint, model: FaceModel) -> bool:
    if not isinstance(constraint, SketchConstraint):
        return False
    return any(name not in model.character.feature_points for name in FEATURES[constraint.feature].points)


def _removal(titles: Sequence[str]) -> str:
    return f"removed, because their places no longer exist: {_listed(titles)}"


def _reattached(document: Document, model: FaceModel, version: CharacterVersion) -> tuple[Document, list[str]]:
    """Return the document with all places attached to the current mesh, and remarks for the user."""
    surface = _Surface(model, version)
    constraints = [surface.constraint(i, constraint) for i, constraint in enumerate(document.constraints)]
    kept = tuple(constraint for constraint in constraints if constraint is not None)
    photos = tuple(surface.photo(i, photo) for i, photo in enumerate(document.photos))
    camera = None if document.camera is None else document.camera.following(surface.frame)
    remarks = []
    if surface.attached:
        noun = "point was" if surface.attached == 1 else "points were"
        remarks.append(f"{surface.attached} {noun} reattached by position")
    if surface.doubtful:
        remarks.append(f"the places of {_listed(surface.doubtful)} may be wrong")
    if surface.removed:
        remarks.append(_removal(surface.removed))
    return replace(document, constraints=kept, photos=photos, camera=camera), remarks


class _Surface:
    """The neutral surface of a character that has changed.

    Attributes:
        frame: Transform from the version of the session to the current one.
        attached: Number of places attached to the surface.
        doubtful: Titles of constraints and photos with possibly wrong places.
        removed: Titles of constraints with places that the character does not have.
    """

    def __init__(self, model: FaceModel, version: CharacterVersion) -> None:
        current = CharacterVersion.of(model.character)
        self._model = model
        self._version = version
        self._far = _FAR * float(np.linalg.norm(np.subtract(*current.box)))
        self._by_part: dict[str | None, NearestSurface] = {}
        self.frame = version.alignment_to(current)
        self.attached = 0
        self.doubtful: list[str] = []
        self.removed: list[str] = []

    def constraint(self, index: int, constraint: Constraint) -> Constraint | None:
        """Return constraint ``index`` on the surface, or None if its places do not exist."""
        places, title = constraint.places, _title(index, constraint)
        if _lacks_feature(constraint, self._model):
            self.removed.append(title)
            return None
        if places is None:
            return constraint.rebound(None, self.frame, np.zeros((0, 3)))
        if constraint.rest is None:
            try:
                places.check(self._model.triangles)
            except ValueError:
                self.removed.append(title)
                return None
            self.doubtful.append(title)
            return constraint.rebound(places, self.frame, np.zeros((len(places), 3)))
        # Fixed vertices stay vertices: they are released by index.
        found, far = self._nearest(places, constraint.rest, isinstance(constraint, FixedConstraint))
        if far:
            self.doubtful.append(title)
        character = self._model.character
        shift = found.positions(character.vertices, character.triangles) - self.frame.apply(constraint.rest)
        return constraint.rebound(found, self.frame, shift)

    def photo(self, index: int, photo: Photo) -> Photo:
        """Return photo ``index`` with its pins on the surface, and its camera moved with the character."""
        pins: list[Pin] = []
        doubtful = False
        for pin in photo.pins:
            if isinstance(pin.place, str):
                pins.append(pin)
                continue
            place = SurfacePoints.of([pin.place])
            if pin.rest is not None:
                place, far = self._nearest(place, np.array([pin.rest]), False)
                doubtful |= far
            else:
                doubtful = True
                try:
                    place.check(self._model.triangles)
                except ValueError:
                    continue
            pins.append(Pin(place[0], pin.pixel))
        if doubtful:
            self.doubtful.append(f"photos[{index}]")
        unique = tuple({pin.place: pin for pin in pins}.values())
        camera = None if photo.camera is None else photo.camera.following(self.frame)
        return replace(photo, pins=unique, camera=camera)

    def _nearest(self, places: SurfacePoints, rest: Array, vertices: bool) -> tuple[SurfacePoints, bool]:
        """Return the points nearest to ``places``, at ``rest``, (n, 3), in their version, and True if one is far."""
        targets = self.frame.apply(rest)
        faces, weights = np.zeros(len(places), dtype=np.int64), np.zeros((len(places), 3))
        names = self._version.parts_of(places)
        far = False
        for name in dict.fromkeys(names):
            on_part = np.array([one == name for one in names])
            surface = self._part(name)
            found, distances = surface.at_vertices(targets[on_part]) if vertices else surface.points(targets[on_part])
            faces[on_part], weights[on_part] = found.faces, found.barycentric
            far |= bool((distances > self._far).any())
        self.attached += len(places)
        return SurfacePoints(faces, weights), far

    def _part(self, name: str | None) -> NearestSurface:
        """Return the surface of the part ``name``, or the whole pickable surface if there is none."""
        if name not in self._by_part:
            character = self._model.character
            runs = [character.part_triangles(part) for part in character.parts if part.name == name]
            chosen = np.arange(*runs[0]) if runs and runs[0][1] > runs[0][0] else character.solid_triangles
            if not len(chosen):
                chosen = np.arange(len(character.triangles))
            self._by_part[name] = NearestSurface(character.vertices, character.triangles, chosen)
        return self._by_part[name]


def _is_anchored(pin: Pin) -> bool:
    return not isinstance(pin.place, str)


def _title(index: int, constraint: Constraint) -> str:
    return f"constraints[{index}] ({constraint.kind})"


def _listed(names: Sequence[str]) -> str:
    shown = list(names[:_NAMED])
    if len(names) > _NAMED:
        shown.append(f"{len(names) - _NAMED} more")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
