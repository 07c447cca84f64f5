"""The document: character, constraints, pose and animation, and its JSON file (docs/session-format.md)."""

import json
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import ArrayLike, NDArray

from faceposer.animation.keyframes import Keyframes
from faceposer.errors import FacePoserError, counted
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import check_header, convert, read_json
from faceposer.files.key_places import check_not_key
from faceposer.files.paths import expand_user
from faceposer.files.writing import json_text
from faceposer.geometry.camera import Camera
from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import DegeneratePinsError, aligned, unaligned
from faceposer.photo.photo import Photo
from faceposer.session.character_version import CharacterVersion
from faceposer.session.document_json import SessionFile
from faceposer.session.effort import check_effort
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.registry import Constraint, constraint_from_json
from faceposer.solve.constraints.sketch import SketchMethod
from faceposer.solve.constraints.stroke import MOST_PICKED, StrokeConstraint
from faceposer.solve.priors import Prior
from faceposer.solve.problem import SPREAD

FORMAT = "faceposer.session"
VERSION = 1
_MAX_BYTES = 64 * 2**20
# Maximum number of pixels at which the sources of all strokes are picked.
_MOST_PICKED_TOGETHER = 400_000
# A list of numbers over several lines, as the indented output has it.
_NUMBERS = re.compile(r"\[\s+([-+.eE\d]+(?:,\s+[-+.eE\d]+)*)\s+\]")


@dataclass(frozen=True, eq=False)
class MadeOn:
    """The version of the character that a session file refers to, and its poses as shape weights.

    Attributes:
        version: Version of the character.
        weights: Shape weights of the pose, shape (S,), or None.
        start_weights: Shape weights of the start pose, shape (S,), or None.
    """

    version: CharacterVersion
    weights: NDArray[np.float64] | None = None
    start_weights: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Document:
    """An immutable state of the user's work; every edit creates a new one.

    Attributes:
        character: Name of an installed character, or path of a character file: absolute in memory, relative to the
            folder of the session file in that file.
        constraints: In order of creation.
        prior_weight: Weight of the prior, at least 0.
        coefficients: The pose, shape (r,), read-only; None for the neutral face.
        start: The pose without constraints, shape (r,), read-only; None for the neutral face. A file without
            constraints may omit it: its pose is then the start.
        prior: "regions" for a prior per region of the face, "whole" for one of the whole face, "plain" for the learned
            mixture, independent of the start.
        sketch_method: "map" if sketches are constraints like the others; "paper" if the statistical mapping of the
            paper replaces the start for the other constraints.
        spread: Share of the face that follows a constraint, from 0, as little as possible, to 1, the whole face.
        solved: True if the pose is the solution for the constraints, False if they have changed since.
        camera: Last view of the document, or None.
        photos: Reference photos; their paths are relative or absolute like that of the character.
        keyframes: The animation, or None.
        frame: Current frame of the animation, counted from 0.
        animated: True if pose and start are those of the animation at that frame, so that a frame change loses nothing.
        contact: True if the face is displayed and exported after the contact step (docs/contact.md).
        identity: Coefficients of an edited head of the character; None for the character as it is (docs/identity.md).
        made_on: In a file, the version of the character and its poses as shape weights; None in memory, and in files
            without them.
    """

    character: str
    constraints: tuple[Constraint, ...] = ()
    prior_weight: float = 1.0
    coefficients: NDArray[np.float64] | None = None
    start: NDArray[np.float64] | None = None
    camera: Camera | None = None
    solved: bool = True
    prior: Prior = "regions"
    spread: float = SPREAD
    photos: tuple[Photo, ...] = ()
    keyframes: Keyframes | None = None
    frame: int = 0
    animated: bool = False
    contact: bool = True
    sketch_method: SketchMethod = "map"
    identity: Identity | None = None
    made_on: MadeOn | None = None

    def posed(self, coefficients: ArrayLike) -> "Document":
        """Return the document with the solved pose ``coefficients``, shape (r,)."""
        pose = np.array(coefficients, dtype=np.float64)
        pose.setflags(write=False)
        return replace(self, coefficients=pose, solved=True, animated=False)

    def with_animation_frame(self, frame: int, coefficients: ArrayLike) -> "Document":
        """Return the document at ``frame`` with the pose of its animation there, shape (r,), without constraints."""
        document = replace(self, constraints=(), frame=frame).with_start(coefficients).posed(coefficients)
        return replace(document, animated=True)

    def with_start(self, start: ArrayLike | None) -> "Document":
        """Return the document with the start pose ``start``, shape (r,); None for the neutral face."""
        pose = None if start is None else np.array(start, dtype=np.float64)
        if pose is not None:
            pose.setflags(write=False)
        return replace(self, start=pose, animated=False)

    def with_constraint(self, index: int, constraint: Constraint) -> "Document":
        """Return the document with constraint ``index`` replaced."""
        return replace(self, constraints=(*self.constraints[:index], constraint, *self.constraints[index + 1 :]))

    def without_constraints(self, indices: set[int]) -> "Document":
        """Return the document without the constraints ``indices``."""
        return replace(self, constraints=tuple(c for i, c in enumerate(self.constraints) if i not in indices))

    def same_input(self, other: "Document") -> bool:
        """Return True if both hold the same work: the same face, photos, contact and animation, at any frame."""
        same_keys = self.keyframes is other.keyframes or (
            self.keyframes is not None and self.keyframes.same(other.keyframes)
        )
        # Poses taken from the animation at two frames differ, but are no edits.
        aligned = replace(self, start=other.start) if self.animated and other.animated else self
        same_view = self.photos == other.photos and self.contact == other.contact
        return same_keys and same_view and aligned.same_face(other)

    def same_face(self, other: "Document") -> bool:
        """Return True if both define the same face: character, constraints, start and prior are equal."""
        mine, theirs = (
            (one.character, one.constraints, one.prior_weight, one.prior, one.spread, one.sketch_method)
            for one in (self, other)
        )
        return mine == theirs and self.same_head(other) and _same_pose(self.start, other.start)

    def same_head(self, other: "Document") -> bool:
        """Return True if both show the same character with the same head."""
        if self.identity is None or other.identity is None:
            return self.character == other.character and self.identity is other.identity
        return self.character == other.character and self.identity.same(other.identity)

    def same_unconstrained_pose(self, other: "Document") -> bool:
        """Return True if both have no constraints, but the same start pose and prior, and therefore the same pose."""
        unconstrained = not (self.constraints or other.constraints)
        return unconstrained and self.prior == other.prior and _same_pose(self.start, other.start)

    def to_json(self) -> dict[str, Any]:
        """Return the document as written in a file."""
        data: dict[str, Any] = {
            "format": FORMAT,
            "version": VERSION,
            "subject": self.character,
            "prior_weight": self.prior_weight,
            "constraints": [constraint.to_json() for constraint in self.constraints],
        }
        made_on = self.made_on
        if self.prior != "regions":
            data["prior"] = self.prior
        if self.spread != SPREAD:
            data["spread"] = self.spread
        if self.sketch_method != "map":
            data["sketch_method"] = self.sketch_method
        data |= self._poses_to_json()
        if not self.contact:
            data["contact"] = False
        if self.camera is not None:
            data["camera"] = codec.camera_to_json(self.camera)
        if self.photos:
            data["photos"] = [photo.to_json() for photo in self.photos]
        if self.keyframes is not None:
            data["animation"] = {"frame": self.frame, **self.keyframes.to_json()}
        if self.identity is not None:
            data["identity"] = self.identity.to_json()
        if made_on is not None:
            data["character"] = made_on.version.to_json()
        return data

    def _poses_to_json(self) -> dict[str, Any]:
        data: dict[str, Any] = {}
        made_on, start = self.made_on, self.start
        if self.coefficients is not None:
            data["coefficients"] = self.coefficients.tolist()
            if made_on is not None and made_on.weights is not None:
                data["weights"] = codec.weights_to_json(made_on.weights)
            if start is None and not self.constraints and self.prior != "regions":
                # The prior alone moves the face away from its start.
                start = np.zeros_like(self.coefficients)
        if start is not None and (self.constraints or not _same_pose(start, self.coefficients)):
            data["start"] = start.tolist()
            if made_on is not None and made_on.start_weights is not None:
                data["start_weights"] = codec.weights_to_json(made_on.start_weights)
        return data

    def with_version_data(self, model: FaceModel) -> "Document":
        """Return the document with the data that makes its file usable with other versions of its character ``model``.

        These are the version of the mesh, the rest positions of all surface points, and the shape weights of all poses.
        """

        def weights(pose: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
            return None if pose is None else model.weights_of(pose)

        keyframes = self.keyframes
        if keyframes is not None:
            keys = tuple(replace(key, weights=weights(key.pose)) for key in keyframes.keys)
            keyframes = replace(keyframes, keys=keys)
        return replace(
            self,
            constraints=tuple(constraint.with_rest(model) for constraint in self.constraints),
            photos=tuple(photo.with_rest(model) for photo in self.photos),
            keyframes=keyframes,
            made_on=MadeOn(CharacterVersion.of(model.character), weights(self.coefficients), weights(self.start)),
        )

    @classmethod
    def from_json(cls, data: Any) -> "Document":
        """Return the document that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; the message names it.
        """
        check_header(data, FORMAT, VERSION)
        form = convert(data, SessionFile)
        document = cls(
            form.subject,
            tuple(constraint_from_json(entry, f"constraints[{i}]") for i, entry in enumerate(form.constraints)),
            form.prior_weight,
            camera=None if form.camera is UNSET else form.camera.camera(),
            prior=form.prior,
            spread=form.spread,
            photos=tuple(photo.photo() for photo in form.photos),
            contact=form.contact,
            sketch_method=form.sketch_method,
            identity=None if form.identity is UNSET else form.identity.identity(),
        )
        check_effort(document.constraints)
        if form.start is not UNSET:
            document = document.with_start(form.start)
        if form.coefficients is not UNSET:
            document = document.posed(form.coefficients)
            if not form.constraints and form.start is UNSET:
                document = replace(document, start=document.coefficients)
        if form.animation is not UNSET:
            document = replace(document, keyframes=form.animation.keyframes(), frame=form.animation.frame)
        if form.character is UNSET:
            return document
        weights, start_weights = (
            None if values is UNSET else np.array(values) for values in (form.weights, form.start_weights)
        )
        return replace(document, made_on=MadeOn(form.character.version(), weights, start_weights))

    def resolved(self, model: FaceModel) -> "Document":
        """Return the document with the data that its file omits, computed from the start pose.

        Raises:
            FacePoserError: If the constraints or the pose do not fit the character.
        """
        keys = () if self.keyframes is None else self.keyframes.keys
        poses = [("coefficients", self.coefficients), ("start", self.start)]
        poses += [(f"animation.keys[{i}].coefficients", key.pose) for i, key in enumerate(keys)]
        for name, pose in poses:
            if pose is not None and len(pose) != model.n_coefficients:
                raise FacePoserError(
                    f"{name} has {counted(len(pose), 'number')}, but the character '{self.character}' has "
                    f"{model.n_coefficients} "
                    "coefficients; remove the key to start from the neutral face."
                )
        start = model.neutral() if self.start is None else self.start
        strokes = sum(isinstance(constraint, StrokeConstraint) for constraint in self.constraints)
        most = min(MOST_PICKED, _MOST_PICKED_TOGETHER // max(strokes, 1))
        constraints: list[Constraint] = []
        for i, constraint in enumerate(self.constraints):
            try:
                if isinstance(constraint, StrokeConstraint):
                    constraints.append(constraint.resolved(model, start, most))
                else:
                    constraints.append(constraint.resolved(model, start))
                _check_in_front(constraints[-1], model, start)
            except ValueError as error:
                raise FacePoserError(f"constraints[{i}]: {error}.") from error
        photos = tuple(photo if photo.camera is not None else _aligned(photo, model, start) for photo in self.photos)
        return replace(self, constraints=tuple(constraints), photos=photos)


def _check_in_front(constraint: Constraint, model: FaceModel, start: NDArray[np.float64]) -> None:
    """Raise a ValueError if a point of ``constraint`` on the face ``start`` lies behind its camera."""
    camera = constraint.camera
    if camera is None or not len(constraint.points):
        return
    depths = camera.to_camera(model.positions_at(constraint.points, start))[:, 2]
    if depths.min() <= 0.0:
        what = "its point lies" if len(depths) == 1 else "points of it lie"
        raise ValueError(f"{what} behind its camera; correct the camera's rotation and translation")


def _aligned(photo: Photo, model: FaceModel, pose: NDArray[np.float64]) -> Photo:
    try:
        return aligned(photo, model, pose)
    except DegeneratePinsError:
        # The session opens, so that the pins can be moved.
        return unaligned(photo, model)


def absolute_character(character: str, folder: Path) -> str:
    """Return ``character`` with the path of a character file, relative to ``folder``, made absolute."""
    if not _is_file(character):
        return character
    return os.path.normpath((folder / expand_user(character)).absolute())


def portable_character(character: str, folder: Path) -> str:
    """Return the reference to ``character`` in a session file in ``folder``.

    A character file in the folder, below it or in a sibling folder gets a relative path with slashes, so that both can
    be moved together; any other gets an absolute path. ``character`` is a name, or a path, absolute or relative to the
    current folder.
    """
    return path_from(character, folder) if _is_file(character) else character


def path_from(path: str, folder: Path) -> str:
    """Return the reference to the file ``path`` in a session file in ``folder``; see ``portable_character``."""
    whole = os.path.normpath(expand_user(path).absolute())
    try:
        relative = Path(os.path.relpath(whole, folder.absolute()))
    except ValueError:  # on another drive
        return whole
    return whole if relative.is_absolute() or relative.parts[:2] == ("..", "..") else relative.as_posix()


def _is_file(character: str) -> bool:
    return character.lower().endswith(".npz")


def _same_pose(one: NDArray[np.float64] | None, other: NDArray[np.float64] | None) -> bool:
    """Return True if both are the same pose; None is the neutral face, zeros in a file."""
    if one is None or other is None:
        return one is other or not np.any(other if one is None else one)
    return one is other or np.array_equal(one, other)


def read_document(path: Path) -> Document:
    """Return the document in the session file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not a session file; the message names the place.
    """
    return read_json(path, "session", Document.from_json, _MAX_BYTES)


def write_document(path: Path, document: Document) -> str:
    """Write ``document`` to ``path`` atomically; ``Document.with_version_data`` adds the data for other versions.

    Returns:
        The text of the file.

    Raises:
        FacePoserError: If the file cannot be written, could not be opened again, or is among key poses.
    """
    check_not_key(path)
    text = json_text(path, document.to_json(), "session")
    text = _NUMBERS.sub(lambda found: f"[{', '.join(found[1].replace(',', ' ').split())}]", text) + "\n"
    try:
        Document.from_json(json.loads(text))
    except FacePoserError as error:
        raise FacePoserError(
            f"The session '{path}' was not written, since it could not be opened again: {error} Undo the change that "
            "led to this value, and save again."
        ) from error
    write_text(path, text, "session")
    return text
