"""The declared types of session files (docs/session-format.md)."""

from typing import Annotated, Any

from msgspec import UNSET, Meta, UnsetType, field

from faceposer.animation.keyframes import Frame, KeyframesJson
from faceposer.files.json_documents import JsonDocument
from faceposer.identity.identity import IdentityJson
from faceposer.photo.photo import PhotosJson
from faceposer.session.character_version import CharacterVersionJson
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.sketch import SketchMethod
from faceposer.solve.priors import Prior
from faceposer.solve.problem import SPREAD

_MAX_PRIOR_WEIGHT = 1000.0
_MAX_CONSTRAINTS = 2_000


class AnimationJson(KeyframesJson, kw_only=True):
    """The animation in a session file: its keyframes and the current frame."""

    frame: Frame = 0


class SessionFile(JsonDocument, kw_only=True):
    """A session file; ``faceposer.session.document.Document`` describes the values."""

    subject: Annotated[str, Meta(min_length=1, description="the name or the path of a character")]
    constraints: Annotated[list[Any], Meta(max_length=_MAX_CONSTRAINTS)]
    prior_weight: Annotated[float, Meta(ge=0.0, le=_MAX_PRIOR_WEIGHT)] = 1.0
    prior: Prior = "regions"
    spread: Annotated[float, Meta(ge=0.0, le=1.0)] = SPREAD
    sketch_method: SketchMethod = "map"
    coefficients: list[codec.Coordinate] | UnsetType = UNSET
    start: list[codec.Coordinate] | UnsetType = UNSET
    contact: bool = True
    camera: codec.CameraJson | UnsetType = UNSET
    photos: PhotosJson = field(default_factory=list)
    animation: AnimationJson | UnsetType = UNSET
    weights: codec.ShapeWeights | UnsetType = UNSET
    start_weights: codec.ShapeWeights | UnsetType = UNSET
    character: CharacterVersionJson | UnsetType = UNSET
    identity: IdentityJson | UnsetType = UNSET
