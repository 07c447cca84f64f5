"""Images and videos of posed faces, rendered frame by frame to files."""

from collections.abc import Generator, Iterator
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
from faceposer.render.film import MAX_GIF_RATE, Pixels, RenderFrame, write_gif, write_mp4
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.images import write_png
from faceposer.render.offscreen import offscreen_context
from faceposer.render.options import OutputOptions
from faceposer.render.renderer import Renderer
from faceposer.render.turntable import orbit_framing, turned

_GIF_RATE, _VIDEO_RATE = 25.0, 30.0
_SAMPLES = 4
# Duration of a turn around a single pose, in seconds.
_DEFAULT_TURN = 4.0
_MAX_FRAMES = 100_000
# All frames of a GIF are in memory at once, one byte per pixel.
_MAX_GIF_PIXELS = 2_000_000_000
# Number of poses that determine the distance of the camera of a performance.
_FRAMED_POSES = 24


def picture_steps(
    path: Path,
    model: FaceModel,
    pose: NDArray[np.float64],
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write a pose as a PNG image, yielding 1 at the end.

    Args:
        path: The file.
        model: The face.
        pose: The pose, shape (r,).
        options: Output options.
        ctx: OpenGL context; None to create one.

    Raises:
        FacePoserError: If the file cannot be written, or there is no OpenGL.
    """
    with _pose_renderer(model, options, options.size, ctx) as renderer:
        view = options.orbit or face_view(model.character, options.view, options.size[0] / options.size[1])
        write_png(path, renderer.render(pose, view.camera(options.size)))
    yield 1.0


def picture_sequence_steps(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write each frame of ``performance`` as a PNG image, yielding the completed share after each.

    The files are named by the folder and the frame number, from 1, such as smile.0001.png. The folder appears once all
    files are written, and not at all if the iterator is closed early.

    Args:
        folder: New or empty folder.
        model: The face.
        performance: Performance, played once; the camera turns meanwhile if ``options.turn`` is set.
        options: Output options.
        ctx: OpenGL context; None to create one.

    Raises:
        FacePoserError: If there are too many frames, the folder is not empty or cannot be written, or there is no
            OpenGL.
    """
    shot = _Shot(model, performance, options, options.size, options.rate or performance.rate)
    digits = max(4, len(str(shot.count)))
    with atomic_folder(folder) as temporary, _pose_renderer(model, options, shot.size, ctx) as renderer:
        render = shot.frame_renderer(renderer)
        for frame in range(shot.count):
            write_png(temporary / f"{folder.name}.{frame + 1:0{digits}}.png", render(frame))
            yield (frame + 1) / shot.count


def usual_rate(suffix: str, animation: float | None) -> float:
    """Return the frame rate of a video with this ``suffix``: that of the ``animation``, if any, and at most 25 in GIF.

    Args:
        suffix: ".gif" or another one.
        animation: Frames per second of the animation; None for a turntable of a pose.
    """
    if suffix.lower() == ".gif":
        return _GIF_RATE if animation is None else min(animation, _GIF_RATE)
    return _VIDEO_RATE if animation is None else animation


def gif_steps(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write a video as GIF, yielding the completed share after each frame; closing the iterator cancels.

    The camera turns once around a pose. A performance is played once; the camera turns meanwhile if ``options.turn`` is
    set.

    Args:
        path: The file.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: Output options.
        ctx: OpenGL context; None to create one.

    Raises:
        FacePoserError: If the video would be too long or too large, the file cannot be written, or there is no OpenGL.
    """
    width, height = options.size
    rate = options.rate or usual_rate(path.suffix, motion.rate if isinstance(motion, Performance) else None)
    shot = _Shot(model, motion, options, (width, height), min(rate, MAX_GIF_RATE))
    if shot.count * width * height > _MAX_GIF_PIXELS:
        raise FacePoserError(
            f"A GIF of {shot.count} frames of {width}x{height} is too large; write an .mp4, or fewer or smaller frames."
        )
    with _pose_renderer(model, options, shot.size, ctx) as renderer:
        yield from write_gif(path, shot.frame_renderer(renderer), shot.count, shot.rate)


def mp4_steps(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    options: OutputOptions,
    ctx: moderngl.Context | None = None,
) -> Generator[float, None, None]:
    """Write a video as MP4; arguments and steps are those of ``gif_steps``.

    Raises:
        FacePoserError: If the video would be too long, the file cannot be written, or there is no OpenGL or no ffmpeg.
    """
    # MP4 stores colours at half the resolution, so that both sides must be even.
    size = (max(options.size[0] // 2, 1) * 2, max(options.size[1] // 2, 1) * 2)
    rate = options.rate or usual_rate(path.suffix, motion.rate if isinstance(motion, Performance) else None)
    shot = _Shot(model, motion, options, size, rate)
    find_ffmpeg()
    with _pose_renderer(model, options, shot.size, ctx) as renderer:
        yield from write_mp4(path, shot.frame_renderer(renderer), shot.count, shot.rate, shot.size)


class _Shot:
    """Pose and camera of each frame of a video.

    Attributes:
        size: Width and height of the frames, in pixels.
        rate: Frames per second.
        count: Number of frames.
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
        seconds = motion.seconds if isinstance(motion, Performance) else options.turn or _DEFAULT_TURN
        if seconds * self.rate > _MAX_FRAMES:
            raise FacePoserError(
                f"A video of {seconds * self.rate:.0f} frames is too long; the limit is {_MAX_FRAMES} frames."
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
        framed = np.linspace(0, len(self._poses) - 1, min(len(self._poses), _FRAMED_POSES)).astype(int)
        poses = [model.surface(self._poses[i], options.contact) for i in framed]
        self._view = orbit_framing([model.character.vertices, *poses], self.size).looking(options.view)

    def frame_renderer(self, renderer: "_PoseRenderer") -> RenderFrame:
        """Return the function that renders the frame with a given index."""
        return lambda frame: renderer.render(self.pose(frame), self.camera(frame))

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


class _PoseRenderer:
    """Renderer for poses of one face at one size."""

    def __init__(self, ctx: moderngl.Context, model: FaceModel, options: OutputOptions, size: tuple[int, int]) -> None:
        self._model = model
        self._options = options
        self._renderer = Renderer(ctx)
        self._renderer.set_character(model.character)
        self._target = ColourTarget(ctx, size, min(_SAMPLES, ctx.max_samples))
        self._normals = VertexNormals(model.triangles, len(model.character.vertices))
        self._uploaded: NDArray[np.float64] | None = None

    def render(self, pose: NDArray[np.float64], camera: Camera) -> Pixels:
        """Render ``pose``, shape (r,), as an image of shape (height, width, 3), or with 4 channels if transparent."""
        if self._uploaded is None or not np.array_equal(pose, self._uploaded):
            vertices = self._model.surface(pose, self._options.contact)
            self._renderer.update(vertices, self._normals(vertices))
            self._uploaded = pose
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
        """Free the memory on the GPU."""
        self._target.release()
        self._renderer.release()


@contextmanager
def _pose_renderer(
    model: FaceModel, options: OutputOptions, size: tuple[int, int], ctx: moderngl.Context | None
) -> Iterator[_PoseRenderer]:
    with ExitStack() as stack:
        context = ctx or stack.enter_context(offscreen_context())
        renderer = _PoseRenderer(context, model, options, size)
        stack.callback(renderer.release)
        yield renderer
