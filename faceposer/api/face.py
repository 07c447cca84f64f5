"""A face to pose in Python: what the window does to a session, ``Face`` does to it too (docs/api.md)."""

import warnings
from collections.abc import Iterable, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.api import checks
from faceposer.api.motion import InMotion
from faceposer.api.places import Pixels, Place, fixed_vertices, pixels_of, point_at
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.geometry.camera import VIEW_ANGLES, Camera, ViewName
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.strokes import StrokeShape
from faceposer.model.character import Character
from faceposer.model.character_file import available_characters
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.poses import applying, library
from faceposer.poses.pose_file import Pose, checked_name, read_pose
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
PathName = str | PathLike[str]
_Kind = TypeVar("_Kind", bound=Constraint)
_SIZE = (960, 960)
# As files of weights have them.
_LARGEST_SHAPE = 1000.0


def load(what: PathName) -> "Face":
    """Return a face: a shipped character by its name ("man"), a character's file (.npz), or a saved session (.json).

    A session that was made on another version of its character is made to fit, with a ``FacePoserWarning`` that says
    what was done and what may be off (docs/session-format.md).

    Raises:
        FacePoserError: If it cannot be found or read.
    """
    session = open_session(fspath(what))
    if session.remark:
        warnings.warn(session.remark, FacePoserWarning, stacklevel=2)
    return Face(session)


def characters() -> list[str]:
    """Return the names of the characters that come with the program."""
    return [name for name, _ in available_characters()]


class Face(InMotion):
    """A face, what pulls at it, and its pose.

    Constraints are added one by one; ``solve`` lets the face follow all of them. Pixels are (u, v) from the top left of
    a camera's picture; without a camera they are those of ``camera()``, the front view of 960 x 960. Methods raise
    FacePoserError, with one sentence, where something does not fit.

    Attributes:
        session: The document with its history, as the window edits it, for what this class does not offer.
    """

    def __init__(self, session: Session) -> None:
        """Work on ``session``."""
        session.wait()
        # The face follows when it is told to, so that ten constraints cost one solve.
        session.mode = "apply"
        self.session = session

    # What there is

    @property
    def model(self) -> FaceModel:
        """The character with its subspace and its prior."""
        return self.session.model

    @property
    def character(self) -> Character:
        """The character."""
        return self.model.character

    @property
    def subject(self) -> Character:
        """The character; an earlier name of this attribute."""
        return self.character

    @property
    def coefficients(self) -> Array:
        """The pose in the model's subspace, shape (r,); zeros are the neutral face."""
        return self.session.coefficients

    @property
    def vertices(self) -> NDArray[np.float32]:
        """The vertices as they are shown and exported, shape (N, 3), in centimetres, in the character's order."""
        return self.session.vertices

    @property
    def contact(self) -> bool:
        """Whether surfaces are kept apart after the solve: lids, eyeballs, lips and teeth (docs/contact.md).

        It shows in ``vertices``, pictures, films and meshes; morph targets of .glb and weights cannot contain it.
        """
        return self.session.document.contact

    @contact.setter
    def contact(self, on: bool) -> None:
        if not isinstance(on, bool):
            raise FacePoserError(f"The contact is True or False, not {on!r}.")
        self.session.set_contact(on)

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex ids, shape (T, 3)."""
        return self.model.triangles

    @property
    def weights(self) -> dict[str, float]:
        """Weight of each of the rig's shapes by name, within its limits, nearest to the pose."""
        from faceposer.solve.weight_fit import fit_weights

        return fit_weights(self.model, self.coefficients)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """What pulls at the face, in the order in which it was added."""
        return self.session.document.constraints

    @property
    def residuals(self) -> tuple[float, ...]:
        """How far each constraint is from being met, in pixels of its camera."""
        return self.session.residuals_px

    def camera(self, view: ViewName = "front", size: tuple[int, int] = _SIZE) -> Camera:
        """Return the camera that frames the face from ``view`` in a picture of ``size``, (width, height) in pixels."""
        checks.one_of(view, tuple(VIEW_ANGLES), "A view")
        width, height = checks.picture_size(size)
        return face_view(self.character, view, width / height).camera((width, height))

    def pixel(self, place: Place, camera: Camera | None = None) -> tuple[float, float]:
        """Return where ``camera`` shows ``place`` in the present pose."""
        camera = self._seen_by(camera)
        points = SurfacePoints.of([self._point(place, camera)])
        u, v = camera.project(self.model.positions_at(points, self.coefficients))[0].tolist()
        return (u, v)

    # What pulls at the face

    def drag(
        self, place: Place, to: tuple[float, float], camera: Camera | None = None, weight: float = 1.0
    ) -> PointConstraint:
        """Pull ``place`` to the pixel ``to``."""
        camera = self._seen_by(camera)
        target = pixels_of([to])[0]
        return self._add(PointConstraint(self._point(place, camera), target, camera, weight=weight), "Place a point")

    def set_distance(
        self, first: Place, second: Place, pixels: float, camera: Camera | None = None, weight: float = 1.0
    ) -> DistanceConstraint:
        """Let ``first`` and ``second`` appear so many ``pixels`` apart."""
        camera = self._seen_by(camera)
        anchors = (self._point(first, camera), self._point(second, camera))
        if anchors[0] == anchors[1]:
            raise FacePoserError("A distance is between two places, and these are one.")
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
        """Let what a brush of ``width`` pixels painted along ``source`` come to lie where it painted along ``target``.

        Args:
            source: Pixels along the way over the face in its present pose, shape (n, 2).
            target: Pixels along the way where that should be, shape (m, 2).
            width: Diameter of the brush.
            camera: The view in which both were drawn.
            shape: Whether the target is a line, closes itself, or is filled.
            energy: "distance", or the paper's difference of "image"s.
            weight: Factor on its energy.
        """
        drawn = StrokeConstraint(
            pixels_of(source),
            pixels_of(target),
            checks.real(width, "The width"),
            self._seen_by(camera),
            shape=shape,
            energy=energy,
            weight=weight,
        )
        return self._add(drawn, "Draw a stroke")

    def curve(
        self, source: Pixels, target: Pixels, camera: Camera | None = None, weight: float = 1.0
    ) -> CurveConstraint:
        """Let the face under the curve through ``source`` follow that through ``target``, as many pixels, (n, 2)."""
        ways = pixels_of(source), pixels_of(target)
        if not 2 <= len(ways[0]) == len(ways[1]):
            raise FacePoserError(
                f"A curve has two points or more, and as many for its target, not {len(ways[0])} and {len(ways[1])}."
            )
        return self._add(CurveConstraint(*ways, self._seen_by(camera), weight=weight), "Draw a curve")

    def fix(self, what: str | ArrayLike, weight: float = 1.0) -> FixedConstraint:
        """Hold ``what`` where it is now: a region ("left brow"), a feature point, or indices of vertices, (n,)."""
        ids = fixed_vertices(self.character, what)
        return self._add(FixedConstraint(SurfacePoints.at_vertices(ids), weight=weight), "Fix vertices")

    def look(self, yaw: float = 0.0, pitch: float = 0.0) -> GazeConstraint:
        """Turn both eyes by degrees to the character's left and upwards, in place of where they were told to look.

        Raises:
            FacePoserError: If the character has no shapes that turn its eyes.
        """
        told = [i for i, constraint in enumerate(self.constraints) if isinstance(constraint, GazeConstraint)]
        angles = tuple(checks.number(angle, -180.0, 180.0, "An angle") for angle in (yaw, pitch))
        gaze = GazeConstraint((angles[0], angles[1])).within_reach()
        if not gaze.weights().keys() & set(self.character.shape_names):
            raise FacePoserError(
                f"The eyes of '{self.character.title}' cannot be turned, because it has no eyeLook shapes; set others."
            )
        if not told:
            return self._add(gaze, "Turn the eyes")
        self.session.change_constraint(told[0], gaze, "Turn the eyes")
        return gaze

    def remove(self, constraint: Constraint) -> None:
        """Take ``constraint``, one of ``constraints``, away."""
        for i, other in enumerate(self.constraints):
            if other is constraint or other == constraint:
                self.session.remove_constraints({i}, "Remove a constraint")
                return
        raise FacePoserError("This constraint does not pull at the face; give one of 'constraints'.")

    def reset(self) -> None:
        """Return to the neutral face without constraints."""
        self.session.reset_pose()

    # How it follows

    @property
    def prior_weight(self) -> float:
        """How strongly the face is held to natural expressions, from 0; usually 1."""
        return self.session.document.prior_weight

    @prior_weight.setter
    def prior_weight(self, weight: float) -> None:
        self.session.set_prior_weight(checks.number(weight, 0.0, 1000.0, "The prior weight"))

    @property
    def prior(self) -> Prior:
        """Whether the face is judged by "regions", as a "whole", or as the mixture was learned, "plain"."""
        return self.session.document.prior

    @prior.setter
    def prior(self, prior: Prior) -> None:
        if prior not in PRIORS:
            raise FacePoserError(f"The prior is one of {', '.join(PRIORS)}, not '{prior}'.")
        self.session.set_prior(prior)

    @property
    def spread(self) -> float:
        """How much of the face follows a pull, from 0, only what was pulled, to 1, the whole face; usually 0.5."""
        return self.session.document.spread

    @spread.setter
    def spread(self, spread: float) -> None:
        self.session.set_spread(checks.number(spread, 0.0, 1.0, "The spread"))

    def solve(self) -> Solution:
        """Let the face follow all constraints, and return what came of it: energy, residuals, iterations, seconds."""
        self.session.apply()
        self.session.wait(timeout=600.0)
        assert self.session.solution is not None
        return self.session.solution

    # The pose that it starts from

    def set_weights(self, weights: Mapping[str, float]) -> None:
        """Start from the pose with these ``weights`` by the names of the rig's shapes, the others being 0."""
        for name, weight in weights.items():
            checks.number(weight, -_LARGEST_SHAPE, _LARGEST_SHAPE, f"The weight of '{name}'")
        try:
            start = self.model.coefficients_of(weights)
        except KeyError as error:
            raise FacePoserError(f"'{self.character.title}' has no shape '{error.args[0]}'.") from error
        self._start_from(start, "Set the weights")

    def apply_pose(
        self,
        pose: Pose | PathName,
        strength: float = 1.0,
        regions: Iterable[applying.Region] | applying.Region | None = None,
        side: applying.Side = "both",
        blend: applying.Blend = "replace",
    ) -> None:
        """Apply ``pose`` to the pose that the face starts from.

        Args:
            pose: A pose, its file (.json), or the name of one of the user's or of those that come with the program.
            strength: From -1 to 2; 1 gives the pose itself.
            regions: Which of "brows", "eyes", "cheeks" and "mouth" it reaches; None for the whole face.
            side: Which side it reaches.
            blend: "replace" goes from the start towards the pose, "add" puts the pose on top of it.
        """
        chosen = pose if isinstance(pose, Pose) else self._find_pose(pose)
        start = self.model.neutral() if self.session.document.start is None else self.session.document.start
        reached = None if regions is None else checks.some_of(regions, applying.REGIONS, "A region")
        checks.one_of(side, get_args(applying.Side), "A side")
        checks.one_of(blend, get_args(applying.Blend), "The blend")
        checks.number(strength, applying.LEAST_STRENGTH, applying.GREATEST_STRENGTH, "The strength")
        posed = applying.applied(self.model, start, chosen, strength, reached, side, blend)
        self._start_from(posed, f"Apply {chosen.name}")

    def mirror(self, source: Literal["left", "right"] = "left") -> None:
        """Make the other side of the face the image of the side ``source``; constraints have then done their part."""
        checks.one_of(source, ("left", "right"), "The source of a mirror")
        self.session.rebase_pose(applying.mirrored(self.model, self.coefficients, source), "Mirror the face")

    def flip(self) -> None:
        """Exchange left and right of the face; its constraints have then done their part."""
        self.session.rebase_pose(applying.flipped(self.model, self.coefficients), "Flip the face")

    def pose(self, name: str) -> Pose:
        """Return the present pose under a ``name``."""
        return applying.pose_of(self.model, self.coefficients, checked_name(name))

    def save_pose(self, name: str, folder: PathName | None = None, overwrite: bool = False) -> Path:
        """Write the present pose into the user's library, or into ``folder``, and return its file."""
        where = library.own_folder() if folder is None else Path(folder)
        return library.PoseLibrary(where).save(self.pose(name), overwrite)

    # Files and pictures

    def save(self, path: PathName) -> Path:
        """Write the session (.json), a picture (.png), or the pose as ``export`` does, and return the path.

        Contact is in pictures and meshes, not in the morph targets of .glb nor in weights.
        """
        target = Path(path)
        suffix = target.suffix.lower()
        if suffix == ".json":
            self.session.save(target)
        elif suffix == ".png":
            self.render(target)
        else:
            self.export(target)
        return target

    def take_pose(self, path: PathName, frame: int = 0) -> str:
        """Start from the pose in a posed mesh (.obj, .ply) or in a frame of weights; return how well it came over."""
        from faceposer.interchange.reading import read_pose

        read = read_pose(Path(path), self.model, frame)
        self._start_from(read.coefficients, "Open a pose")
        return read.note

    def render(
        self,
        path: PathName | None = None,
        view: ViewName | Camera = "front",
        size: tuple[int, int] = _SIZE,
        shading: Literal["full", "clay"] = "full",
        expression_lines: bool = True,
        transparent: bool = False,
    ) -> NDArray[np.uint8]:
        """Return a picture of the face, shape (height, width, 3), and write it to ``path`` (.png) if there is one.

        Args:
            path: Where to write it.
            view: Where to look from, or a camera, which brings its own size.
            size: Width and height in pixels.
            shading: "clay" leaves the textures out.
            expression_lines: Draw the lines of the skin that the pose makes; clay has none.
            transparent: Leave the background out; the shape is (height, width, 4) then, with straight alpha.
        """
        from faceposer.render.images import write_png
        from faceposer.render.offscreen import render_character

        checks.one_of(shading, ("full", "clay"), "The shading")
        if path is not None and Path(path).suffix.lower() != ".png":
            raise FacePoserError(f"The picture '{path}' must end in '.png'.")
        camera = view if isinstance(view, Camera) else self.camera(view, size)
        picture = render_character(
            self.character,
            self.vertices,
            camera,
            shading=shading,
            expression_lines=expression_lines,
            transparent=transparent,
        )
        if path is not None:
            write_png(Path(path), picture)
        return picture

    # Behind it

    def _seen_by(self, camera: Camera | None) -> Camera:
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

    def _start_from(self, start: Array, label: str) -> None:
        with self.session.edit(label):
            self.session.set_start(start)

    def _find_pose(self, name: PathName) -> Pose:
        text = fspath(name)
        if Path(text).suffix.lower() == library.SUFFIX:
            return read_pose(Path(text))
        own = library.PoseLibrary(library.own_folder()).entries()
        entries = [
            entry
            for entry in (*own, *library.starter_poses())
            if entry.pose is not None and applying.weights_on(entry.pose, self.character) is not None
        ]
        pose = library.found(entries, text, f"for '{self.character.title}'").pose
        assert pose is not None
        return pose
