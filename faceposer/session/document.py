"""What a user makes: a character, constraints and a pose, and the JSON file that holds them (docs/session-format.md)."""

import json
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import UNSET, Meta, UnsetType, field
from numpy.typing import ArrayLike, NDArray

from faceposer.animation.keyframes import Frame, Keyframes, KeyframesJson
from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import JsonDocument, check_header, convert, read_json
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import aligned
from faceposer.photo.photo import Photo, PhotosJson
from faceposer.session.character_version import CharacterVersion, CharacterVersionJson
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.registry import Constraint, constraint_from_json
from faceposer.solve.priors import Prior
from faceposer.solve.problem import SPREAD

FORMAT = "faceposer.session"
VERSION = 1
_MAX_BYTES = 64 * 2**20
_MAX_PRIOR_WEIGHT = 1000.0
_MAX_CONSTRAINTS = 10_000
# A list of numbers over several lines, as an indented file has it.
_NUMBERS = re.compile(r"\[\s+([-+.eE\d]+(?:,\s+[-+.eE\d]+)*)\s+\]")


@dataclass(frozen=True, eq=False)
class MadeOn:
    """What a file says of the character that its session was made on.

    Attributes:
        version: Its version.
        weights: Weights of its shapes in the pose, shape (S,), or None.
        start_weights: Weights of its shapes in the start pose, shape (S,), or None.
    """

    version: CharacterVersion
    weights: NDArray[np.float64] | None = None
    start_weights: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Document:
    """One state of the user's work; every edit makes a new one.

    Attributes:
        character: Name of a shipped character, or the path of a character's file: from everywhere while it is edited, and in
            a file as seen from where that lies.
        constraints: In the order in which they were made.
        prior_weight: Weight of the prior, at least 0.
        coefficients: The pose, shape (r,), read-only; None for the neutral face.
        start: The pose of the face before any constraint pulls at it, shape (r,), read-only; None for the neutral
            face. A file without constraints need not say it: there the pose is the pose to start from.
        prior: "regions" to judge the face region by region, "whole" to judge it as one, "plain" to judge it by the
            mixture as it was learned, start or no start.
        spread: How much of the face follows a pull, from 0, as little as explains it, to 1, the whole face.
        solved: Whether the pose is what the constraints ask for, or they still wait to be solved.
        camera: The view under which the document was last seen, or None.
        photos: That the face is posed after; their paths are like that of the character.
        keyframes: The animation, or None without one.
        frame: The frame of the animation that is shown, counted from 0.
        animated: Whether the pose and the start are just what the animation has at that frame, so that there is
            nothing to lose in going to another one.
        contact: Whether the face is shown and exported after the contact step (docs/contact.md).
        made_on: In a file, the version of the character that all was made on, and the weights of its poses; None while
            it is edited, and in files that do not say.
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
    made_on: MadeOn | None = None

    def posed(self, coefficients: ArrayLike) -> "Document":
        """Return the document with the pose that was solved for it, shape (r,)."""
        pose = np.array(coefficients, dtype=np.float64)
        pose.setflags(write=False)
        return replace(self, coefficients=pose, solved=True, animated=False)

    def animated_at(self, frame: int, coefficients: ArrayLike) -> "Document":
        """Return the document at ``frame`` with the pose, shape (r,), that its animation has there, unconstrained."""
        document = replace(self, constraints=(), frame=frame).starting_from(coefficients).posed(coefficients)
        return replace(document, animated=True)

    def starting_from(self, start: ArrayLike | None) -> "Document":
        """Return the document with another pose to start from, shape (r,); None for the neutral face."""
        pose = None if start is None else np.array(start, dtype=np.float64)
        if pose is not None:
            pose.setflags(write=False)
        return replace(self, start=pose, animated=False)

    def with_constraint(self, index: int, constraint: Constraint) -> "Document":
        """Return the document with constraint ``index`` exchanged."""
        return replace(self, constraints=(*self.constraints[:index], constraint, *self.constraints[index + 1 :]))

    def same_input(self, other: "Document") -> bool:
        """Whether both hold the same work: photos, contact, the animation at whatever frame, and else the same face."""
        keys = self.keyframes is other.keyframes or (
            self.keyframes is not None and self.keyframes.same(other.keyframes)
        )
        # What the animation has at two frames differs, and is no work.
        mine = replace(self, start=other.start) if self.animated and other.animated else self
        same = self.photos == other.photos and self.contact == other.contact
        return keys and same and mine.same_face(other)

    def same_face(self, other: "Document") -> bool:
        """Whether both ask for the same face: character, constraints and all of the prior agree."""
        ours = (self.character, self.constraints, self.prior_weight, self.prior, self.spread)
        theirs = (other.character, other.constraints, other.prior_weight, other.prior, other.spread)
        return ours == theirs and _same(self.start, other.start)

    def rests_like(self, other: "Document") -> bool:
        """Whether nothing pulls in either and both start from the same pose under one prior, which is then the pose."""
        return (
            not (self.constraints or other.constraints) and self.prior == other.prior and _same(self.start, other.start)
        )

    def to_json(self) -> dict[str, Any]:
        """Return the document as its file has it."""
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
        data |= self._poses_to_json()
        if not self.contact:
            data["contact"] = False
        if self.camera is not None:
            data["camera"] = codec.camera_to_json(self.camera)
        if self.photos:
            data["photos"] = [photo.to_json() for photo in self.photos]
        if self.keyframes is not None:
            data["animation"] = {"frame": self.frame, **self.keyframes.to_json()}
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
                # The prior alone moves the face away from where it starts.
                start = np.zeros_like(self.coefficients)
        if start is not None and (self.constraints or not _same(start, self.coefficients)):
            data["start"] = start.tolist()
            if made_on is not None and made_on.start_weights is not None:
                data["start_weights"] = codec.weights_to_json(made_on.start_weights)
        return data

    def stamped(self, model: FaceModel) -> "Document":
        """Return the document as a file keeps it: with what another version of the character ``model`` needs of it.

        That is the version of the mesh, the rest positions of all places, and the weights of all poses.
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
            FacePoserError: If anything is unknown, missing or of the wrong kind, naming its place.
        """
        check_header(data, FORMAT, VERSION)
        form = convert(data, _SessionFile)
        document = cls(
            form.subject,
            tuple(constraint_from_json(entry, f"constraints[{i}]") for i, entry in enumerate(form.constraints)),
            form.prior_weight,
            camera=None if form.camera is UNSET else form.camera.camera(),
            prior=form.prior,
            spread=form.spread,
            photos=tuple(photo.photo() for photo in form.photos),
            contact=form.contact,
        )
        if form.start is not UNSET:
            document = document.starting_from(form.start)
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
        """Return the document with all that its file leaves out looked up on the face that editing starts from.

        Raises:
            FacePoserError: If the constraints or the pose do not fit the face.
        """
        keys = () if self.keyframes is None else self.keyframes.keys
        poses = [("coefficients", self.coefficients), ("start", self.start)]
        poses += [(f"animation.keys[{i}].coefficients", key.pose) for i, key in enumerate(keys)]
        for name, pose in poses:
            if pose is not None and len(pose) != model.n_coefficients:
                raise FacePoserError(
                    f"{name} has {len(pose)} numbers where the character '{self.character}' has "
                    f"{model.n_coefficients}; remove the key to start from the neutral face."
                )
        start = model.neutral() if self.start is None else self.start
        constraints = []
        for i, constraint in enumerate(self.constraints):
            try:
                constraints.append(constraint.resolved(model, start))
            except ValueError as error:
                raise FacePoserError(f"constraints[{i}]: {error}.") from error
        photos = tuple(photo if photo.camera is not None else aligned(photo, model, start) for photo in self.photos)
        return replace(self, constraints=tuple(constraints), photos=photos)


def whole_character(character: str, folder: Path) -> str:
    """Return ``character``, if it is the path of a file, as seen from ``folder``, from everywhere."""
    if not _is_file(character):
        return character
    return os.path.normpath((folder / Path(character).expanduser()).absolute())


def character_from(character: str, folder: Path) -> str:
    """Return how a session in ``folder`` names ``character``.

    A file in the folder, beneath it, or in a folder beside it is named from there, with slashes, so that both can be
    moved together; any other by its whole path. ``character`` itself is a name, a whole path, or as seen from the current
    folder.
    """
    return path_from(character, folder) if _is_file(character) else character


def path_from(path: str, folder: Path) -> str:
    """Return how a session in ``folder`` names the file ``path``, as ``character_from`` does."""
    whole = os.path.normpath(Path(path).expanduser().absolute())
    try:
        relative = Path(os.path.relpath(whole, folder.absolute()))
    except ValueError:  # on another drive
        return whole
    return whole if relative.is_absolute() or relative.parts[:2] == ("..", "..") else relative.as_posix()


def _is_file(character: str) -> bool:
    return character.lower().endswith(".npz")


class _AnimationJson(KeyframesJson, kw_only=True):
    frame: Frame = 0


class _SessionFile(JsonDocument, kw_only=True):
    subject: Annotated[str, Meta(min_length=1, description="the name or the path of a character")]
    constraints: Annotated[list[Any], Meta(max_length=_MAX_CONSTRAINTS)]
    prior_weight: Annotated[float, Meta(ge=0.0, le=_MAX_PRIOR_WEIGHT)] = 1.0
    prior: Prior = "regions"
    spread: Annotated[float, Meta(ge=0.0, le=1.0)] = SPREAD
    coefficients: list[codec.Coordinate] | UnsetType = UNSET
    start: list[codec.Coordinate] | UnsetType = UNSET
    contact: bool = True
    camera: codec.CameraJson | UnsetType = UNSET
    photos: PhotosJson = field(default_factory=list)
    animation: _AnimationJson | UnsetType = UNSET
    weights: codec.ShapeWeights | UnsetType = UNSET
    start_weights: codec.ShapeWeights | UnsetType = UNSET
    character: CharacterVersionJson | UnsetType = UNSET


def _same(one: NDArray[np.float64] | None, other: NDArray[np.float64] | None) -> bool:
    """Whether both are the same pose; None is the neutral face, which is zeros in a file."""
    if one is None or other is None:
        return one is other or not np.any(other if one is None else one)
    return one is other or np.array_equal(one, other)


def read_document(path: Path) -> Document:
    """Return the document in the session file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not such a file, naming the place.
    """
    return read_json(path, "session", Document.from_json, _MAX_BYTES)


def write_document(path: Path, document: Document) -> None:
    """Write ``document`` to ``path``, all or nothing; see ``Document.stamped`` for what another version needs of it.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    text = json.dumps(document.to_json(), indent=1)
    text = _NUMBERS.sub(lambda found: f"[{', '.join(found[1].replace(',', ' ').split())}]", text)
    write_text(path, text + "\n", "session")
