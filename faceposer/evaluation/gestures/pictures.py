"""Images of gestures: before and after, sheets of all gestures of a character, and expressions without captions."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from faceposer.evaluation.gestures.gesture import Gesture, Pull
from faceposer.evaluation.gestures.hand import Drawn, Performed, place_vertex
from faceposer.geometry.camera import VIEW_ANGLES, Camera, OrbitView, ViewName
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character import Character
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.offscreen import offscreen_context
from faceposer.render.renderer import Renderer

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

# Feature points that every image shows: chin, hairline and temples.
_FRAME = ("2.1", "11.1", "4.5", "4.6")
# Margins above and below as a share of that height: brows rise and the jaw drops.
_ABOVE, _BELOW = 0.0, 0.16
_ZOOM = 1.25
# Supersampling factor in each direction.
_SUPERSAMPLING = 2
_PULL: Colour = (255, 196, 0)
_PAPER: Colour = (24, 25, 27)
_INK: Colour = (225, 226, 228)
_MISSED: Colour = (255, 120, 110)
_LABEL = 30
_GAP = 4
_QUALITY = 82


class Studio:
    """Renderer of images of one character."""

    def __init__(self, character: Character, renderer: Renderer, target: ColourTarget, size: int) -> None:
        """Initialise for square images of ``character``, ``size`` pixels wide."""
        self.character = character
        self.size = size
        self._renderer, self._target = renderer, target
        self._normals = VertexNormals(character.triangles, len(character.vertices))

    def camera(self, view: ViewName, places: Sequence[str] = ()) -> Camera:
        """Return the camera that frames the face and ``places`` from ``view``."""
        points = self.character.feature_points
        ids = [points[key] for key in _FRAME if key in points] + [place_vertex(self.character, p) for p in places]
        framed = self.character.vertices[ids] if ids else self.character.vertices
        low, high = framed.min(axis=0).astype(np.float64), framed.max(axis=0).astype(np.float64)
        height = high[1] - low[1]
        low[1] -= _BELOW * height
        high[1] += _ABOVE * height
        excess = 0.5 * max((high[0] - low[0]) - (high[1] - low[1]), 0.0)
        low[1] -= excess
        high[1] += excess
        yaw, pitch = np.radians(VIEW_ANGLES[view]).tolist()
        orbit = replace(OrbitView.preset(low, high), yaw=yaw, pitch=pitch).zoomed(_ZOOM)
        return orbit.camera((_SUPERSAMPLING * self.size, _SUPERSAMPLING * self.size))

    def draw(self, vertices: NDArray[np.float32], camera: Camera) -> Image.Image:
        """Render the pose ``vertices``, shape (N, 3)."""
        positions = np.ascontiguousarray(vertices, dtype=np.float32)
        self._renderer.update(positions, self._normals(positions))
        self._renderer.draw(self._target.framebuffer, camera)
        self._target.resolve()
        return Image.fromarray(self._target.read()).reduce(_SUPERSAMPLING)

    def before(self, gesture: Gesture) -> Image.Image:
        """Render the neutral face in the first view of ``gesture``."""
        return self.draw(self.character.vertices, self.camera(gesture.view, _pulled_places(gesture)))

    def after(self, performed: Performed, arrows: bool = True) -> Image.Image:
        """Render the face after a gesture, with ``arrows`` for its drags and strokes."""
        camera = self.camera(performed.gesture.view, _pulled_places(performed.gesture))
        image = self.draw(performed.vertices, camera)
        if arrows:
            pen = ImageDraw.Draw(image)
            for drawn in performed.drawn:
                self._mark(pen, drawn, camera)
        return image

    def _mark(self, pen: ImageDraw.ImageDraw, drawn: Drawn, camera: Camera) -> None:
        """Draw the arrow of a pull, or the two lines of a stroke, in the image of ``camera``."""
        depth = self._depth(drawn)
        source, target = (
            _reprojected(points, depth, drawn.camera, camera) / _SUPERSAMPLING
            for points in (drawn.source, drawn.target)
        )
        if len(source) > 1:
            pen.line([tuple(p) for p in source.tolist()], _INK, 1)
            pen.line([tuple(p) for p in target.tolist()], _PULL, 2)
            return
        _arrow(pen, source[0], target[0], self.size / 32.0)

    def _depth(self, drawn: Drawn) -> float:
        """Return the depth of the face at ``drawn``, in its camera."""
        if drawn.vertex is not None:
            return float(drawn.camera.to_camera(self.character.vertices[[drawn.vertex]])[0, 2])
        pixels = drawn.camera.project(self.character.vertices)
        nearest = int(np.argmin(np.linalg.norm(pixels - drawn.source.mean(axis=0), axis=1)))
        return float(drawn.camera.to_camera(self.character.vertices[[nearest]])[0, 2])


@contextmanager
def studio(character: Character, size: int = 480) -> Iterator[Studio]:
    """Yield a studio for square images of ``character``, ``size`` pixels wide.

    Raises:
        FacePoserError: If the system has no OpenGL through EGL.
    """
    with offscreen_context() as ctx:
        renderer = Renderer(ctx)
        renderer.set_character(character)
        target = ColourTarget(ctx, (_SUPERSAMPLING * size, _SUPERSAMPLING * size), 0)
        try:
            yield Studio(character, renderer, target, size)
        finally:
            target.release()
            renderer.release()


@dataclass(frozen=True, eq=False)
class Cell:
    """An image on a sheet with its caption.

    Attributes:
        picture: The image.
        label: The caption, or "".
        good: True if all limits hold.
    """

    picture: Image.Image
    label: str
    good: bool = True


def sheet(cells: Sequence[Cell], columns: int, side: int) -> Image.Image:
    """Arrange the ``cells`` in rows of ``columns``, each ``side`` pixels wide, with captions below if there are any."""
    label = _LABEL if any(cell.label for cell in cells) else 0
    rows = -(-len(cells) // columns)
    size = (columns * (side + _GAP) + _GAP, rows * (side + label + _GAP) + _GAP)
    page = Image.new("RGB", size, _PAPER)
    pen = ImageDraw.Draw(page)
    font = ImageFont.load_default(12)
    for i, cell in enumerate(cells):
        x, y = _GAP + i % columns * (side + _GAP), _GAP + i // columns * (side + label + _GAP)
        page.paste(cell.picture.resize((side, side), Image.Resampling.LANCZOS), (x, y))
        for line, text in enumerate(_wrapped(cell.label, font, side - 4)):
            pen.text((x + 2, y + side + 14 * line), text, _INK if cell.good else _MISSED, font)
    return page


def beside(before: Image.Image, after: Image.Image) -> Image.Image:
    """Return the two images side by side."""
    return sheet([Cell(before, ""), Cell(after, "")], 2, before.width)


def write_jpeg(path: Path, picture: Image.Image) -> None:
    """Write ``picture`` as a compact JPEG, creating parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.save(path, quality=_QUALITY, optimize=True, progressive=True)


def _pulled_places(gesture: Gesture) -> list[str]:
    return [action.place for action in gesture.actions if isinstance(action, Pull)]


def _reprojected(pixels: Array, depth: float, camera: Camera, other: Camera) -> Array:
    """Return the pixels in ``other`` of the points at ``pixels``, shape (n, 2), and ``depth`` in ``camera``."""
    local = np.column_stack([(pixels - camera.principal_point) * depth / camera.focal, np.full(len(pixels), depth)])
    return other.project((local - camera.translation) @ camera.rotation)


def _arrow(pen: ImageDraw.ImageDraw, begin: Array, end: Array, head: float) -> None:
    """Draw an arrow, or a dot if both ends coincide."""
    length = float(np.hypot(*(end - begin)))
    if length < 1.0:
        pen.ellipse([*(begin - head / 2), *(begin + head / 2)], _PULL)
        return
    along = (end - begin) / length
    across = np.array([-along[1], along[0]])
    neck = end - along * min(head, length)
    pen.line([tuple(begin.tolist()), tuple(neck.tolist())], _PULL, max(round(head / 4), 2))
    corners = [end, neck + across * head / 2, neck - across * head / 2]
    pen.polygon([tuple(corner.tolist()) for corner in corners], _PULL)


def _wrapped(text: str, font: ImageFont.ImageFont | ImageFont.FreeTypeFont, width: int) -> list[str]:
    """Wrap ``text`` to lines of ``width`` pixels, at most two."""
    lines: list[str] = []
    for word in text.split():
        joined = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(joined) <= width:
            lines[-1] = joined
        else:
            lines.append(word)
    return lines[:2]
