"""The two faces of key poses: their pictures in the list, and the present pose with its clone."""

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.poses.portraits import Portraits
from faceposer.model.face_model import FaceModel
from faceposer.poses.portrait import portrait_view
from faceposer.render.scene import Scene
from faceposer.session.key_folder import SIDES, Side
from faceposer.session.key_set import KeySet, ListedKey

_SAMPLES = 4


class KeyFaces:
    """Scenes and thumbnails of source and target, which take memory on the GPU until they are released."""

    def __init__(self, context: EditorContext) -> None:
        """Draw in the window of ``context``."""
        self._context = context
        self._scenes: dict[Side, Scene] = {}
        self._portraits: dict[Side, Portraits] = {
            "source": Portraits(context, lambda: self._scene("source")),
            "target": Portraits(context, lambda: self._scene("target")),
        }
        self._poses: dict[Side, NDArray[np.float64]] = {}

    @property
    def waiting(self) -> bool:
        """True if thumbnails are still to be drawn."""
        return any(portraits.waiting for portraits in self._portraits.values())

    def _scene(self, side: Side) -> Scene:
        if side not in self._scenes:
            self._scenes[side] = Scene(self._context.gl)
        return self._scenes[side]

    def show(self, keys: KeySet) -> None:
        """Prepare to draw the faces of ``keys``."""
        for side in SIDES:
            model = keys.models[side]
            if model is None:
                continue
            scene = self._scene(side)
            scene.expression_lines = self._context.settings.expression_lines
            if scene.model is not model:
                self._portraits[side].forget()
                self._poses.pop(side, None)
                scene.set_model(model)

    def thumbnail(self, key: ListedKey, side: Side, pixels: int) -> int | None:
        """Return the texture of one side of ``key``, or None until it is drawn or if there is none."""
        pose = key.poses[side]
        if pose is None or side not in self._scenes:
            return None
        return self._portraits[side].of_pose(pose.tobytes(), lambda: pose, pixels)

    def draw_next(self) -> None:
        """Draw the next thumbnail."""
        for portraits in self._portraits.values():
            if portraits.waiting:
                portraits.draw_next()
                return

    def draw_live(self, side: Side, model: FaceModel, pose: NDArray[np.float64], width: float, steady: bool) -> None:
        """Draw a picture of ``pose`` as an item of Dear ImGui; while ``steady``, the last pose stays."""
        context = self._context
        if not steady or side not in self._poses:
            self._poses[side] = pose
        scene = self._scene(side)
        scene.set_model(model)
        scene.set_pose(self._poses[side], context.session.document.contact)
        pixels = max(round(width * context.pixel_ratio), 1)
        camera = portrait_view(model.character).camera((pixels, pixels))
        texture = scene.draw(camera, context.shading, False, _SAMPLES)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(width, width), ImVec2(0.0, 1.0), ImVec2(1.0, 0.0))

    def release(self) -> None:
        """Release everything."""
        for portraits in self._portraits.values():
            portraits.release()
        for scene in self._scenes.values():
            scene.release()
        self._scenes.clear()
        self._poses.clear()
