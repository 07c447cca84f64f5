"""The picture of the face in the window: drawn only when something in it has changed."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, barycentric_on_triangle
from faceposer.model.face_model import FaceModel
from faceposer.viewer.renderer import Renderer, Shading
from faceposer.viewer.targets import ColourTarget, IdTarget

_SAMPLES = 4


class Scene:
    """The face under one camera, its picture and its triangles for picking."""

    def __init__(self, ctx: moderngl.Context) -> None:
        """Prepare to draw in ``ctx``."""
        self._ctx = ctx
        self._renderer = Renderer(ctx)
        self._ids = IdTarget(ctx)
        self._targets: dict[int, ColourTarget] = {}
        self._model: FaceModel | None = None
        self._normals_of: VertexNormals | None = None
        self._drawn: object = None
        self._posed: object = None
        self.vertices: NDArray[np.float32] = np.zeros((0, 3), dtype=np.float32)
        self.frames_drawn = 0

    def set_model(self, model: FaceModel) -> None:
        """Show another subject from now on."""
        self._model = model
        self._normals_of = VertexNormals(model.triangles, len(model.subject.vertices))
        self._renderer.set_subject(model.subject)
        self._drawn = self._posed = None

    def pose(self, coefficients: NDArray[np.float64], revision: object) -> None:
        """Give the face the pose ``coefficients``, (r,), unless ``revision`` says that it has it."""
        if revision == self._posed:
            return
        assert self._model is not None
        assert self._normals_of is not None
        self.vertices = self._model.instance(coefficients)
        self._renderer.update(self.vertices, self._normals_of(self.vertices), revision)
        self._posed = revision

    def draw(self, camera: Camera, shading: Shading, wireframe: bool, fast: bool) -> moderngl.Texture:
        """Return a picture of the pose under ``camera``; ``fast`` leaves multisampling out."""
        samples = 0 if fast else min(_SAMPLES, self._ctx.max_samples)
        target = self._targets.get(samples)
        if target is None or target.size != camera.size:
            if target is not None:
                target.release()
            target = self._targets[samples] = ColourTarget(self._ctx, camera.size, samples)
            self._drawn = None
        key = (self._posed, camera, shading, wireframe, samples)
        if key != self._drawn:
            self._renderer.draw(target.framebuffer, camera, shading, wireframe)
            target.resolve()
            self._drawn = key
            self.frames_drawn += 1
        return target.texture

    def pick(self, camera: Camera, pixel: tuple[float, float]) -> SurfacePoint | None:
        """Return the point of the face seen at ``pixel`` of ``camera``, or None."""
        face = self._ids.pick(self._renderer, camera, self._posed, pixel)
        if face < 0:
            return None
        assert self._model is not None
        return barycentric_on_triangle(self.vertices, self._model.triangles, face, camera, pixel)

    def occluded(self, camera: Camera, pixels: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points, at ``pixels`` (n, 2) and ``depths`` (n,) of ``camera``, lie behind the visible face."""
        hidden = np.zeros(len(pixels), dtype=bool)
        assert self._model is not None
        tolerance = 0.02 * float(np.ptp(self._model.subject.vertices[:, 1]))
        for i, (pixel, depth) in enumerate(zip(pixels.tolist(), depths.tolist(), strict=True)):
            face = self._ids.pick(self._renderer, camera, self._posed, (pixel[0], pixel[1]))
            if face >= 0:
                corners = self.vertices[self._model.triangles[face]]
                hidden[i] = depth > float(camera.to_camera(corners)[:, 2].min()) + tolerance
        return hidden

    def release(self) -> None:
        """Free what the GPU holds."""
        for target in self._targets.values():
            target.release()
        self._ids.release()
        self._renderer.release()
