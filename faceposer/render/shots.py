"""Pictures and films of posed faces, drawn frame by frame into files."""

from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_folder
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.model.performance import Performance
from faceposer.model.sampling import resampled
from faceposer.render.ffmpeg import find_ffmpeg
from faceposer.render.film import FASTEST_GIF, Picture, write_gif, write_mp4
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.images import write_png
from faceposer.render.offscreen import offscreen_context
from faceposer.render.options import OutputOptions
from faceposer.render.renderer import Renderer
from faceposer.render.turntable import framed_all_round, turned

_GIF_RATE, _FILM_RATE = 25.0, 30.0
_SAMPLES = 4
# Seconds of a turn where nothing else moves.
_USUAL_TURN = 4.0
_MOST_FRAMES = 100_000
# All frames of a GIF are in memory together, with a byte for each pixel.
_MOST_GIF_PIXELS = 2_000_000_000
# Poses that decide how far away the camera of a performance stands.
_FRAMED_POSES = 24


def picture_steps(
    path: Path,
    model: FaceModel,
    pose: NDArray[np.float64],
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write ``pose``, shape (r,), as a PNG image; yields 1 when it is done.

    Args:
        path: The file.
        model: The face.
        pose: Shape (r,).
        options: How it is drawn.
        ctx: What to draw with; a context of its own if None.

    Raises:
        FacePoserError: If the file cannot be written, or there is no OpenGL.
    """
    with _pictures(model, options, options.size, ctx) as pictures:
        view = options.orbit or face_view(model.character, options.view, options.size[0] / options.size[1])
        write_png(path, pictures.draw(pose, view.camera(options.size)))
    yield 1.0


def picture_sequence_steps(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write each frame of ``performance`` as a PNG image into ``folder``, which must be new or empty.

    The files are called by the folder and the number of the frame, from 1, such as smile.0001.png. Yields the share
    that is done after each; the folder appears when all are written, and if the iterator is closed before, not at all.

    Args:
        folder: The folder.
        model: The face.
        performance: What is played once, while the camera turns if the options say so.
        options: How it is drawn.
        ctx: What to draw with; a context of its own if None.

    Raises:
        FacePoserError: If there would be too many, the folder holds something or cannot be written, or there is no
            OpenGL.
    """
    shot = _Shot(model, performance, options, options.size, options.rate or performance.rate)
    digits = max(4, len(str(shot.count)))
    with atomic_folder(folder) as temporary, _pictures(model, options, shot.size, ctx) as pictures:
        draw = shot.drawn_by(pictures)
        for frame in range(shot.count):
            write_png(temporary / f"{folder.name}.{frame + 1:0{digits}}.png", draw(frame))
            yield (frame + 1) / shot.count


def gif_steps(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write a film as GIF; yields the share that is done after each frame, and closing the iterator ends it early.

    A pose turns round once; a performance is played once, while the camera turns if the options say so.

    Args:
        path: The file.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: How it is drawn.
        ctx: What to draw with; a context of its own if None.

    Raises:
        FacePoserError: If the film would be too long or too large, the file cannot be written, or there is no OpenGL.
    """
    width, height = options.size
    rate = options.rate or (min(motion.rate, _GIF_RATE) if isinstance(motion, Performance) else _GIF_RATE)
    shot = _Shot(model, motion, options, (width, height), min(rate, FASTEST_GIF))
    if shot.count * width * height > _MOST_GIF_PIXELS:
        raise FacePoserError(
            f"A GIF of {shot.count} frames of {width}x{height} is too large; write an .mp4, or fewer or smaller frames."
        )
    with _pictures(model, options, shot.size, ctx) as pictures:
        yield from write_gif(path, shot.drawn_by(pictures), shot.count, shot.rate)


def mp4_steps(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write a film as MP4; parameters and steps as for ``gif_steps``.

    Raises:
        FacePoserError: If the film would be too long, the file cannot be written, or there is no OpenGL or no ffmpeg.
    """
    # The colours of MP4 have half the resolution.
    size = (max(options.size[0] // 2, 1) * 2, max(options.size[1] // 2, 1) * 2)
    rate = options.rate or (motion.rate if isinstance(motion, Performance) else _FILM_RATE)
    shot = _Shot(model, motion, options, size, rate)
    find_ffmpeg()
    with _pictures(model, options, shot.size, ctx) as pictures:
        yield from write_mp4(path, shot.drawn_by(pictures), shot.count, shot.rate, shot.size)


class _Shot:
    """What is to be seen in each frame of a film.

    Attributes:
        size: Of the frames, in pixels.
        rate: Frames per second.
        count: How many frames.
    """

    def __init__(
        self,
        model: FaceModel,
        motion: NDArray[np.float64] | Performance,
        options: OutputOptions,
        size: tuple[int, int],
        rate: float,
    ) -> None:
        self.size = size
        self.rate = rate
        seconds = motion.seconds if isinstance(motion, Performance) else options.turn or _USUAL_TURN
        if seconds * self.rate > _MOST_FRAMES:
            raise FacePoserError(
                f"A film of {seconds * self.rate:.0f} frames is too long; at most {_MOST_FRAMES} are written."
            )
        if isinstance(motion, Performance):
            self._turn = options.turn
            self._poses = resampled(motion, self.rate).coefficients
            self.count = len(self._poses)
        else:
            self._turn = seconds
            self._poses = motion[None]
            self.count = max(round(seconds * self.rate), 1)
        self._fixed = None if options.orbit is None or self._turn else options.orbit.camera(self.size)
        if self._fixed is not None:
            return
        shown = np.linspace(0, len(self._poses) - 1, min(len(self._poses), _FRAMED_POSES)).astype(int)
        poses = [model.surface(self._poses[i], options.contact) for i in shown]
        self._view = framed_all_round([model.character.vertices, *poses], self.size).looking(options.view)

    def drawn_by(self, pictures: "_Pictures") -> Callable[[int], Picture]:
        """Return what draws the frame of a number."""
        return lambda frame: pictures.draw(self.pose(frame), self.camera(frame))

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

    def __init__(self, ctx: moderngl.Context, model: FaceModel, options: OutputOptions, size: tuple[int, int]) -> None:
        self._model = model
        self._options = options
        self._renderer = Renderer(ctx)
        self._renderer.set_character(model.character)
        self._target = ColourTarget(ctx, size, min(_SAMPLES, ctx.max_samples))
        self._normals = VertexNormals(model.triangles, len(model.character.vertices))
        self._shown: NDArray[np.float64] | None = None

    def draw(self, pose: NDArray[np.float64], camera: Camera) -> Picture:
        """Return the picture of ``pose``, (r,), under ``camera``, of shape (height, width, 3), or 4 with alpha."""
        if self._shown is None or not np.array_equal(pose, self._shown):
            vertices = self._model.surface(pose, self._options.contact)
            self._renderer.update(vertices, self._normals(vertices))
            self._shown = pose
        options = self._options
        self._renderer.draw(
            self._target.framebuffer,
            camera,
            options.shading,
            expression_lines=options.expression_lines,
            transparent=options.transparent,
        )
        self._target.resolve()
        return self._target.read_transparent() if options.transparent else self._target.read()

    def release(self) -> None:
        """Free what the GPU holds."""
        self._target.release()
        self._renderer.release()


@contextmanager
def _pictures(
    model: FaceModel, options: OutputOptions, size: tuple[int, int], ctx: moderngl.Context | None
) -> Iterator[_Pictures]:
    with ExitStack() as stack:
        context = ctx or stack.enter_context(offscreen_context())
        pictures = _Pictures(context, model, options, size)
        stack.callback(pictures.release)
        yield pictures
