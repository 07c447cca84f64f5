"""Framebuffers: the image of the face, optionally multisampled, and the image of triangle indices for picking."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.files.memory import check_memory
from faceposer.geometry.camera import Camera
from faceposer.render.mesh_buffers import is_software_renderer
from faceposer.render.renderer import Renderer

Size = tuple[int, int]
# Pixels from which memory is checked. Bytes of an image and of its copies per pixel, and those of the framebuffer per
# sample, which a software renderer takes from the same memory.
_LARGE, _PER_PIXEL, _PER_SAMPLE = 1 << 22, 24, 8


class ColourTarget:
    """Colour buffer with depth; a multisampled buffer is resolved into ``texture``."""

    def __init__(self, ctx: moderngl.Context, size: Size, samples: int = 0) -> None:
        """Allocate ``size`` pixels with ``samples`` per pixel; 0 for no multisampling.

        Raises:
            FacePoserError: If there is not enough memory.
        """
        pixels = size[0] * size[1]
        if pixels > _LARGE:
            kept = _PER_PIXEL + (_PER_SAMPLE * max(samples, 1) if is_software_renderer(ctx) else 0)
            check_memory(pixels * kept, f"An image of {size[0]} x {size[1]} pixels", "choose a smaller size")
        self.ctx, self.size, self.samples = ctx, size, samples
        self.texture = ctx.texture(size, 4)
        self._depth = ctx.depth_renderbuffer(size)
        self._resolved = ctx.framebuffer([self.texture], self._depth)
        self._multisampled: moderngl.Framebuffer | None = None
        if samples:
            colour = ctx.renderbuffer(size, 4, samples=samples)
            self._multisampled = ctx.framebuffer([colour], ctx.depth_renderbuffer(size, samples=samples))

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """The framebuffer to draw to."""
        return self._multisampled or self._resolved

    def resolve(self) -> None:
        """Copy the multisampled buffer, if there is one, to ``texture``."""
        if self._multisampled is not None:
            self.ctx.copy_framebuffer(self._resolved, self._multisampled)

    def read(self) -> NDArray[np.uint8]:
        """Return the resolved image, top row first, shape (height, width, 3)."""
        data = np.frombuffer(self._resolved.read(components=3, alignment=1), dtype=np.uint8)
        return np.ascontiguousarray(data.reshape(self.size[1], self.size[0], 3)[::-1])

    def read_transparent(self) -> NDArray[np.uint8]:
        """Return the resolved image with straight alpha, top row first, shape (height, width, 4).

        The buffer must have been blended with premultiplied alpha; pixels that nothing covers are black.
        """
        data = np.frombuffer(self._resolved.read(components=4, alignment=1), dtype=np.uint8)
        image = data.reshape(self.size[1], self.size[0], 4)[::-1].copy()
        partial = (image[..., 3] > 0) & (image[..., 3] < 255)
        values = image[partial].astype(np.float32)
        values[:, :3] *= 255.0 / values[:, 3:]
        image[partial] = np.rint(np.minimum(values, 255.0)).astype(np.uint8)
        image[image[..., 3] == 0] = 0
        return image

    def release(self) -> None:
        """Free the memory."""
        for framebuffer in (self._resolved, self._multisampled):
            if framebuffer is not None:
                for attachment in (*framebuffer.color_attachments, framebuffer.depth_attachment):
                    attachment.release()
                framebuffer.release()


class IdTarget:
    """Index of the visible triangle at each pixel, redrawn only if the face or the camera has changed."""

    def __init__(self, ctx: moderngl.Context) -> None:
        """Initialise; memory is allocated on first use."""
        self._ctx = ctx
        self._framebuffer: moderngl.Framebuffer | None = None
        self._key: object = None
        self._ids: NDArray[np.int32] | None = None

    def at(
        self, renderer: Renderer, camera: Camera, revision: object, pixels: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """Return the visible triangles at ``pixels``, shape (n,), -1 where there is none.

        Args:
            renderer: Renderer with the pose.
            camera: The camera.
            revision: Identifies the pose, so that the image is redrawn only for another.
            pixels: Pixels from the top left, shape (n, 2).
        """
        width, height = camera.size
        columns, rows = np.floor(np.clip(pixels, -1.0, 1e6)).astype(np.int64).T
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        faces = np.full(len(inside), -1, dtype=np.int64)
        if not inside.any():
            return faces
        key = (camera, revision)
        if self._ids is None or key != self._key:
            self._draw(renderer, camera)
            self._key = key
        assert self._ids is not None
        faces[inside] = self._ids[height - 1 - rows[inside], columns[inside]] - 1
        return faces

    def _draw(self, renderer: Renderer, camera: Camera) -> None:
        if self._framebuffer is None or self._framebuffer.size != camera.size:
            self.release()
            texture = self._ctx.texture(camera.size, 1, dtype="i4")
            self._framebuffer = self._ctx.framebuffer([texture], self._ctx.depth_renderbuffer(camera.size))
        renderer.draw_ids(self._framebuffer, camera)
        data = self._framebuffer.read(components=1, dtype="i4", alignment=1)
        self._ids = np.frombuffer(data, dtype=np.int32).reshape(camera.size[1], camera.size[0])

    def release(self) -> None:
        """Free the memory."""
        if self._framebuffer is not None:
            for attachment in (*self._framebuffer.color_attachments, self._framebuffer.depth_attachment):
                attachment.release()
            self._framebuffer.release()
            self._framebuffer = self._ids = None
