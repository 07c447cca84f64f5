"""Colours, sizes and the font of the interface."""

from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.errors import FacePoserError

FONT_SIZE = 15.0
ACCENT = (0.95, 0.62, 0.25)
# Colours of what is drawn over the face: red, green, blue, 0 to 1.
PIN = (0.98, 0.98, 1.0)
PIN_SELECTED = ACCENT
RESIDUAL = (1.0, 0.35, 0.30)


def colour(rgb: tuple[float, float, float], alpha: float = 1.0) -> int:
    """Return a colour as Dear ImGui's draw lists want it."""
    return imgui.color_convert_float4_to_u32(ImVec4(*rgb, alpha))


def apply(scale: float) -> None:
    """Set fonts, sizes and colours for a display of ``scale`` times the normal density.

    Raises:
        FacePoserError: If the interface's font is missing.
    """
    font = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "Roboto" / "Roboto-Regular.ttf"
    if not font.is_file():
        raise FacePoserError(f"The font '{font}' is missing; install imgui-bundle again.")
    io = imgui.get_io()
    io.fonts.clear()
    io.fonts.add_font_from_file_ttf(str(font), FONT_SIZE)
    rescale(scale)


def rescale(scale: float) -> None:
    """Set sizes and colours anew for another density."""
    style = imgui.get_style()
    imgui.style_colors_dark(style)
    # Sizes are set outright: Dear ImGui's own scaling multiplies what a window on another display was scaled to before.
    style.window_padding = ImVec2(12 * scale, 10 * scale)
    style.frame_padding = ImVec2(8 * scale, 4 * scale)
    style.item_spacing = ImVec2(8 * scale, 6 * scale)
    style.item_inner_spacing = ImVec2(6 * scale, 4 * scale)
    style.cell_padding = ImVec2(4 * scale, 3 * scale)
    style.indent_spacing = 20 * scale
    style.window_rounding = 0.0
    style.popup_rounding = 6.0 * scale
    style.frame_rounding = 4.0 * scale
    style.grab_rounding = 4.0 * scale
    style.grab_min_size = 12.0 * scale
    style.window_border_size = 0.0
    style.popup_border_size = 1.0
    style.scrollbar_size = 10.0 * scale
    for name, value in _COLOURS.items():
        style.set_color_(getattr(imgui.Col_, name), ImVec4(*value))
    style.font_scale_dpi = scale


_COLOURS: dict[str, tuple[float, float, float, float]] = {
    "text": (0.90, 0.91, 0.93, 1.0),
    "text_disabled": (0.55, 0.57, 0.60, 1.0),
    "window_bg": (0.115, 0.120, 0.130, 1.0),
    "popup_bg": (0.140, 0.145, 0.157, 0.98),
    "menu_bar_bg": (0.095, 0.100, 0.108, 1.0),
    "border": (0.26, 0.27, 0.29, 1.0),
    "frame_bg": (0.190, 0.198, 0.212, 1.0),
    "frame_bg_hovered": (0.245, 0.255, 0.272, 1.0),
    "frame_bg_active": (0.285, 0.295, 0.315, 1.0),
    "button": (0.220, 0.230, 0.247, 1.0),
    "button_hovered": (0.290, 0.300, 0.322, 1.0),
    "button_active": (0.350, 0.360, 0.385, 1.0),
    "header": (0.245, 0.255, 0.275, 1.0),
    "header_hovered": (0.300, 0.310, 0.335, 1.0),
    "header_active": (0.340, 0.350, 0.378, 1.0),
    "check_mark": (*ACCENT, 1.0),
    "slider_grab": (*ACCENT, 1.0),
    "slider_grab_active": (1.0, 0.72, 0.38, 1.0),
    "separator": (0.22, 0.23, 0.25, 1.0),
    "title_bg_active": (0.160, 0.166, 0.180, 1.0),
    "modal_window_dim_bg": (0.02, 0.02, 0.03, 0.55),
    "text_selected_bg": (0.95, 0.62, 0.25, 0.35),
    "nav_cursor": (0.95, 0.62, 0.25, 0.0),
}
