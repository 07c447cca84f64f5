"""The face as the window shows it: from coefficients to a picture, each step only when what it needs has changed."""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, barycentric_on_triangle
from faceposer.model.face_model import FaceModel
from faceposer.viewer.renderer import Renderer, Shading
from faceposer.viewer.targets import ColourTarget, IdTarget, Size


class Scene:
    """One face in one picture."""

    def __init__(self, ctx: moderngl.Context) -> None:
        """Compile the shaders in ``ctx``."""
        self._ctx = ctx
        self._renderer = Renderer(ctx)
        self._ids = IdTarget(ctx)
        self._targets: dict[int, ColourTarget] = {}
        self._model: FaceModel | None = None
        self._normals: VertexNormals | None = None
        self._coefficients: NDArray[np.float64] = np.zeros(0)
        self._pose = 0
        self._drawn: tuple[object, ColourTarget] | None = None
        self.vertices: NDArray[np.float32] = np.zeros((0, 3), dtype=np.float32)
        self.pictures_drawn = 0

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The subject's triangles, shape (T, 3)."""
        return self._require_model().triangles

    def set_model(self, model: FaceModel) -> None:
        """Show ``model``, neutral."""
        if model is self._model:
            return
        self._renderer.set_subject(model.subject)
        self._model = model
        self._normals = VertexNormals(model.triangles, len(model.subject.vertices))
        self._set(model, model.neutral())

    def set_pose(self, coefficients: ArrayLike) -> None:
        """Show the pose ``coefficients``, shape (r,)."""
        pose = np.asarray(coefficients, dtype=np.float64)
        if not np.array_equal(pose, self._coefficients):
            self._set(self._require_model(), pose)

    def _set(self, model: FaceModel, pose: NDArray[np.float64]) -> None:
        assert self._normals is not None
        self._coefficients = pose.copy()
        self._pose += 1
        self.vertices = model.instance(pose)
        self._renderer.update(self.vertices, self._normals(self.vertices), self._pose)

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest corner, each (3,), of the neutral face."""
        vertices = self._require_model().subject.vertices
        return vertices.min(axis=0), vertices.max(axis=0)

    def draw(self, camera: Camera, shading: Shading, wireframe: bool, samples: int) -> moderngl.Texture:
        """Return the picture under ``camera``, bottom row first, with ``samples`` per pixel; 0 for no multisampling."""
        key = (camera, self._pose, shading, wireframe, samples, id(self._model))
        if self._drawn is None or self._drawn[0] != key:
            target = self._target(camera.size, min(samples, self._ctx.max_samples))
            self._renderer.draw(target.framebuffer, camera, shading, wireframe)
            target.resolve()
            self._drawn = (key, target)
            self.pictures_drawn += 1
        return self._drawn[1].texture

    def _target(self, size: Size, samples: int) -> ColourTarget:
        target = self._targets.get(samples)
        if target is None or target.size != size:
            if target is not None:
                target.release()
            target = self._targets[samples] = ColourTarget(self._ctx, size, samples)
        return target

    def pick(self, camera: Camera, pixel: tuple[float, float]) -> SurfacePoint | None:
        """Return the point of the visible surface at ``pixel``, or None."""
        face = self._ids.pick(self._renderer, camera, (self._pose, id(self._model)), pixel)
        return None if face < 0 else barycentric_on_triangle(self.vertices, self.triangles, face, camera, pixel)

    def facing_away(self, camera: Camera, faces: Sequence[int]) -> NDArray[np.bool_]:
        """Return which of the triangles ``faces`` turn their back on ``camera``."""
        corners = self.vertices[self.triangles[list(faces)]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        away: NDArray[np.bool_] = np.einsum("nd,nd->n", normals, corners[:, 0] - camera.center) > 0.0
        return away

    def occluded(self, camera: Camera, pixels: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points, at ``pixels`` (n, 2) and ``depths`` (n,) of ``camera``, lie behind the visible face."""
        hidden = np.zeros(len(pixels), dtype=bool)
        tolerance = 0.02 * float(np.ptp(self._require_model().subject.vertices[:, 1]))
        for i, (u, v) in enumerate(pixels.tolist()):
            face = self._ids.pick(self._renderer, camera, (self._pose, id(self._model)), (u, v))
            if face >= 0:
                corners = self.vertices[self.triangles[face]]
                hidden[i] = depths[i] > float(camera.to_camera(corners)[:, 2].min()) + tolerance
        return hidden

    def _require_model(self) -> FaceModel:
        if self._model is None:
            raise RuntimeError("set_model must come first")
        return self._model

    def release(self) -> None:
        """Free what the GPU holds."""
        for target in self._targets.values():
            target.release()
        self._ids.release()
        self._renderer.release()
