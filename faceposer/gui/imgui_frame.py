"""Dear ImGui in a window: set-up, frames, and recovery from an error within a frame."""

from collections.abc import Callable

from imgui_bundle import imgui, implot

from faceposer.gui.cursors import Cursors
from faceposer.gui.widgets.theme import Fonts, apply_theme, load_fonts
from faceposer.gui.window import Window


class Gui:
    """The context of Dear ImGui that belongs to a window."""

    def __init__(self, window: Window) -> None:
        """Attach to ``window``, after its callbacks are set: the backend calls them after its own.

        Raises:
            FacePoserError: If a font is missing.
        """
        imgui.create_context()
        implot.create_context()
        self.io = imgui.get_io()
        self.io.set_ini_filename(None)
        self.io.config_windows_move_from_title_bar_only = True
        # Messages for programmers over the window; the tests check for these errors.
        self.io.config_debug_highlight_id_conflicts = False
        self.io.config_debug_highlight_id_conflicts_show_item_picker = False
        self.io.config_error_recovery_enable_tooltip = False
        imgui.backends.glfw_init_for_opengl(window.address, True)
        imgui.backends.opengl3_init("#version 330")
        self.cursors = Cursors(window)
        self._scale = 0.0
        self.fonts: Fonts = load_fonts()
        self.set_scale(window.ui_scale)

    def set_scale(self, scale: float) -> None:
        """Scale the interface by ``scale``, relative to a display at normal density."""
        if scale != self._scale:
            self._scale = scale
            apply_theme(scale)

    def frame(self, build: Callable[[], None]) -> Exception | None:
        """Call ``build`` within a frame and return its exception, if any.

        An exception leaves windows, tables or colours open; they are closed here so that later frames do not fail.
        Disabled widgets that it leaves open would make all windows transparent for ever.
        """
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        state = imgui.internal.ErrorRecoveryState()
        imgui.internal.error_recovery_store_state(state)
        opacity = imgui.get_style().alpha
        failure: Exception | None = None
        try:
            build()
        except Exception as error:  # the window must survive any error
            failure = error
            self.io.config_error_recovery_enable_assert = False
            imgui.internal.error_recovery_try_to_recover_state(state)
            self.io.config_error_recovery_enable_assert = True
            imgui.get_style().alpha = opacity
        imgui.render()
        return failure

    def draw(self) -> None:
        """Draw the frame into the framebuffer in use."""
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    @property
    def has_queued_input(self) -> bool:
        """True if events wait for the next frame: of a button pressed and released meanwhile, each gets its own."""
        return bool(imgui.get_current_context().input_events_queue)

    @property
    def popup_open(self) -> bool:
        """True if a menu, a drop-down list or a dialog is open."""
        flags = imgui.PopupFlags_.any_popup.value
        return imgui.is_popup_open("", flags)

    def close_popups(self) -> None:
        """Close menus and drop-down lists, if any is open."""
        # Dear ImGui stops the program where there is none, as before the first frame of a list that was just opened.
        if self.popup_open:
            imgui.internal.close_popup_to_level(0, True)

    def close(self) -> None:
        """Shut down, before the window closes."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        implot.destroy_context()
        imgui.destroy_context()
