"""Sketching on one character: recognition of strokes by a method chosen by its name, and the paper's pose."""

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.sketch.paper_pose import PaperPose
from faceposer.sketch.paper_recognition import PaperRecogniser
from faceposer.sketch.recognition import DrawnStroke, Recogniser, Recognition
from faceposer.sketch.training_poses import MANY_POSES, TrainingPoses
from faceposer.sketch.whole_stroke import WholeStrokeRecogniser

Array = NDArray[np.float64]
T = TypeVar("T")


class Sketched(Protocol):
    """A stroke with its matched feature points, such as a sketch constraint."""

    @property
    def camera(self) -> Camera:
        """The camera under which the stroke was drawn."""
        ...

    @property
    def matched(self) -> tuple[tuple[str, tuple[float, float]], ...]:
        """Names of feature points with their pixels."""
        ...


#: Methods of recognition by name: each is fitted to the model and its training poses. A further method is added here.
RECOGNISERS: Mapping[str, Callable[[FaceModel, TrainingPoses], Recogniser]] = {
    "ours": WholeStrokeRecogniser.of,
    "paper": PaperRecogniser,
}
#: The method that is used if none is named.
DEFAULT_RECOGNITION = "ours"

# Greatest distance of the paper's face from neutral, as a multiple of that of the training poses.
_FARTHEST = 1.5


class Sketcher:
    """Recognition of strokes and the paper's pose on one character.

    Everything is fitted when it is first needed. It may be used by several threads.
    """

    def __init__(self, model: FaceModel, library: Sequence[Array] = (), count: int = MANY_POSES, seed: int = 0) -> None:
        """Initialise.

        Args:
            model: The character's model.
            library: Coefficients of the poses of a library, each of shape (r,).
            count: Number of training poses.
            seed: Seed of the training poses.
        """
        self.model = model
        self._library, self._count, self._seed = tuple(library), count, seed
        self._parts: dict[str, Any] = {}
        self._lock = threading.RLock()

    def _part(self, name: str, build: Callable[[], T]) -> T:
        """Return the part ``name``, built once even if several threads ask for it."""
        part = self._parts.get(name)
        if part is None:
            with self._lock:
                part = self._parts.get(name)
                if part is None:
                    part = self._parts[name] = build()
        return part

    @property
    def training(self) -> TrainingPoses:
        """The training poses."""
        return self._part("training", lambda: TrainingPoses.of(self.model, self._count, self._library, self._seed))

    @property
    def features(self) -> tuple[str, ...]:
        """Names of the features that can be drawn on this character."""
        return self.training.features

    def recogniser(self, method: str = DEFAULT_RECOGNITION) -> Recogniser:
        """Return the recogniser of this name, one of ``RECOGNISERS``, fitted.

        Raises:
            KeyError: If there is no such method.
        """
        build = RECOGNISERS[method]
        return self._part(f"recogniser {method}", lambda: build(self.model, self.training))

    def recognise(
        self,
        stroke: DrawnStroke,
        pose: Array,
        others: Sequence[DrawnStroke] = (),
        feature: str | None = None,
        method: str = DEFAULT_RECOGNITION,
    ) -> Recognition:
        """Return the recognition of ``stroke``; see ``Recogniser.recognise``.

        Args:
            stroke: The stroke.
            pose: Present pose of the face, shape (r,).
            others: Strokes that have been drawn before, with their features.
            feature: Name of the feature that the stroke is known to depict, or None.
            method: Name of the method, one of ``RECOGNISERS``.
        """
        return self.recogniser(method).recognise(stroke, pose, others, feature)

    @property
    def paper(self) -> PaperPose:
        """The paper's models of poses, fitted."""
        height = self.model.character.height
        return self._part("paper pose", lambda: PaperPose.fit(self.training, height, seed=self._seed))

    def paper_pose(self, sketched: Sequence[Sketched], start: Array) -> Array:
        """Return the coefficients, shape (r,), of the paper's face for matched strokes.

        They depend on the strokes alone and are not limited to the natural range of the shapes; a face farther from
        neutral than ``_FARTHEST`` times the farthest training pose is moved back to that distance.

        Args:
            sketched: Strokes with their matched feature points, such as all enabled sketch constraints.
            start: Pose that is returned if no feature point is matched, shape (r,).
        """
        matched = [(stroke.camera, name, pixel) for stroke in sketched for name, pixel in stroke.matched]
        known = [match for match in matched if match[1] in self.training.index]
        if not known:
            return start
        pose = self.paper.coefficients(self.paper.places_of(known))
        if not np.isfinite(pose).all():
            return start
        most = _FARTHEST * float(np.linalg.norm(self.training.coefficients, axis=1).max())
        return np.asarray(pose * min(1.0, most / max(float(np.linalg.norm(pose)), 1e-300)))


_kept_lock = threading.Lock()


def sketcher_of(model: FaceModel, library: Sequence[Array] = ()) -> Sketcher:
    """Return the sketcher of ``model``, the same for the same library as long as few others are asked for."""
    # Threads that ask at the same time get the same sketcher.
    with _kept_lock:
        return _kept(model, tuple(np.asarray(p, dtype=np.float64).tobytes() for p in library))


@lru_cache(maxsize=2)
def _kept(model: FaceModel, library: tuple[bytes, ...]) -> Sketcher:
    return Sketcher(model, [np.frombuffer(pose) for pose in library])
