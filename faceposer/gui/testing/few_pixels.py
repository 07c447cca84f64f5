"""Frames of a hidden window in a fraction of the time, for tests and scripts that do not look at its pixels."""

from typing import Never

import moderngl

from faceposer.gui.app import App

#: Width and height of the image of the face.
SIZE = (64, 64)
# GL_RASTERIZER_DISCARD: all calls are carried out, but no pixel is filled.
_DISCARD = 0x8C89


def draw_few_pixels(app: App) -> App:
    """Let the frames of ``app`` draw the face in few pixels and the rest in none; nothing else changes.

    Without a graphics card, filling pixels takes most of the time of a frame. ``app.screenshot`` raises RuntimeError.
    """
    draw_panels = app.gui.draw

    def face_image(size: tuple[int, int]) -> moderngl.Texture:
        return app.scene.draw(app.viewport.view.camera(SIZE), app.shading, app.wireframe, 0)

    def draw() -> None:
        app.window.ctx.enable_direct(_DISCARD)
        try:
            draw_panels()
        finally:
            app.window.ctx.disable_direct(_DISCARD)

    def screenshot() -> Never:
        raise RuntimeError("The window draws few pixels: open it with its pictures.")

    app.face_image = face_image  # type: ignore[method-assign]
    app.gui.draw = draw  # type: ignore[method-assign]
    app.screenshot = screenshot  # type: ignore[method-assign]
    return app
