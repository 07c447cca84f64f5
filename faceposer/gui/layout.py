"""Layout of the window: menus at the top, tools at the left, the side panel at the right, the status bar below."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from faceposer.gui.feature import Feature
from faceposer.gui.overlays.marks import Mark, painted_order
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.overlays.pins import draw_badge, draw_label, draw_overlay
from faceposer.gui.overlays.tool_previews import draw_tool_preview
from faceposer.gui.panels.characters import draw_characters
from faceposer.gui.panels.menu_bar import draw_menu_bar
from faceposer.gui.panels.status_bar import draw_status_bar, status_height
from faceposer.gui.panels.tool_bar import STRIP_WIDTH, draw_tool_options, draw_tool_strip
from faceposer.gui.panels.view import draw_save_buttons, draw_view_panel
from faceposer.gui.shell import Shell
from faceposer.gui.widgets.modal import modals_settle
from faceposer.gui.widgets.theme import BAR, GROUND, em
from faceposer.gui.widgets.tooltips import draw_tooltip, tooltip

_PANEL_WIDTH = 20.0
# Height of the side panel, in units of the font size, below which it has no buttons at its bottom.
_LOW = 12.0
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


def draw_window(context: Shell) -> None:
    """Lay out and draw the content of the window."""
    context.widget_rects.clear()
    context.highlighted = None
    width, height = context.window.size
    top = draw_menu_bar(context.actions, context.widget_rects)
    bottom = status_height()
    middle = max(height - top - bottom, 1.0)
    panel = min(round(em(_PANEL_WIDTH)), width // 2) if context.panel_shown else 0
    if panel:
        _draw_panel(context, (width - panel, top), (panel, middle))
    strip = round(em(STRIP_WIDTH)) if context.panel_shown else 0
    if strip:
        _draw_strip(context, (0.0, top), (strip, middle))
    across = max(width - panel - strip, 1)
    strips = context.features.with_strip
    view_height = max(middle - sum(height for _, height in strips), 1.0)
    _draw_view(context, (strip, top), (across, view_height))
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
    draw_status_bar(context)
    imgui.end()
    imgui.pop_style_color()
    context.features.draw_windows()
    context.palette.draw(context)
    if not context.features.draw_around_dialogs(lambda: _draw_dialogs(context)):
        _draw_dialogs(context)
    draw_tooltip(context.widget_rects)
    if modals_settle():
        context.redraw()


def _draw_dialogs(context: Shell) -> None:
    context.features.draw_dialogs()
    context.dialogs.draw(context.actions, context.viewport.navigation)
    if not context.dialogs.open:
        context.file_dialogs.draw()


def _place(position: tuple[float, float], size: tuple[float, float]) -> None:
    imgui.set_next_window_pos(ImVec2(*position))
    imgui.set_next_window_size(ImVec2(*size))


def _draw_panel(context: Shell, position: tuple[float, float], size: tuple[float, float]) -> None:
    _place(position, size)
    imgui.push_style_color(imgui.Col_.window_bg, GROUND)
    imgui.begin("##panel", None, _BARE)
    draw_characters(context)
    imgui.spacing()
    # In a low window the tabs need the room; the buttons are in the menu, too.
    low = size[1] < em(_LOW)
    footer = 0.0 if low else 1.6 * imgui.get_frame_height_with_spacing()
    with _narrow():
        # Titles are not shortened: the tab bar scrolls if it is too narrow.
        bar = imgui.begin_tab_bar("##tabs", imgui.TabBarFlags_.fitting_policy_scroll.value)
    if bar:
        for title, draw, text in _tabs(context):
            flags = imgui.TabItemFlags_.set_selected.value if title == context.wanted_tab else 0
            with _narrow():
                chosen, _ = imgui.begin_tab_item(title, None, flags)
            context.widget_rects.record(f"tab:{title}")
            tooltip(f"{title}\n{text}")
            if chosen:
                imgui.begin_child(f"##{title}", ImVec2(0.0, -footer))
                draw(context)
                imgui.end_child()
                imgui.end_tab_item()
        imgui.end_tab_bar()
        context.wanted_tab = ""
    if not low:
        draw_save_buttons(context)
    imgui.end()
    imgui.pop_style_color()


@contextmanager
def _narrow() -> Iterator[None]:
    """Reduce the padding of tabs, so that all titles fit; both the bar and each tab read the style."""
    style = imgui.get_style()
    imgui.push_style_var(imgui.StyleVar_.frame_padding, (em(0.2), style.frame_padding.y))
    imgui.push_style_var(imgui.StyleVar_.item_inner_spacing, (em(0.05), style.item_inner_spacing.y))
    yield
    imgui.pop_style_var(2)


def _tabs(context: Shell) -> list[tuple[str, Callable[[Shell], None], str]]:
    """Return title, content and tooltip of each tab."""

    def content(feature: Feature) -> Callable[[Shell], None]:
        def draw(context: Shell) -> None:
            # Above the tab's own content, which may be long.
            if feature.traced and context.toolbox.chosen.traces_photos:
                _draw_chosen_tool(context)
                imgui.separator()
            feature.draw_tab()

        return draw

    return [
        ("Pose", _draw_pose_tab, "Solver settings, tool options and constraints"),
        ("Shapes", context.shapes_panel.draw, "Sliders for the shapes of the character"),
        *((feature.tab[0], content(feature), feature.tab[1]) for feature in context.features.with_tab if feature.tab),
        ("View", draw_view_panel, "View directions and display options"),
    ]


def _draw_pose_tab(context: Shell) -> None:
    context.pose_panel.draw(context)
    _draw_chosen_tool(context)


def _draw_chosen_tool(context: Shell) -> None:
    """Draw the options of the chosen tool, and the constraints."""
    if not context.features.draw_tool_options(context.toolbox.chosen.name):
        draw_tool_options(context)
    context.constraints_panel.draw(context)


def _draw_strip(context: Shell, position: tuple[float, float], size: tuple[float, float]) -> None:
    _place(position, size)
    imgui.push_style_color(imgui.Col_.window_bg, GROUND)
    imgui.push_style_var(imgui.StyleVar_.window_padding, (em(0.45), em(0.5)))
    # The wheel scrolls to the tools that a low window has no room for.
    imgui.begin("##strip", None, _FIXED | imgui.WindowFlags_.no_scrollbar)
    imgui.pop_style_var()
    draw_tool_strip(context)
    imgui.end()
    imgui.pop_style_color()


def _draw_view(context: Shell, position: tuple[float, float], size: tuple[float, float]) -> None:
    """Draw the face and its overlays."""
    _place(position, size)
    imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
    imgui.begin("##view", None, _BARE)
    imgui.pop_style_var()
    first = context.viewport.size == (1, 1)
    context.viewport.place(position, (int(size[0]), int(size[1])), context.window.ui_scale)
    if first:
        context.viewport_placed()
    ratio = context.window.pixels[0] / max(context.window.size[0], 1)
    pixels = (max(round(context.viewport.size[0] * ratio), 1), max(round(context.viewport.size[1] * ratio), 1))
    texture = context.face_image(pixels)
    imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(*context.viewport.size), ImVec2(0.0, 1.0), ImVec2(1.0, 0.0))
    imgui.set_cursor_pos(ImVec2(0.0, 0.0))
    buttons = (
        imgui.ButtonFlags_.mouse_button_left
        | imgui.ButtonFlags_.mouse_button_middle
        | imgui.ButtonFlags_.mouse_button_right
    )
    imgui.invisible_button("face", ImVec2(*context.viewport.size), buttons)
    context.widget_rects.record("view")
    draw = imgui.get_window_draw_list()
    context.features.draw_behind(draw)
    if context.comparing:
        draw_badge(draw, context.viewport, "Neutral", 0.0)
    else:
        _draw_constraints(context, draw)
        if context.session.pending and context.session.mode == "apply":
            draw_badge(draw, context.viewport, _pending_text(context), 0.0, warm=True)
    context.features.draw_over(draw)
    if context.notice:
        draw_badge(draw, context.viewport, context.notice, 1.0)
    imgui.end()


def _pending_text(context: Shell) -> str:
    key = context.actions["apply"].shortcut
    return f"Press {key or 'Apply'} to solve the constraints"


def _draw_constraints(context: Shell, draw: imgui.ImDrawList) -> None:
    toolbox = context.toolbox
    hover = toolbox.hover
    pointed = context.highlighted if hover is None else hover.pin
    shown = context.points_shown or pointed is not None or toolbox.posing
    painter = Painter(draw, context.viewport, toolbox.selection | ({pointed} if pointed is not None else set()))
    hidden = context.drawn_constraints.hidden.indices(context.session.document.constraints) - {pointed}
    marks = {i: mark for i, mark in context.drawn_constraints.marks.items() if i not in hidden}
    if shown:
        _paint_marks(context, painter, marks)
    pins = [pin for pin in context.drawn_constraints.pins if pin.index not in hidden] if shown else []
    draw_overlay(draw, context.viewport, toolbox, pins, pointed)
    draw_tool_preview(painter, context.viewport, toolbox)
    if pointed is not None and not toolbox.active:
        at = next((pin.handle for pin in pins if pin.index == pointed), None) or (
            marks[pointed].anchor if pointed in marks else None
        )
        if at is not None:
            draw_label(draw, context.viewport, at, context.point_name(pointed))


def _paint_marks(context: Shell, painter: Painter, marks: dict[int | None, Mark]) -> None:
    """Draw ``marks``; disabled constraints are faint, and others are dimmed while some are highlighted."""
    constraints = context.session.document.constraints
    order = sorted((i for i in marks if i is not None), key=lambda i: painted_order(constraints[i].kind))
    for i in order:
        dimmed = 1.0 if i in painter.highlighted or not painter.highlighted else 0.8
        marks[i].paint(painter, (1.0 if constraints[i].enabled else 0.35) * dimmed)
    if None in marks:
        marks[None].paint(painter, 1.0)
