"""Animation, transfer and export for ``Face``."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Self, get_args

from faceposer.animation.following import solve_trajectories
from faceposer.animation.keyframes import INBETWEENS, Keyframes
from faceposer.animation.trajectories import Trajectories
from faceposer.animation.trajectory_io import read_trajectories
from faceposer.api import checks
from faceposer.api.keys import KeyPoses
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.geometry.camera import Camera
from faceposer.model.performance import Performance
from faceposer.session.key_folder import KeyFolder
from faceposer.session.keys import check_characters, load_keys
from faceposer.session.opening import load_model, session_for
from faceposer.session.session import Session
from faceposer.session.transferred import transferred
from faceposer.sketch.inbetweens import Inbetweens
from faceposer.solve.problem import RECORDED_SPREAD
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair
from faceposer.transfer.source_heads import HeadTransfer
from faceposer.transfer.transfer import Method, Transfer, make_transfer

_LARGEST_SMOOTHNESS = 1e6
_LONGEST_TURN = 3600.0
_LONGEST_FILM = 1e6
_LOWEST_RATE, _HIGHEST_RATE = 1e-3, 1e3


def _warn(path: str | PathLike[str], notes: str) -> None:
    """Warn the caller of a method about ``notes`` on the file ``path``, if there are any."""
    if notes:
        warnings.warn(f"{fspath(path)}: {notes}", FacePoserWarning, stacklevel=3)


class MotionMixin:
    """Animation, transfer and export of the face of a session.

    Attributes:
        session: The document with its history.
    """

    session: Session

    def __init__(self, session: Session) -> None:
        """Wrap ``session``."""
        self.session = session

    @property
    def performance(self) -> Performance | None:
        """The animation of the face, frame by frame, or None without keys."""
        return self.session.animation.performance

    def set_key(self, frame: int) -> None:
        """Solve, and set the pose as the key at ``frame``, counted from 0; constraints are then removed.

        Raises:
            FacePoserError: If the constraints have no solution.
        """
        frame = checks.frame_number(frame)
        if self.session.pending:
            self.session.apply()
        self.session.wait(timeout=600.0)
        animation = self.session.animation
        animation.load(animation.keyframes.with_key(frame, self.session.coefficients), "Set a key", frame)
        self.session.wait()

    def set_animation(
        self,
        length: int | None = None,
        rate: float | None = None,
        loop: bool | None = None,
        inbetweens: Inbetweens | None = None,
    ) -> None:
        """Change settings of the animation, as one step; those that are None stay.

        Args:
            length: Number of frames.
            rate: Frames per second.
            loop: True if the first frame follows the last.
            inbetweens: "poses" for curves of rig weights from key to key, "feature points" for splines of feature
                points (docs/animation.md).
        """
        before = self.session.animation.keyframes
        self.session.animation.change(
            replace(
                before,
                length=before.length if length is None else checks.frame_count(length),
                rate=before.rate if rate is None else checks.number(rate, _LOWEST_RATE, _HIGHEST_RATE, "The rate"),
                loop=before.loop if loop is None else checks.one_of(loop, (False, True), "The loop"),
                inbetweens=checks.one_of(inbetweens or before.inbetweens, INBETWEENS, "The in-betweens"),
            ),
            "Change the animation",
        )

    def play(self, performance: Performance) -> None:
        """Replace the animation by ``performance``, with a key at every frame."""
        checks.performance_of(performance, self.session.model)
        self.session.animation.load(Keyframes.of_performance(performance), "Take an animation")
        self.session.wait()

    def take_animation(self, path: str | PathLike[str], rate: float | None = None) -> Performance:
        """Replace the animation by that in a file of weights, with a key at every frame, and return it.

        Args:
            path: A capture (.csv, .txt), weights (.json), or the morph targets of .glb.
            rate: Frames per second in place of those that the file states or its times give.

        Warns:
            FacePoserWarning: About a frame rate that was assumed, missing frames and ignored shapes.
        """
        from faceposer.interchange.reading import read_performance

        if rate is not None:
            checks.number(rate, _LOWEST_RATE, _HIGHEST_RATE, "The rate")
        read = read_performance(checks.file_path(path), self.session.model, rate)
        _warn(path, read.note)
        self.play(read.performance)
        return read.performance

    def follow(
        self,
        trajectories: Trajectories | str | PathLike[str],
        camera: Camera | None = None,
        smoothness: float = 1.0,
        spread: float = RECORDED_SPREAD,
        rate: float | None = None,
    ) -> Performance:
        """Solve for the motion in which points of the face follow ``trajectories`` (docs/animation.md).

        Args:
            trajectories: Trajectories, or their file (.csv, .json, .c3d, .trc), from which jumps are removed.
            camera: Camera of a table of pixels.
            smoothness: Weight of changes of velocity.
            spread: Extent of the face that follows, 0 to 1; by default the whole face, which suits recordings.
            rate: Frames per second in place of those of the file.

        Warns:
            FacePoserWarning: About a frame rate that was assumed and frames that are missing in the file.
        """
        model, document = self.session.model, self.session.document
        checks.number(smoothness, 0.0, _LARGEST_SMOOTHNESS, "The smoothness")
        checks.number(spread, 0.0, 1.0, "The spread")
        if camera is not None:
            checks.known_camera(camera)
        if not isinstance(trajectories, Trajectories):
            if rate is not None:
                checks.number(rate, _LOWEST_RATE, _HIGHEST_RATE, "The rate")
            read = read_trajectories(
                checks.file_path(trajectories, "Trajectories"), model.character, camera=camera, rate=rate
            )
            _warn(trajectories, " ".join(read.notes))
            trajectories, _ = read.without_jumps()
        return solve_trajectories(
            model,
            trajectories,
            smoothness=smoothness,
            prior_weight=document.prior_weight,
            prior=document.prior,
            spread=spread,
            start=document.start,
        )

    def follow_film(
        self,
        film: str | PathLike[str],
        start: float = 0.0,
        end: float | None = None,
        smoothness: float = 1.0,
        colours: bool = True,
        rate: float | None = None,
    ) -> Performance:
        """Return the motion with the expressions of the person in a film (docs/film.md), for ``play``.

        Args:
            film: A video (needs PyAV, ``pip install 'faceposer[film]'``), an animated GIF, or a folder of pictures.
            start: Beginning of the part that is used, in seconds.
            end: Its end in seconds; None for that of the film.
            smoothness: Weight of changes of velocity.
            colours: Follow the colours of the face, too; its landmarks alone are faster, and less exact.
            rate: Frames per second at which the film is sampled; its own if None.

        Warns:
            FacePoserWarning: About cuts, other faces, frames without the face, and a frame rate that was assumed.
        """
        from faceposer.film.expression import expression_of_film
        from faceposer.film.film import Span

        path = checks.file_path(film, "The film")
        start = checks.number(start, 0.0, _LONGEST_FILM, "The start")
        end = None if end is None else checks.number(end, 0.0, _LONGEST_FILM, "The end")
        if end is not None and end <= start:
            raise FacePoserError(f"The end of the part, {end:g} s, is not after its start, {start:g} s.")
        smoothness = checks.number(smoothness, 0.0, _LARGEST_SMOOTHNESS, "The smoothness")
        if rate is not None:
            rate = checks.number(rate, _LOWEST_RATE, _HIGHEST_RATE, "The rate")
        found = expression_of_film(
            path,
            self.session.model,
            span=Span(start, end),
            rate=rate,
            smoothness=smoothness,
            colours=bool(checks.one_of(colours, (False, True), "The choice of colours")),
        )
        _warn(film, " ".join(found.notes))
        return found.performance

    def transfer_to(
        self,
        character: str | PathLike[str],
        method: Method = "distances",
        pairs: Sequence[Pair] | None = None,
        keys: KeyPoses | str | PathLike[str] | None = None,
    ) -> Self:
        """Return another face with the pose and animation of this face (docs/transfer.md).

        Args:
            character: Name of a built-in character, or a character file.
            method: "distances" matches distances between feature points, "weights" copies ARKit weights, "examples"
                follows pairs of key poses.
            pairs: Pairs of points with distances to match; the built-in list if None.
            keys: Key poses of both characters, or their folder, for "examples".
        """
        session, name = self.session, checks.path_name(character, "The character")
        checks.one_of(method, get_args(Method), "The method")
        listed = isinstance(pairs, Sequence)
        if pairs is not None and not (listed and all(isinstance(pair, Pair) for pair in pairs)):
            raise FacePoserError("Pairs must be of the class faceposer.transfer.pairs.Pair, two feature points each.")
        if (keys is not None) != (method == "examples"):
            raise FacePoserError("The method 'examples' needs 'keys', a folder of key poses; other methods have none.")
        target = load_model(name)
        transfer: Transfer
        if keys is not None:
            place = keys.folder if isinstance(keys, KeyPoses) else Path(checks.path_name(keys, "The folder of keys"))
            folder = KeyFolder.read(place)
            check_characters(folder, session.model, name)
            loaded = load_keys(folder, "weights")
            _warn(place, loaded.remarks)
            transfer = HeadTransfer(loaded.transfer, session.model)
        else:
            transfer = make_transfer(session.model, target, method, DEFAULT_PAIRS if pairs is None else pairs)
        document = transferred(session.document, session.coefficients, transfer, name, target)
        return type(self)(session_for(document, None))

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

        Meshes, images and videos contain the contact step if ``contact`` is True. Morph targets (.glb) and weights
        (.csv, .json) cannot contain it: lids, lips and teeth may intersect there.

        Args:
            path: File with the suffix of a format, such as .obj, .ply, .glb, .csv, .json (weights, not a session),
                .png, .gif or .mp4; ``faceposer.interchange.formats`` lists all.
            motion: Performance to write instead of the pose, such as ``performance``, in formats that hold one.
            turn: Duration of one turn of a video's camera around the head, in seconds; 0 for a fixed camera.
            expression_lines: Show the expression lines of the skin in images and videos.
            transparent: Make the background of a .png transparent.
            materials: Write materials and textures next to an .obj.
        """
        from faceposer.interchange.formats import FORMATS, suffixes, write
        from faceposer.render.options import OutputOptions

        checks.number(turn, 0.0, _LONGEST_TURN, "The duration of a turn")
        form = FORMATS.get((target := checks.file_path(path)).suffix.lower())
        if turn and form is not None and form.holds != "film":
            videos = " or ".join(suffixes(lambda form: form.holds == "film"))
            raise FacePoserError(
                f"The camera turns in videos only; use a path that ends in {videos} instead of '{path}', or leave out "
                "'turn'."
            )
        model = self.session.model
        content = self.session.coefficients if motion is None else checks.performance_of(motion, model)
        options = OutputOptions(
            turn=turn,
            expression_lines=expression_lines,
            contact=self.session.document.contact,
            transparent=transparent,
            materials=materials,
        )
        write(target, model, content, options)
        return target

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
        """Write each frame of a performance as a separate file into a new folder, and return the folder.

        Args:
            folder: New or empty folder; files are named by it and the frame number, such as smile.0001.obj.
            kind: "obj", "ply" or "png".
            motion: The performance; by default the animation of the face.
            size: Width and height of images in pixels.
            turn: Duration of one turn of the camera of images around the head, in seconds; 0 for a fixed camera.
            expression_lines: Show the expression lines of the skin in images.
            transparent: Make the background of images transparent.
            materials: Write materials and textures for OBJ, once for all frames.
        """
        from faceposer.interchange.formats import Output, suffixes, write_sequence_steps
        from faceposer.render.options import OutputOptions

        kinds = tuple(suffix[1:] for suffix in suffixes(lambda form: form.sequence is not None))
        checks.one_of(kind, kinds, "The kind of a sequence")
        checks.number(turn, 0.0, _LONGEST_TURN, "The duration of a turn")
        performance = self.performance if motion is None else checks.performance_of(motion, self.session.model)
        if performance is None:
            raise FacePoserError("The face has no animation; give 'motion', or set keys first.")
        options = OutputOptions(
            size=checks.image_size(size),
            turn=turn,
            expression_lines=expression_lines,
            contact=self.session.document.contact,
            transparent=transparent,
            materials=materials,
        )
        target = checks.file_path(folder, "A folder")
        for _ in write_sequence_steps(Output(target, self.session.model, performance, options), f".{kind}"):
            pass
        return target
