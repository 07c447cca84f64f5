"""Where everything is: menus on top, tools at the left, the face, the panel at the right, a line of text below."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from faceposer.gui.feature import Feature
from faceposer.gui.overlays.constraint_shapes import ShapePainter
from faceposer.gui.overlays.pins import draw_badge, draw_label, draw_overlay
from faceposer.gui.panels.menu_bar import draw_menu_bar
from faceposer.gui.panels.status_bar import draw_status_bar, status_height
from faceposer.gui.panels.tool_bar import STRIP_WIDTH, draw_tool_options, draw_tool_strip
from faceposer.gui.panels.view import draw_output_panel, draw_view_panel
from faceposer.gui.widgets.basic import tooltip
from faceposer.gui.widgets.theme import BAR, GROUND, em

if TYPE_CHECKING:
    from faceposer.gui.app import App

_PANEL_WIDTH = 20.0
_FIXED = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_collapse
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_bring_to_front_on_focus
    | imgui.WindowFlags_.no_nav
)
_BARE = _FIXED | imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse


def draw_window(app: "App") -> None:
    """Lay out and draw all of the window's content."""
    app.marks.clear()
    app.highlighted = None
    width, height = app.window.size
    top = draw_menu_bar(app.actions, app.marks)
    bottom = status_height()
    middle = max(height - top - bottom, 1.0)
    panel = min(round(em(_PANEL_WIDTH)), width // 2) if app.panel_shown else 0
    if panel:
        _draw_panel(app, (width - panel, top), (panel, middle))
    strip = round(em(STRIP_WIDTH)) if app.panel_shown else 0
    if strip:
        _draw_strip(app, (0.0, top), (strip, middle))
    across = max(width - panel - strip, 1)
    strips = app.features.with_strip
    view_height = max(middle - sum(height for _, height in strips), 1.0)
    _draw_view(app, (strip, top), (across, view_height))
    below = top + view_height
    for i, (feature, tall) in enumerate(strips):
        _place((strip, below), (across, tall))
        imgui.push_style_color(imgui.Col_.window_bg, GROUND)
        imgui.begin(f"##strip{i}", None, _BARE)
        feature.draw_strip()
        imgui.end()
        imgui.pop_style_color()
        below += tall
    _place((0.0, height - bottom), (width, bottom))
    imgui.push_style_color(imgui.Col_.window_bg, BAR)
    imgui.begin("##status", None, _BARE)
    draw_status_bar(app)
    imgui.end()
    imgui.pop_style_color()
    app.guide.draw(app)
    app.palette.draw(app)
    if app.importing.open:
        app.import_dialog.draw(app, lambda: _draw_dialogs(app))
    else:
        _draw_dialogs(app)


def _draw_dialogs(app: "App") -> None:
    app.features.draw_dialogs()
    app.dialogs.draw(app.actions, app.viewport.navigation)
    if not app.dialogs.open:
        app.file_dialogs.draw()


def _place(position: tuple[float, float], size: tuple[float, float]) -> None:
    imgui.set_next_window_pos(ImVec2(*position))
    imgui.set_next_window_size(ImVec2(*size))


def _draw_panel(app: "App", position: tuple[float, float], size: tuple[float, float]) -> None:
    _place(position, size)
    imgui.push_style_color(imgui.Col_.window_bg, GROUND)
    imgui.begin("##panel", None, _BARE)
    app.pose_panel.draw_subjects(app)
    imgui.spacing()
    footer = 1.6 * imgui.get_frame_height_with_spacing()
    with _narrow():
        bar = imgui.begin_tab_bar("##tabs")
    if bar:
        for title, draw, text in _tabs(app):
            with _narrow():
                chosen, _ = imgui.begin_tab_item(title)
            app.marks.note(f"tab:{title}")
            tooltip(text)
            if chosen:
                imgui.begin_child(f"##{title}", ImVec2(0.0, -footer))
                draw(app)
                imgui.end_child()
                imgui.end_tab_item()
        imgui.end_tab_bar()
    draw_output_panel(app)
    imgui.end()
    imgui.pop_style_color()


@contextmanager
def _narrow() -> Iterator[None]:
    """Let the titles of all tabs fit into the panel's width: the bar and each of them ask the style."""
    style = imgui.get_style()
    imgui.push_style_var(imgui.StyleVar_.frame_padding, (em(0.45), style.frame_padding.y))
    imgui.push_style_var(imgui.StyleVar_.item_inner_spacing, (em(0.15), style.item_inner_spacing.y))
    yield
    imgui.pop_style_var(2)


def _tabs(app: "App") -> list[tuple[str, Callable[["App"], None], str]]:
    """Return title, content and tooltip of each tab."""

    def content(feature: Feature) -> Callable[["App"], None]:
        return lambda _app: feature.draw_tab()

    return [
        ("Pose", _draw_pose_tab, "How the face follows, and what pulls at it"),
        ("Shapes", app.shapes_panel.draw, "The shapes of the rig, as sliders"),
        *((feature.tab[0], content(feature), feature.tab[1]) for feature in app.features.with_tab if feature.tab),
        ("View", draw_view_panel, "Where one looks from, and how the face is drawn"),
    ]


def _draw_pose_tab(app: "App") -> None:
    app.pose_panel.draw(app)
    draw_tool_options(app)
    app.constraints_panel.draw(app)


def _draw_strip(app: "App", position: tuple[float, float], size: tuple[float, float]) -> None:
    _place(position, size)
    imgui.push_style_color(imgui.Col_.window_bg, GROUND)
    imgui.push_style_var(imgui.StyleVar_.window_padding, (em(0.45), em(0.5)))
    imgui.begin("##strip", None, _BARE)
    imgui.pop_style_var()
    draw_tool_strip(app)
    imgui.end()
    imgui.pop_style_color()


def _draw_view(app: "App", position: tuple[float, float], size: tuple[float, float]) -> None:
    """Show the face and what is drawn over it."""
    _place(position, size)
    imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
    imgui.begin("##view", None, _BARE)
    imgui.pop_style_var()
    first = app.viewport.size == (1, 1)
    app.viewport.place(position, (int(size[0]), int(size[1])), app.window.ui_scale)
    if first:
        app.viewport_placed()
    ratio = app.window.pixels[0] / max(app.window.size[0], 1)
    pixels = (max(round(app.viewport.size[0] * ratio), 1), max(round(app.viewport.size[1] * ratio), 1))
    texture = app.picture(pixels)
    imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(*app.viewport.size), ImVec2(0.0, 1.0), ImVec2(1.0, 0.0))
    imgui.set_cursor_pos(ImVec2(0.0, 0.0))
    buttons = (
        imgui.ButtonFlags_.mouse_button_left
        | imgui.ButtonFlags_.mouse_button_middle
        | imgui.ButtonFlags_.mouse_button_right
    )
    imgui.invisible_button("face", ImVec2(*app.viewport.size), buttons)
    app.marks.note("view")
    draw = imgui.get_window_draw_list()
    app.features.draw_behind(draw)
    if app.comparing:
        draw_badge(draw, app.viewport, "Neutral", 0.0)
    else:
        _draw_constraints(app, draw)
        if app.session.pending:
            draw_badge(draw, app.viewport, "Press Enter to let the face follow the points", 0.0, warm=True)
    app.features.draw_over(draw)
    if app.notice:
        draw_badge(draw, app.viewport, app.notice, 1.0)
    imgui.end()


def _draw_constraints(app: "App", draw: imgui.ImDrawList) -> None:
    toolbox = app.toolbox
    hover = toolbox.hover
    pointed = app.highlighted if hover is None else hover.pin
    shown = app.points_shown or pointed is not None or toolbox.posing
    painter = ShapePainter(draw, app.viewport, toolbox, pointed)
    shapes = app.drawn_constraints.shapes
    if shown:
        painter.paint(shapes, [constraint.enabled for constraint in app.session.document.constraints])
    pins = app.drawn_constraints.pins if shown else []
    draw_overlay(draw, app.viewport, toolbox, pins, pointed)
    painter.paint_begun()
    if pointed is not None and not toolbox.active:
        at = next((pin.handle for pin in pins if pin.index == pointed), None) or shapes.anchor(pointed)
        if at is not None:
            draw_label(draw, app.viewport, at, app.point_name(pointed))
