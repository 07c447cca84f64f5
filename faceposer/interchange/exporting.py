"""Everything that a pose or a performance can be written as: files of interchange, and pictures still or moving."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picture_view import View
from faceposer.interchange import export
from faceposer.interchange.progress import Progress, no_progress
from faceposer.interchange.sampling import resampled
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.model.performance import Performance
from faceposer.render.film import FASTEST_GIF, Picture, find_ffmpeg, write_gif, write_mp4
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.images import write_png
from faceposer.render.offscreen import offscreen_context
from faceposer.render.renderer import Renderer, Shading
from faceposer.render.turntable import framed_all_round, turned

#: What a picture holds, by its suffix; with those of interchange, all that can be written.
PICTURES: dict[str, str] = {
    ".png": "a picture of the pose",
    ".gif": "the face in motion or turning round, for web pages",
    ".mp4": "the same as a film, by ffmpeg",
}
FORMATS: dict[str, str] = export.FORMATS | PICTURES
ANIMATED = (*export.ANIMATED, ".gif", ".mp4")
_GIF_RATE, _FILM_RATE = 25.0, 30.0
_SAMPLES = 4
# Seconds of a turn where nothing else moves.
_USUAL_TURN = 4.0
_MOST_FRAMES = 100_000
# All frames of a GIF are in memory together, with a byte for each pixel.
_MOST_GIF_PIXELS = 2_000_000_000
# Poses that decide how far away the camera of a performance stands.
_FRAMED_POSES = 24


@dataclass(frozen=True)
class Look:
    """How pictures are made.

    Attributes:
        size: Width and height in pixels.
        view: Name of the view that pictures begin with, one of geometry.camera.VIEW_ANGLES.
        turn: Seconds of one turn of the camera about the head, 0 to stand still.
        rate: Frames per second, None for what suits the format and the performance.
        shading: "full", or "clay" without textures.
        orbit: The view itself; in place of ``view`` where the camera stands still.
        expression_lines: Draw the lines of the skin that a pose makes; clay has none.
        contact: Whether faces are shown after the contact step; so are posed meshes that ``write`` writes.
    """

    size: tuple[int, int] = (640, 640)
    view: str = "front"
    turn: float = 0.0
    rate: float | None = None
    shading: Shading = "full"
    orbit: View | None = None
    expression_lines: bool = True
    contact: bool = True


def write(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    look: Look | None = None,
    progress: Progress = no_progress,
) -> None:
    """Write a face in the format that the suffix of ``path`` names, all or nothing.

    Args:
        path: Ends in one of ``FORMATS``.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        look: How pictures are made.
        progress: Is told how far it is; what it raises ends the export.

    Raises:
        FacePoserError: If the suffix is none of these or takes no performance, the file cannot be written, or pictures
            are wanted where there is no OpenGL or no ffmpeg.
    """
    if path.suffix.lower() in PICTURES:
        for share in picture_steps(path, model, motion, look or Look()):
            progress(share)
    elif path.suffix.lower() in export.FORMATS:
        export.write(path, model, motion, progress, look is None or look.contact)
    else:
        raise FacePoserError(f"'{path}' must end in one of {', '.join(FORMATS)}.")


def picture_steps(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    look: Look,
    ctx: moderngl.Context | None = None,
) -> Iterator[float]:
    """Write a picture or a film, telling after each frame which share is done; closing the iterator ends it early.

    A pose that is to move turns round once; a performance is played once, while the camera turns if the look says so.

    Args:
        path: Ends in one of ``PICTURES``.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        look: How they are made.
        ctx: What to draw with; a context of its own if None.

    Raises:
        FacePoserError: If a still picture of a performance is wanted, the file cannot be written, or there is no OpenGL
            or no ffmpeg.
    """
    suffix = path.suffix.lower()
    if suffix == ".png":
        if isinstance(motion, Performance):
            raise FacePoserError(f"'{path}' shows one pose and not {len(motion)}; choose a frame, or write a .gif.")
        with _pictures(model, look, look.size, ctx) as pictures:
            view = look.orbit or face_view(model.subject, look.view, look.size[0] / look.size[1])
            write_png(path, pictures.draw(motion, view.camera(look.size)))
        return
    shot = _Shot(model, motion, look, suffix)
    if suffix == ".mp4":
        find_ffmpeg()
    with _pictures(model, look, shot.size, ctx) as pictures:

        def draw(frame: int) -> Picture:
            return pictures.draw(shot.pose(frame), shot.camera(frame))

        if suffix == ".gif":
            yield from write_gif(path, draw, shot.count, shot.rate)
        else:
            yield from write_mp4(path, draw, shot.count, shot.rate, shot.size)


class _Shot:
    """What is to be seen in each frame of a film.

    Attributes:
        size: Of the frames, in pixels.
        rate: Frames per second.
        count: How many frames.
    """

    def __init__(self, model: FaceModel, motion: NDArray[np.float64] | Performance, look: Look, suffix: str) -> None:
        # The colours of MP4 have half the resolution.
        width, height = look.size
        self.size = (width, height) if suffix == ".gif" else (max(width // 2, 1) * 2, max(height // 2, 1) * 2)
        usual = motion.rate if isinstance(motion, Performance) else _FILM_RATE
        self.rate = look.rate or (min(usual, _GIF_RATE) if suffix == ".gif" else usual)
        if suffix == ".gif":
            self.rate = min(self.rate, FASTEST_GIF)
        seconds = motion.seconds if isinstance(motion, Performance) else look.turn or _USUAL_TURN
        if seconds * self.rate > _MOST_FRAMES:
            raise FacePoserError(
                f"A film of {seconds * self.rate:.0f} frames is too long; at most {_MOST_FRAMES} are written."
            )
        if isinstance(motion, Performance):
            self._turn = look.turn
            self._poses = resampled(motion, self.rate).coefficients
            self.count = len(self._poses)
        else:
            self._turn = seconds
            self._poses = motion[None]
            self.count = max(round(seconds * self.rate), 1)
        if suffix == ".gif" and self.count * width * height > _MOST_GIF_PIXELS:
            raise FacePoserError(
                f"A GIF of {self.count} frames of {width}x{height} is too large; write an .mp4, or fewer or smaller "
                "frames."
            )
        self._fixed = None if look.orbit is None or self._turn else look.orbit.camera(self.size)
        if self._fixed is not None:
            return
        shown = np.linspace(0, len(self._poses) - 1, min(len(self._poses), _FRAMED_POSES)).astype(int)
        poses = [model.surface(self._poses[i], look.contact) for i in shown]
        self._view = framed_all_round([model.subject.vertices, *poses], self.size).looking(look.view)

    def pose(self, frame: int) -> NDArray[np.float64]:
        """Return the pose in ``frame``, shape (r,)."""
        pose: NDArray[np.float64] = self._poses[min(frame, len(self._poses) - 1)]
        return pose

    def camera(self, frame: int) -> Camera:
        """Return the camera of ``frame``."""
        if self._fixed is not None:
            return self._fixed
        share = frame / self.rate / self._turn if self._turn else 0.0
        return turned(self._view, share, self.size)


class _Pictures:
    """Draws poses of one face at one size."""

    def __init__(self, ctx: moderngl.Context, model: FaceModel, look: Look, size: tuple[int, int]) -> None:
        self._model = model
        self._look = look
        self._renderer = Renderer(ctx)
        self._renderer.set_subject(model.subject)
        self._target = ColourTarget(ctx, size, min(_SAMPLES, ctx.max_samples))
        self._normals = VertexNormals(model.triangles, len(model.subject.vertices))
        self._shown: NDArray[np.float64] | None = None

    def draw(self, pose: NDArray[np.float64], camera: Camera) -> Picture:
        """Return the picture of ``pose``, (r,), under ``camera``, of shape (height, width, 3)."""
        if self._shown is None or not np.array_equal(pose, self._shown):
            vertices = self._model.surface(pose, self._look.contact)
            self._renderer.update(vertices, self._normals(vertices))
            self._shown = pose
        look = self._look
        self._renderer.draw(self._target.framebuffer, camera, look.shading, expression_lines=look.expression_lines)
        self._target.resolve()
        return self._target.read()

    def release(self) -> None:
        """Free what the GPU holds."""
        self._target.release()
        self._renderer.release()


@contextmanager
def _pictures(model: FaceModel, look: Look, size: tuple[int, int], ctx: moderngl.Context | None) -> Iterator[_Pictures]:
    with ExitStack() as stack:
        context = ctx or stack.enter_context(offscreen_context())
        pictures = _Pictures(context, model, look, size)
        stack.callback(pictures.release)
        yield pictures
