"""What ``Face`` does over time, on other faces and for other programs."""

from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Self, get_args

from faceposer.animation.following import follow
from faceposer.animation.keyframes import Keyframes
from faceposer.animation.trajectories import Trajectories
from faceposer.animation.trajectory_io import read_trajectories
from faceposer.api import checks
from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.performance import Performance
from faceposer.session.opening import load_model, session_of
from faceposer.session.session import Session
from faceposer.session.transferred import transferred
from faceposer.solve.problem import RECORDED_SPREAD
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair
from faceposer.transfer.transfer import Method, make_transfer

_LARGEST_SMOOTHNESS = 1e6
_LONGEST_TURN = 3600.0


class InMotion:
    """The part of ``Face`` that knows of time and of other faces.

    Attributes:
        session: The document with its history.
    """

    session: Session

    def __init__(self, session: Session) -> None:
        """Work on ``session``."""
        self.session = session

    @property
    def performance(self) -> Performance | None:
        """The face's animation, frame by frame, or None without keys."""
        return self.session.animation.performance

    def set_key(self, frame: int) -> None:
        """Make the present pose the animation's key at ``frame``, from 0; constraints have then done their part."""
        frame = checks.frame_number(frame)
        animation = self.session.animation
        animation.load(animation.keyframes.with_key(frame, self.session.coefficients), "Set a key", frame)
        self.session.wait()

    def play(self, performance: Performance) -> None:
        """Take ``performance`` for the animation, with a key at every frame."""
        checks.performance_of(performance, self.session.model)
        self.session.animation.load(Keyframes.of_performance(performance), "Take an animation")
        self.session.wait()

    def follow(
        self,
        trajectories: Trajectories | str | PathLike[str],
        camera: Camera | None = None,
        smoothness: float = 1.0,
        spread: float = RECORDED_SPREAD,
    ) -> Performance:
        """Return the motion in which points of the face follow ``trajectories`` (docs/animation.md).

        Args:
            trajectories: Or their file (.csv, .json, .c3d), of which jumps are left out.
            camera: Of a table of pixels.
            smoothness: Weight of changes of velocity.
            spread: How much of the face follows, 0 to 1; the whole face unless told otherwise, as for recordings.
        """
        model, document = self.session.model, self.session.document
        checks.number(smoothness, 0.0, _LARGEST_SMOOTHNESS, "The smoothness")
        checks.number(spread, 0.0, 1.0, "The spread")
        if camera is not None:
            checks.known_camera(camera)
        if not isinstance(trajectories, Trajectories):
            read = read_trajectories(Path(trajectories), model.character, camera=camera)
            trajectories, _ = read.without_jumps()
        return follow(
            model,
            trajectories,
            smoothness=smoothness,
            prior_weight=document.prior_weight,
            prior=document.prior,
            spread=spread,
            start=document.start,
        )

    def transfer_to(
        self, character: str | PathLike[str], method: Method = "distances", pairs: Sequence[Pair] | None = None
    ) -> Self:
        """Return another face with this one's pose and animation (docs/transfer.md).

        Args:
            character: A shipped character by its name, or a character's file.
            method: By "distances" between feature points, or by ARKit's "weights".
            pairs: The distances that are kept; the program's own list if None.
        """
        session, name = self.session, fspath(character)
        checks.one_of(method, get_args(Method), "The method")
        if pairs is not None and not all(isinstance(pair, Pair) for pair in pairs):
            raise FacePoserError("Pairs are faceposer.transfer.pairs.Pair, of two feature points each.")
        target = load_model(name)
        transfer = make_transfer(session.model, target, method, DEFAULT_PAIRS if pairs is None else pairs)
        document = transferred(session.document, session.coefficients, transfer, name, target)
        return type(self)(session_of(document, None))

    def export(
        self,
        path: str | PathLike[str],
        motion: Performance | None = None,
        turn: float = 0.0,
        expression_lines: bool = True,
        transparent: bool = False,
        materials: bool = True,
    ) -> Path:
        """Write the pose, or a performance, for other programs (docs/interchange.md), and return the path.

        Meshes, pictures and films show the face after the contact step while ``contact`` is on. The morph targets of
        .glb and the weights of .csv and .json cannot contain it: lids, lips and teeth may lie in each other there.

        Args:
            path: Ends in the suffix of a format, such as .obj, .ply, .glb, .csv, .json (weights, no session), .png,
                .gif or .mp4; ``faceposer.interchange.formats`` has them all.
            motion: Written in place of the pose, such as ``performance``, by formats that hold one.
            turn: Seconds in which the camera of a film goes round the head once, 0 for one that stands.
            expression_lines: Draw the lines that a pose makes in the skin, in pictures and films.
            transparent: Leave the background of a .png out.
            materials: Write materials and textures beside an .obj.
        """
        from faceposer.interchange.formats import FORMATS, suffixes, write
        from faceposer.render.options import OutputOptions

        checks.number(turn, 0.0, _LONGEST_TURN, "The seconds of a turn")
        form = FORMATS.get(Path(path).suffix.lower())
        if turn and form is not None and form.holds != "film":
            films = " or ".join(suffixes(lambda form: form.holds == "film"))
            raise FacePoserError(f"The camera turns in films; let '{path}' end in {films}, or leave 'turn' out.")
        model = self.session.model
        moving = self.session.coefficients if motion is None else checks.performance_of(motion, model)
        options = OutputOptions(
            turn=turn,
            expression_lines=expression_lines,
            contact=self.session.document.contact,
            transparent=transparent,
            materials=materials,
        )
        write(Path(path), model, moving, options)
        return Path(path)

    def export_sequence(
        self,
        folder: str | PathLike[str],
        kind: str = "obj",
        motion: Performance | None = None,
        size: tuple[int, int] = (640, 640),
        turn: float = 0.0,
        expression_lines: bool = True,
        transparent: bool = False,
        materials: bool = True,
    ) -> Path:
        """Write each frame of a performance as a file of its own into a new folder, and return the folder.

        Args:
            folder: New or empty; its name and the number of the frame name the files, such as smile.0001.obj.
            kind: "obj", "ply" or "png".
            motion: The performance; the face's animation if left out.
            size: Width and height of pictures in pixels.
            turn: Seconds in which the camera of pictures goes round the head once, 0 for one that stands.
            expression_lines: Draw the lines that a pose makes in the skin, in pictures.
            transparent: Leave the background of pictures out.
            materials: Write materials and textures for OBJ, once for all frames.
        """
        from faceposer.interchange.formats import Output, suffixes, write_sequence_steps
        from faceposer.render.options import OutputOptions

        kinds = tuple(suffix[1:] for suffix in suffixes(lambda form: form.sequence is not None))
        checks.one_of(kind, kinds, "The kind of a sequence")
        checks.number(turn, 0.0, _LONGEST_TURN, "The seconds of a turn")
        played = self.performance if motion is None else checks.performance_of(motion, self.session.model)
        if played is None:
            raise FacePoserError("The face has no animation; give a motion, or set keys first.")
        options = OutputOptions(
            size=checks.picture_size(size),
            turn=turn,
            expression_lines=expression_lines,
            contact=self.session.document.contact,
            transparent=transparent,
            materials=materials,
        )
        for _ in write_sequence_steps(Output(Path(folder), self.session.model, played, options), f".{kind}"):
            pass
        return Path(folder)
