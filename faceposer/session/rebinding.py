"""Sessions that were made on another version of their character (docs/session-format.md#another-version)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.shape_names import weight_map
from faceposer.photo.photo import Photo, Pin
from faceposer.session.character_version import CharacterVersion
from faceposer.session.document import Document, MadeOn
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.registry import Constraint

Array = NDArray[np.float64]

# By how much the weights of a pose may differ from the stored ones in the same subspace: the file rounds them.
_SAME_WEIGHT = 1e-4
# A weight up to this is not missed where a character has lost a shape.
_NO_WEIGHT = 0.01
# Share of the character's size from which on a place is taken to lie off its part of the surface.
_FAR = 0.02
# So many names are listed in a sentence.
_NAMED = 8
_STILL = Similarity(np.eye(3), np.zeros(3), np.asarray(1.0))


@dataclass(frozen=True)
class Rebinding:
    """A document that fits the character as it is now, and what was done to make it fit.

    Attributes:
        document: What to edit.
        remark: A sentence for the user; empty if nothing was done.
    """

    document: Document
    remark: str = ""


def rebound(document: Document, model: FaceModel) -> Rebinding:
    """Return ``document``, as its file has it, on the character ``model`` as it is now.

    Where the mesh has changed since the file was written, each place is put at the nearest point of the neutral surface
    of the same part, and cameras are moved with the character; poses of another subspace are taken from the weights of
    their shapes. A file that does not say on which version it was made is left as it is, but for a pose that can be
    solved anew.

    Raises:
        FacePoserError: If the weights of a pose do not go with the names of the shapes.
    """
    made_on, name = document.made_on, Path(document.character).stem
    document = _with_neutral(replace(document, made_on=None), model)
    if made_on is None:
        return _undated(document, model, name)
    remarks: list[str] = []
    poses = _Poses(model, made_on.version)
    document = _solvable(poses.taken_over(document, made_on), model)
    if made_on.version.same_topology(CharacterVersion.of(model.character)):
        document = _with_shifted_neutral(document, model)
    else:
        document, remarks = _placed_again(document, model, made_on.version)
    if poses.converted:
        remarks.append("its poses were taken from the weights of the shapes")
    if poses.lost:
        remarks.append(f"this version lacks {_listed(sorted(poses.lost))}")
    intro = f'This session was made with another version of "{name}"'
    return Rebinding(document, f"{intro}; {'; '.join(remarks)}." if remarks else "")


def _undated(document: Document, model: FaceModel, name: str) -> Rebinding:
    """Return a document whose file does not say on which version of the character it was made."""
    places = [_title(i, one) for i, one in enumerate(document.constraints) if one.places is not None]
    places += [f"photos[{i}]" for i, photo in enumerate(document.photos) if any(map(_is_anchored, photo.pins))]
    off = f"the places of {_listed(places)} may be off" if places else ""
    bare = replace(document, constraints=tuple(one.without_rest() for one in document.constraints))
    solvable = _solvable(bare, model)
    if solvable is not bare:
        remark = f'This session was made with another version of "{name}"; its pose was solved anew'
        return Rebinding(solvable, f"{remark}; {off}." if off else f"{remark}.")
    if off:
        off = f'This session does not say with which version of "{name}" it was made; if with another one, {off}.'
    return Rebinding(bare, off)


def _with_neutral(document: Document, model: FaceModel) -> Document:
    """Return the document with poses that are zeros, the neutral face of every version, in the subspace of the face."""

    def fitting(pose: Array | None) -> Array | None:
        neutral = pose is not None and len(pose) != model.n_coefficients and not pose.any()
        return model.neutral() if neutral else pose

    start = fitting(document.start)
    # Without constraints, the pose is the one to start from.
    pose = start if document.coefficients is document.start else fitting(document.coefficients)
    return replace(document, start=start, coefficients=pose)


def _solvable(document: Document, model: FaceModel) -> Document:
    """Return the document without a pose that does not fit the face and that its constraints bring back."""
    pose = document.coefficients
    fits = pose is None or len(pose) == model.n_coefficients
    if fits or document.start is not None or not document.constraints or document.keyframes is not None:
        return document
    return replace(document, coefficients=None)


class _Poses:
    """Takes over poses of another version of a character.

    Attributes:
        converted: Whether a pose had to be taken from its weights.
        lost: Names of shapes that a pose needs and the character has no more.
    """

    def __init__(self, model: FaceModel, version: CharacterVersion) -> None:
        self._model = model
        self._names = version.shapes
        self._map = weight_map(model.character.shape_names, version.shapes)
        self.converted = False
        self.lost: set[str] = set()

    def taken_over(self, document: Document, made_on: MadeOn) -> Document:
        """Return ``document`` with all poses in the subspace of the face, as far as their weights are known."""
        keyframes = document.keyframes
        if keyframes is not None:
            keys = tuple(
                replace(key, pose=self._pose(key.pose, key.weights, f"animation.keys[{i}].weights"), weights=None)
                for i, key in enumerate(keyframes.keys)
            )
            document = replace(document, keyframes=replace(keyframes, keys=keys))
        if document.coefficients is not None:
            pose = self._pose(document.coefficients, made_on.weights, "weights")
            # Without constraints, the pose is the one to start from.
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
                f"{where} has {len(weights)} numbers where character.shapes has {len(self._names)} names."
            )
        alike = self._names == tuple(model.character.shape_names) and len(pose) == model.n_coefficients
        if alike and np.abs(model.weights_of(pose) - weights).max(initial=0.0) <= _SAME_WEIGHT:
            return pose
        self.converted = True
        unknown = ~self._map.any(axis=0)
        self.lost.update(self._names[i] for i in np.flatnonzero(unknown & (np.abs(weights) > _NO_WEIGHT)))
        taken = model.coefficients_of(self._map @ weights)
        taken.setflags(write=False)
        return taken


def _with_shifted_neutral(document: Document, model: FaceModel) -> Document:
    """Return the document, whose mesh is numbered alike, with what is held in space moved with the neutral face."""
    constraints: list[Constraint] = []
    for one in document.constraints:
        if isinstance(one, FixedConstraint) and one.rest is not None:
            one.points.check(model.triangles)
            shift = one.points.positions(model.character.vertices, model.triangles) - one.rest
            constraints.append(one.rebound(one.points, _STILL, np.where(np.abs(shift) > 1e-3, shift, 0.0)))
        else:
            constraints.append(one.without_rest())
    return replace(document, constraints=tuple(constraints))


def _placed_again(document: Document, model: FaceModel, version: CharacterVersion) -> tuple[Document, list[str]]:
    """Return the document with all places on the face as it is now, and what there is to say about it."""
    surface = _Surface(model, version)
    constraints = [surface.constraint(i, one) for i, one in enumerate(document.constraints)]
    kept = tuple(one for one in constraints if one is not None)
    photos = tuple(surface.photo(i, photo) for i, photo in enumerate(document.photos))
    camera = None if document.camera is None else document.camera.following(surface.frame)
    remarks = []
    if surface.placed:
        one = surface.placed == 1
        remarks.append(
            f"{surface.placed} point{' was' if one else 's were'} placed again by {'its' if one else 'their'} position"
        )
    if surface.off:
        remarks.append(f"the places of {_listed(surface.off)} may be off")
    if surface.left_out:
        remarks.append(f"left out, for lack of their places on it: {_listed(surface.left_out)}")
    return replace(document, constraints=kept, photos=photos, camera=camera), remarks


class _Surface:
    """The neutral surface of a character that has changed.

    Attributes:
        frame: Lays the version of a session on it.
        placed: How many places were put on it.
        off: What has places of which it is not known that they are right.
        left_out: What has places that the character does not have.
    """

    def __init__(self, model: FaceModel, version: CharacterVersion) -> None:
        here = CharacterVersion.of(model.character)
        self._model = model
        self._version = version
        self._far = _FAR * float(np.linalg.norm(np.subtract(*here.box)))
        self._by_part: dict[str | None, NearestSurface] = {}
        self.frame = version.alignment_to(here)
        self.placed = 0
        self.off: list[str] = []
        self.left_out: list[str] = []

    def constraint(self, index: int, one: Constraint) -> Constraint | None:
        """Return constraint ``index`` on the surface, or None if it cannot be there."""
        places, title = one.places, _title(index, one)
        if places is None:
            return one.rebound(None, self.frame, np.zeros((0, 3)))
        if one.rest is None:
            try:
                places.check(self._model.triangles)
            except ValueError:
                self.left_out.append(title)
                return None
            self.off.append(title)
            return one.rebound(places, self.frame, np.zeros((len(places), 3)))
        # Vertices that are held are let go by their number.
        found, far = self._nearest(places, one.rest, isinstance(one, FixedConstraint))
        if far:
            self.off.append(title)
        character = self._model.character
        shift = found.positions(character.vertices, character.triangles) - self.frame.apply(one.rest)
        return one.rebound(found, self.frame, shift)

    def photo(self, index: int, photo: Photo) -> Photo:
        """Return photo ``index`` with its pins on the surface, and its camera before it."""
        pins: list[Pin] = []
        off = False
        for pin in photo.pins:
            if isinstance(pin.place, str):
                pins.append(pin)
                continue
            place = SurfacePoints.of([pin.place])
            if pin.rest is not None:
                place, far = self._nearest(place, np.array([pin.rest]), False)
                off |= far
            else:
                off = True
                try:
                    place.check(self._model.triangles)
                except ValueError:
                    continue
            pins.append(Pin(place[0], pin.pixel))
        if off:
            self.off.append(f"photos[{index}]")
        unique = tuple({pin.place: pin for pin in pins}.values())
        camera = None if photo.camera is None else photo.camera.following(self.frame)
        return replace(photo, pins=unique, camera=camera)

    def _nearest(self, places: SurfacePoints, rest: Array, vertices: bool) -> tuple[SurfacePoints, bool]:
        """Return the points nearest to where ``places`` were at ``rest``, (n, 3), and whether one of them is far."""
        targets = self.frame.apply(rest)
        faces, weights = np.zeros(len(places), dtype=np.int64), np.zeros((len(places), 3))
        names = self._version.parts_of(places)
        far = False
        for name in dict.fromkeys(names):
            on_part = np.array([one == name for one in names])
            surface = self._part(name)
            found, off = surface.at_vertices(targets[on_part]) if vertices else surface.points(targets[on_part])
            faces[on_part], weights[on_part] = found.faces, found.barycentric
            far |= bool((off > self._far).any())
        self.placed += len(places)
        return SurfacePoints(faces, weights), far

    def _part(self, name: str | None) -> NearestSurface:
        """Return the part called ``name``, or all that can be pointed at where there is none."""
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
