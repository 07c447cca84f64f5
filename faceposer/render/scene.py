"""Rendering of the face for the window, from coefficients to image; each step runs only if its input has changed."""

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, SurfacePoints, points_on_triangles
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.render.framebuffers import ColourTarget, IdTarget, Size
from faceposer.render.options import Look, Shading
from faceposer.render.renderer import PhotoLayer, Renderer


class Scene:
    """A posed face with its image.

    Attributes:
        vertices: Vertices of the pose, shape (N, 3).
        normals: Their unit normals, shape (N, 3).
        photo: Photo behind or in front of the face, or None.
        expression_lines: True if expression lines of the skin are shown; clay shows none.
        look: Light and backdrop of ``draw``; portraits have the default ones.
        images_rendered: Number of images rendered.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        """Compile the shaders in ``ctx``."""
        self._ctx = ctx
        self._renderer = Renderer(ctx)
        self._ids = IdTarget(ctx)
        self._targets: dict[int, ColourTarget] = {}
        self._model: FaceModel | None = None
        self._normals: VertexNormals | None = None
        self._coefficients: NDArray[np.float64] = np.zeros(0)
        self._contact = True
        self._pose = 0
        self._preview: NDArray[np.float32] | None = None
        self._drawn: tuple[object, ColourTarget] | None = None
        self.vertices: NDArray[np.float32] = np.zeros((0, 3), dtype=np.float32)
        self.normals: NDArray[np.float32] = np.zeros((0, 3), dtype=np.float32)
        self.photo: PhotoLayer | None = None
        self.expression_lines = True
        self.look = Look()
        self.images_rendered = 0

    @property
    def model(self) -> FaceModel | None:
        """The face model shown, or None before the first one."""
        return self._model

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The character's triangles, shape (T, 3)."""
        return self._require_model().triangles

    def set_model(self, model: FaceModel) -> None:
        """Show the neutral face of ``model``."""
        if model is self._model:
            return
        self._renderer.set_character(model.character)
        self._model, self._preview = model, None
        self._normals = VertexNormals(model.triangles, len(model.character.vertices))
        self._set(model, model.neutral())

    def set_pose(self, coefficients: ArrayLike, contact: bool = True) -> None:
        """Show the pose ``coefficients``, shape (r,), with or without the contact step."""
        pose = np.asarray(coefficients, dtype=np.float64)
        if contact != self._contact or not np.array_equal(pose, self._coefficients):
            self._contact = contact
            self._set(self._require_model(), pose)

    def set_preview(self, vertices: NDArray[np.float32] | None) -> None:
        """Show ``vertices``, (N, 3), in place of those of the pose until the model changes; None ends the preview.

        Raises:
            ValueError: If the shape is not that of the model's vertices.
        """
        model = self._require_model()
        if vertices is not None and vertices.shape != model.character.vertices.shape:
            raise ValueError("a preview needs a position for each vertex")
        if vertices is not self._preview:
            self._preview = vertices
            self._set(model, self._coefficients)

    def _set(self, model: FaceModel, pose: NDArray[np.float64]) -> None:
        assert self._normals is not None
        self._coefficients = pose.copy()
        self._pose += 1
        if self._preview is None:
            # The neutral face needs no contact step, which would delay the first image.
            self.vertices = model.surface(pose, self._contact and bool(pose.any()))
        else:
            self.vertices = self._preview
        self.normals = self._normals(self.vertices)
        self._renderer.update(self.vertices, self.normals, self._pose)

    @property
    def character(self) -> Character:
        """The character shown."""
        return self._require_model().character

    def prepare(self) -> None:
        """Prepare in advance the data that the first pose of this face needs."""
        self._renderer.prepare()

    def draw(self, camera: Camera, shading: Shading, wireframe: bool, samples: int) -> moderngl.Texture:
        """Render for ``camera``, bottom row first, with ``samples`` per pixel; 0 for no multisampling."""
        # The vertices of a preview differ from the neutral face by more than the expression.
        lines = self.expression_lines and self._preview is None
        key = (camera, self._pose, shading, wireframe, samples, id(self._model), self.photo, lines, self.look)
        if self._drawn is None or self._drawn[0] != key:
            target = self._target(camera.size, min(samples, self._ctx.max_samples))
            self._renderer.draw(target.framebuffer, camera, shading, wireframe, self.photo, lines, look=self.look)
            target.resolve()
            self._drawn = (key, target)
            self.images_rendered += 1
        return self._drawn[1].texture

    def portrait(self, coefficients: ArrayLike, camera: Camera, samples: int) -> NDArray[np.uint8]:
        """Render another pose, shape (r,), without showing it: (height, width, 3), top row first."""
        return self.portrait_of(self._require_model().surface(coefficients, self._contact), camera, samples)

    def portrait_of(self, vertices: NDArray[np.float32], camera: Camera, samples: int) -> NDArray[np.uint8]:
        """Render other ``vertices``, shape (N, 3), as ``portrait`` does a pose."""
        assert self._normals is not None
        self._renderer.update(vertices, self._normals(vertices))
        target = ColourTarget(self._ctx, camera.size, min(samples, self._ctx.max_samples))
        self._renderer.draw(target.framebuffer, camera, expression_lines=self.expression_lines)
        target.resolve()
        image = target.read()
        target.release()
        self._renderer.update(self.vertices, self.normals, self._pose)
        return image

    def _target(self, size: Size, samples: int) -> ColourTarget:
        target = self._targets.get(samples)
        if target is None or target.size != size:
            if target is not None:
                target.release()
            target = self._targets[samples] = ColourTarget(self._ctx, size, samples)
        return target

    def pick(self, camera: Camera, pixel: tuple[float, float]) -> SurfacePoint | None:
        """Return the visible surface point at ``pixel``, or None."""
        points, _ = self.pick_many(camera, np.array([pixel]))
        point = points[0] if len(points) else None
        return point if isinstance(point, SurfacePoint) else None

    def pick_many(self, camera: Camera, pixels: NDArray[np.float64]) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the visible surface points at ``pixels``, (n, 2), and the mask of pixels that show the face, (n,)."""
        faces = self._visible_triangles(camera, pixels)
        hit = faces >= 0
        return points_on_triangles(self.vertices, self.triangles, faces[hit], camera, pixels[hit]), hit

    def _visible_triangles(self, camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.int64]:
        return self._ids.at(self._renderer, camera, (self._pose, id(self._model)), pixels)

    def facing_away(self, camera: Camera, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return the mask of ``points`` at which the surface faces away from ``camera``, shape (n,)."""
        assert self._normals is not None
        corners = points.corners(self.triangles)
        normals = np.einsum("nk,nkd->nd", points.barycentric, self.normals[corners].astype(np.float64))
        positions = points.positions(self.vertices, self.triangles)
        away: NDArray[np.bool_] = np.einsum("nd,nd->n", normals, positions - camera.center) > 0.0
        return away

    def occluded(self, camera: Camera, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return the mask of ``positions`` in space, shape (n, 3), that the visible surface hides, shape (n,)."""
        if not len(positions):
            return np.zeros(0, dtype=bool)
        faces = self._visible_triangles(camera, camera.project(positions))
        tolerance = 0.02 * float(np.ptp(self._require_model().character.vertices[:, 1]))
        hit = faces >= 0
        hidden = np.zeros(len(positions), dtype=bool)
        corners = self.vertices[self.triangles[faces[hit]]].astype(np.float64)
        nearest = (corners @ camera.rotation[2] + camera.translation[2]).min(axis=1)
        hidden[hit] = camera.to_camera(positions[hit])[:, 2] > nearest + tolerance
        return hidden

    def _require_model(self) -> FaceModel:
        if self._model is None:
            raise RuntimeError("set_model must be called first")
        return self._model

    def release(self) -> None:
        """Free the memory on the GPU."""
        for target in self._targets.values():
            target.release()
        self._ids.release()
        self._renderer.release()
