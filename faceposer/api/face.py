"""Posing a face from Python: ``Face`` edits a session as the window does (docs/api.md)."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.api import checks
from faceposer.api.heads import HeadsMixin, new_identity
from faceposer.api.motion import MotionMixin
from faceposer.api.photos import PhotosMixin
from faceposer.api.places import Pixels, Place, fixed_vertices, pixels_of, point_at
from faceposer.api.posing import PathName, PosingMixin
from faceposer.api.sketching import SketchingMixin
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.files.atomic import check_not_input
from faceposer.geometry.camera import VIEW_ANGLES, Camera, ViewName
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.strokes import StrokeShape
from faceposer.identity.head_choices import RANDOM_SKIN, VARIETY
from faceposer.model.character import Character
from faceposer.model.character_file import available_characters
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.base import LARGEST_WEIGHT
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint, StrokeEnergy
from faceposer.solve.map_solver import Solution
from faceposer.solve.priors import PRIORS, Prior

Array = NDArray[np.float64]
_Kind = TypeVar("_Kind", bound=Constraint)
_SIZE = (960, 960)


def load(what: PathName) -> "Face":
    """Load a built-in character by name ("man"), a character file (.npz) or a saved session (.json).

    A session made with another version of its character is adapted, with a ``FacePoserWarning`` that describes the
    changes (docs/session-format.md).

    Raises:
        FacePoserError: If the face cannot be found or read.
    """
    session = open_session(checks.path_name(what, "A face"))
    if session.remark:
        warnings.warn(session.remark, FacePoserWarning, stacklevel=2)
    return Face(session)


def new_head(
    seed: int = 0,
    attributes: Mapping[str, float] | None = None,
    variety: float = VARIETY,
    caricature: float = 1.0,
    texture: str | None = RANDOM_SKIN,
    tone: float | None = None,
    base: PathName = "man",
) -> "Face":
    """Return a face with a random head of the morphable model (docs/identity.md), reproducible by ``seed``.

    Args:
        seed: Seed of the head and of its skin, a whole number.
        attributes: Values of attributes by name, such as {"age": 0.5}; 0 is average.
        variety: Spread relative to people, 0 to 2; 0 gives the average head.
        caricature: Factor on the deviation from the average, 0 to 2.5, applied before the attributes.
        texture: Skin and tone, as for ``Face.set_skin``.
        tone: See ``texture``.
        base: Character whose head is replaced, as for ``load``; its mesh must be that of the built-in man.
    """
    face = load(base)
    head = new_identity(face._head_editor, seed, attributes, variety, caricature, texture, tone)
    face.session.set_identity(head, "New head")
    return face


def characters() -> list[str]:
    """Return the names of the built-in characters."""
    return [name for name, _ in available_characters()]


class Face(HeadsMixin, PosingMixin, SketchingMixin, MotionMixin, PhotosMixin):
    """A face with its constraints and its pose.

    Constraints are added one by one; ``solve`` then finds the pose that satisfies all of them. Pixels are (u, v) from
    the top left of a camera's image; the default camera is ``camera()``, the front view of 960 x 960 pixels. Methods
    raise FacePoserError, with one sentence, if an argument is invalid.

    Attributes:
        session: The document with its history, as the window edits it, for anything that this class does not offer.
    """

    def __init__(self, session: Session) -> None:
        """Wrap ``session``."""
        session.wait()
        # Solve on request only, so that ten constraints cost one solve.
        session.mode = "apply"
        self.session = session

    # State
    @property
    def model(self) -> FaceModel:
        """The character with its subspace and prior."""
        return self.session.model

    @property
    def character(self) -> Character:
        """The character."""
        return self.model.character

    @property
    def subject(self) -> Character:
        """Alias of ``character``, its former name."""
        return self.character

    @property
    def coefficients(self) -> Array:
        """The pose in the model's subspace, shape (r,); zeros are the neutral face."""
        return self.session.coefficients

    @property
    def vertices(self) -> NDArray[np.float32]:
        """The vertices as shown and exported, shape (N, 3), in centimetres, in the character's order."""
        return self.session.vertices

    @property
    def contact(self) -> bool:
        """True if lids, eyeballs, lips and teeth are kept from intersecting after the solve (docs/contact.md).

        Contact affects ``vertices``, images, videos and meshes; morph targets (.glb) and weights cannot contain it.
        """
        return self.session.document.contact

    @contact.setter
    def contact(self, on: bool) -> None:
        if not isinstance(on, bool):
            raise FacePoserError(f"The contact must be True or False, not {on!r}.")
        self.session.set_contact(on)

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices of the triangles, shape (T, 3)."""
        return self.model.triangles

    @property
    def weights(self) -> dict[str, float]:
        """Weights of the rig's shapes by name, within their limits, that best reproduce the pose."""
        from faceposer.solve.weight_fit import fit_weights

        return fit_weights(self.model, self.coefficients)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints on the face, in the order in which they were added."""
        return self.session.document.constraints

    @property
    def residuals(self) -> tuple[float, ...]:
        """Error of each constraint, in pixels of its camera."""
        return self.session.residuals_px

    def camera(self, view: ViewName = "front", size: tuple[int, int] = _SIZE) -> Camera:
        """Return the camera that frames the face from ``view`` in an image of ``size``, (width, height) in pixels."""
        checks.one_of(view, tuple(VIEW_ANGLES), "A view")
        width, height = checks.image_size(size)
        return face_view(self.character, view, width / height).camera((width, height))

    def pixel(self, place: Place, camera: Camera | None = None) -> tuple[float, float]:
        """Return the pixel (u, v) at which ``camera`` shows ``place`` in the current pose."""
        camera = self._checked_camera(camera)
        points = SurfacePoints.of([self._point(place, camera)])
        u, v = camera.project(self.model.positions_at(points, self.coefficients))[0].tolist()
        return (u, v)

    # Constraints
    def drag(
        self, place: Place, to: tuple[float, float], camera: Camera | None = None, weight: float = 1.0
    ) -> PointConstraint:
        """Add a point constraint that pulls ``place`` to the pixel ``to``."""
        camera = self._checked_camera(camera)
        target = pixels_of([to])[0]
        return self._add(PointConstraint(self._point(place, camera), target, camera, weight=weight), "Place a point")

    def set_distance(
        self, first: Place, second: Place, pixels: float, camera: Camera | None = None, weight: float = 1.0
    ) -> DistanceConstraint:
        """Add a distance constraint: ``first`` and ``second`` appear ``pixels`` apart in the image of ``camera``."""
        camera = self._checked_camera(camera)
        anchors = (self._point(first, camera), self._point(second, camera))
        if anchors[0] == anchors[1]:
            raise FacePoserError("A distance must be between two different places.")
        length = checks.real(pixels, "The distance")
        return self._add(DistanceConstraint(anchors, length, camera, weight=weight), "Set a distance")

    def stroke(
        self,
        source: Pixels,
        target: Pixels,
        width: float = 8.0,
        camera: Camera | None = None,
        shape: StrokeShape = "line",
        energy: StrokeEnergy = "distance",
        weight: float = 1.0,
    ) -> StrokeConstraint:
        """Add a stroke constraint: the part of the face under the stroke ``source`` moves to the stroke ``target``.

        Args:
            source: Pixels along the stroke over the face in its current pose, shape (n, 2).
            target: Pixels along the stroke to which that part moves, shape (m, 2).
            width: Diameter of the brush, in pixels.
            camera: The view in which both strokes are drawn.
            shape: Shape of the target: an open line, a closed line, or a filled area.
            energy: "distance", or "image" for the image difference of the paper.
            weight: Factor on the energy of the constraint.
        """
        constraint = StrokeConstraint(
            pixels_of(source),
            pixels_of(target),
            checks.real(width, "The width"),
            self._checked_camera(camera),
            shape=shape,
            energy=energy,
            weight=weight,
        )
        return self._add(constraint, "Draw a stroke")

    def curve(
        self, source: Pixels, target: Pixels, camera: Camera | None = None, weight: float = 1.0
    ) -> CurveConstraint:
        """Add a curve constraint: the face under the curve ``source`` moves to ``target``, pixels of shape (n, 2)."""
        curves = pixels_of(source), pixels_of(target)
        lengths = len(curves[0]), len(curves[1])
        if not 2 <= lengths[0] == lengths[1]:
            raise FacePoserError(
                f"A curve and its target must have the same number of points, two points or more, not {lengths[0]} and "
                f"{lengths[1]}."
            )
        return self._add(CurveConstraint(*curves, self._checked_camera(camera), weight=weight), "Draw a curve")

    def fix(self, what: str | ArrayLike, weight: float = 1.0) -> FixedConstraint:
        """Fix ``what`` at its current place: a region ("left brow"), a feature point, or vertex indices, shape (n,)."""
        ids = fixed_vertices(self.character, what)
        return self._add(FixedConstraint(SurfacePoints.at_vertices(ids), weight=weight), "Fix vertices")

    def look(self, yaw: float = 0.0, pitch: float = 0.0) -> GazeConstraint:
        """Turn both eyes by ``yaw`` degrees to the character's left and ``pitch`` degrees up, replacing a former gaze.

        Raises:
            FacePoserError: If the character has no shapes that turn its eyes.
        """
        existing = [i for i, constraint in enumerate(self.constraints) if isinstance(constraint, GazeConstraint)]
        angles = tuple(checks.number(angle, -180.0, 180.0, "An angle") for angle in (yaw, pitch))
        gaze = GazeConstraint((angles[0], angles[1])).within_reach()
        if not gaze.weights().keys() & set(self.character.shape_names):
            raise FacePoserError(
                f"The eyes of '{self.character.title}' cannot be turned, because the character has no eyeLook shapes."
            )
        if not existing:
            return self._add(gaze, "Turn the eyes")
        self.session.change_constraint(existing[0], gaze, "Turn the eyes")
        return gaze

    def remove(self, constraint: Constraint) -> None:
        """Remove ``constraint``, one of ``constraints``."""
        for i, other in enumerate(self.constraints):
            if other is constraint or other == constraint:
                self.session.remove_constraints({i}, "Remove a constraint")
                return
        raise FacePoserError("The constraint is not on this face; give one of 'constraints'.")

    def reset(self) -> None:
        """Reset to the neutral face without constraints."""
        self.session.reset_pose()

    # Solving
    @property
    def prior_weight(self) -> float:
        """Weight of the prior on natural expressions, at least 0; 1 by default."""
        return self.session.document.prior_weight

    @prior_weight.setter
    def prior_weight(self, weight: float) -> None:
        self.session.set_prior_weight(checks.number(weight, 0.0, 1000.0, "The prior weight"))

    @property
    def prior(self) -> Prior:
        """Evaluation of the prior: per region ("regions"), over the "whole" face, or as the "plain" mixture."""
        return self.session.document.prior

    @prior.setter
    def prior(self, prior: Prior) -> None:
        if prior not in PRIORS:
            raise FacePoserError(f"The prior must be one of {', '.join(PRIORS)}, not '{prior}'.")
        self.session.set_prior(prior)

    @property
    def spread(self) -> float:
        """Extent of the face that follows, from 0 (only the pulled part) to 1 (the whole face); 0.5 by default."""
        return self.session.document.spread

    @spread.setter
    def spread(self, spread: float) -> None:
        self.session.set_spread(checks.number(spread, 0.0, 1.0, "The spread"))

    def solve(self) -> Solution:
        """Solve for the pose that best satisfies all constraints; return energy, residuals, iterations and seconds."""
        self.session.apply()
        self.session.wait(timeout=600.0)
        assert self.session.solution is not None
        return self.session.solution

    # Files and images
    def save(self, path: PathName) -> Path:
        """Write the session (.json), an image (.png), or the pose as ``export`` does, and return the path.

        Images and meshes contain contact; morph targets (.glb) and weights do not.
        """
        target = checks.file_path(path)
        suffix = target.suffix.lower()
        if suffix == ".json":
            self.session.save(target)
        elif suffix == ".png":
            self.render(target)
        else:
            self.export(target)
        return target

    def render(
        self,
        path: PathName | None = None,
        view: ViewName | Camera = "front",
        size: tuple[int, int] = _SIZE,
        shading: Literal["full", "clay"] = "full",
        expression_lines: bool = True,
        transparent: bool = False,
    ) -> NDArray[np.uint8]:
        """Render the face, shape (height, width, 3), and write the image to ``path`` (.png) if given.

        Args:
            path: File to write.
            view: Name of a view, or a camera, which has its own size.
            size: Width and height in pixels.
            shading: "full", or "clay" for a render without textures.
            expression_lines: Show the expression lines of the skin; clay shows none.
            transparent: Make the background transparent; the shape is then (height, width, 4), with straight alpha.
        """
        from faceposer.render.images import write_png
        from faceposer.render.offscreen import render_character

        checks.one_of(shading, ("full", "clay"), "The shading")
        target = None if path is None else checks.file_path(path)
        if target is not None:
            if target.suffix.lower() != ".png":
                raise FacePoserError(f"The image '{target}' must end in '.png'.")
            check_not_input(target, *(photo.path for photo in self.session.document.photos))
        camera = view if isinstance(view, Camera) else self.camera(view, size)
        image = render_character(
            self.character,
            self.vertices,
            camera,
            shading=shading,
            expression_lines=expression_lines,
            transparent=transparent,
        )
        if target is not None:
            write_png(target, image)
        return image

    def _checked_camera(self, camera: Camera | None) -> Camera:
        return self.camera() if camera is None else checks.known_camera(camera)

    def _point(self, place: Place, camera: Camera) -> SurfacePoint | int:
        return point_at(self.model, self.coefficients, place, camera)

    def _add(self, constraint: _Kind, label: str) -> _Kind:
        checks.number(constraint.weight, 0.0, LARGEST_WEIGHT, "The weight of a constraint")
        checks.check_constraint(constraint)
        try:
            resolved = constraint.resolved(self.model, self.coefficients)
        except ValueError as error:
            raise FacePoserError(f"The constraint does not fit '{self.character.title}': {error}.") from error
        self.session.add_constraint(resolved, label)
        return resolved
