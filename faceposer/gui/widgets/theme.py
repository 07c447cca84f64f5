"""Colours, fonts and sizes of the dark theme. Lengths are in units of the font size."""

from dataclasses import dataclass

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.resources import fonts_folder

FONT_SIZE = 15.0

Colour = tuple[float, float, float, float]

INK: Colour = (0.89, 0.90, 0.91, 1.0)
FAINT: Colour = (0.58, 0.60, 0.63, 1.0)
GROUND: Colour = (0.118, 0.122, 0.133, 1.0)
BAR: Colour = (0.094, 0.098, 0.106, 1.0)
FIELD: Colour = (0.176, 0.184, 0.200, 1.0)
RAISED: Colour = (0.224, 0.235, 0.255, 1.0)
RAISED_MORE: Colour = (0.278, 0.290, 0.314, 1.0)
EDGE: Colour = (0.043, 0.047, 0.051, 1.0)
ACCENT: Colour = (0.263, 0.663, 0.949, 1.0)
ACCENT_DARK: Colour = (0.137, 0.424, 0.651, 1.0)
ACCENT_MID: Colour = (0.176, 0.514, 0.773, 1.0)
WARNING: Colour = (0.992, 0.714, 0.345, 1.0)
BAD: Colour = (0.953, 0.435, 0.408, 1.0)
TARGET: Colour = (0.376, 0.851, 0.459, 1.0)
KEYED: Colour = (0.965, 0.784, 0.329, 1.0)
HELD: Colour = (0.937, 0.267, 0.267, 1.0)


@dataclass(frozen=True)
class Fonts:
    """The loaded fonts, which include the icons."""

    regular: imgui.ImFont
    bold: imgui.ImFont


class Icon:
    """Characters of Font Awesome 6."""

    CLOSE = "\uf00d"
    CHECK = "\uf00c"
    EYE = "\uf06e"
    EYE_OFF = "\uf070"
    POWER = "\uf011"
    RENAME = "\uf303"
    FOLDER = "\uf07b"
    FILE = "\uf15b"
    UP = "\uf062"
    HOME = "\uf015"
    WARNING = "\uf071"
    UNDO = "\uf2ea"
    LOCK = "\uf023"
    UNLOCK = "\uf3c1"
    POINT = "\uf3c5"
    DISTANCE = "\uf07d"
    STROKE = "\uf1fc"
    CURVE = "\uf55b"
    SKETCH = "\uf304"
    FIX = "\uf08d"
    GAZE = "\uf05b"
    SYMMETRY = "\uf07e"
    PHOTO = "\uf03e"
    CONFLICT = "\uf0e7"
    PLAY = "\uf04b"
    PAUSE = "\uf04c"
    FIRST = "\uf048"
    LAST = "\uf051"
    PREVIOUS = "\uf04a"
    NEXT = "\uf04e"
    LOOP = "\uf363"
    KEY = "\uf219"
    PATH = "\uf4d7"
    LIST = "\uf0d7"
    HEAD = "\uf007"


def u32(colour: Colour, alpha: float = 1.0) -> int:
    """Return ``colour`` for a draw list, with its opacity multiplied by ``alpha``."""
    return imgui.color_convert_float4_to_u32(ImVec4(*colour[:3], colour[3] * alpha))


def em(units: float = 1.0) -> float:
    """Return ``units`` times the current font size, in window units."""
    return units * imgui.get_font_size()


def load_fonts() -> Fonts:
    """Load the fonts of Dear ImGui Bundle.

    Raises:
        FacePoserError: If a font is missing.
    """

    def load(name: str) -> imgui.ImFont:
        for path in (fonts_folder() / name, icons):
            if not paths.is_file(path):
                raise FacePoserError(f"The font '{path}' is missing; reinstall the package imgui-bundle.")
        atlas = imgui.get_io().fonts
        font = atlas.add_font_from_file_ttf(str(fonts_folder() / name), FONT_SIZE)
        merge = imgui.ImFontConfig()
        merge.merge_mode = True
        merge.glyph_offset = imgui.ImVec2(0.0, 1.0)
        atlas.add_font_from_file_ttf(str(icons), FONT_SIZE * 0.87, merge)
        return font

    icons = fonts_folder() / "Font_Awesome_6_Free-Solid-900.otf"
    return Fonts(load("Roboto/Roboto-Regular.ttf"), load("Roboto/Roboto-Bold.ttf"))


def apply_theme(scale: float) -> None:
    """Set the colours, and the sizes multiplied by ``scale``."""
    style = imgui.get_style()
    for name in ("window_rounding", "child_rounding", "tab_rounding"):
        setattr(style, name, 0.0)
    for name in ("frame_rounding", "grab_rounding", "popup_rounding"):
        setattr(style, name, round(4.0 * scale))
    style.window_padding = ImVec2(14.0 * scale, 12.0 * scale)
    style.frame_padding = ImVec2(9.0 * scale, 5.0 * scale)
    style.item_spacing = ImVec2(8.0 * scale, 7.0 * scale)
    style.item_inner_spacing = ImVec2(6.0 * scale, 5.0 * scale)
    style.cell_padding = ImVec2(6.0 * scale, 4.0 * scale)
    style.scrollbar_size = 11.0 * scale
    style.grab_min_size = 12.0 * scale
    style.window_border_size = style.child_border_size = 0.0
    style.popup_border_size = style.frame_border_size = round(1.0 * scale)
    style.frame_border_size = 0.0
    # Smaller than the status bar at the least scale, which would otherwise reach beyond the window.
    style.window_min_size = ImVec2(8.0, 8.0)
    style.window_title_align = ImVec2(0.0, 0.5)
    style.window_menu_button_position = imgui.Dir.none
    style.hover_stationary_delay, style.hover_delay_normal = 0.25, 0.5
    style.disabled_alpha = 0.45
    style.font_size_base = FONT_SIZE
    style.font_scale_dpi = scale
    _apply_colours(style)


def _apply_colours(style: imgui.Style) -> None:
    clear: Colour = (0.0, 0.0, 0.0, 0.0)
    colours: dict[imgui.Col_, Colour] = {
        imgui.Col_.text: INK,
        imgui.Col_.text_disabled: FAINT,
        imgui.Col_.window_bg: GROUND,
        imgui.Col_.child_bg: clear,
        imgui.Col_.popup_bg: (0.145, 0.150, 0.163, 1.0),
        imgui.Col_.border: (0.0, 0.0, 0.0, 0.55),
        imgui.Col_.menu_bar_bg: BAR,
        imgui.Col_.title_bg: BAR,
        imgui.Col_.title_bg_active: BAR,
        imgui.Col_.frame_bg: FIELD,
        imgui.Col_.frame_bg_hovered: RAISED,
        imgui.Col_.frame_bg_active: RAISED_MORE,
        imgui.Col_.button: RAISED,
        imgui.Col_.button_hovered: RAISED_MORE,
        imgui.Col_.button_active: ACCENT_DARK,
        imgui.Col_.header: (*ACCENT_DARK[:3], 0.75),
        imgui.Col_.header_hovered: (*RAISED_MORE[:3], 0.9),
        imgui.Col_.header_active: ACCENT_DARK,
        imgui.Col_.tab: clear,
        imgui.Col_.tab_hovered: RAISED_MORE,
        imgui.Col_.tab_selected: RAISED,
        imgui.Col_.tab_selected_overline: ACCENT,
        imgui.Col_.slider_grab: ACCENT_MID,
        imgui.Col_.slider_grab_active: ACCENT,
        imgui.Col_.check_mark: ACCENT,
        imgui.Col_.checkbox_selected_bg: FIELD,
        imgui.Col_.scrollbar_bg: clear,
        imgui.Col_.scrollbar_grab: RAISED_MORE,
        imgui.Col_.scrollbar_grab_hovered: FAINT,
        imgui.Col_.scrollbar_grab_active: FAINT,
        imgui.Col_.separator: (1.0, 1.0, 1.0, 0.08),
        imgui.Col_.text_selected_bg: (*ACCENT_DARK[:3], 0.8),
        imgui.Col_.modal_window_dim_bg: (0.0, 0.0, 0.0, 0.45),
        imgui.Col_.table_row_bg: clear,
        imgui.Col_.table_row_bg_alt: (1.0, 1.0, 1.0, 0.025),
        imgui.Col_.table_border_light: (1.0, 1.0, 1.0, 0.06),
        imgui.Col_.nav_cursor: ACCENT,
    }
    for index, colour in colours.items():
        style.set_color_(index, ImVec4(*colour))
