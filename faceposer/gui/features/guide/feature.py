"""The guided pose in the window: a card in a corner of the view, and a ring on the face that shows where to press."""

from collections.abc import Sequence

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.actions import Action, Actions, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.guide.steps import CLOSING_TEXT, STEPS, Guide, Observation, Step, feature_heights
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.theme import ACCENT, EDGE, FAINT, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import Rectangle

_WIDTH, _HEIGHT, _MARGIN = 18.0, 16.0, 0.9
_WHITE = (1.0, 1.0, 1.0, 1.0)
# Pixels at normal density.
_RING, _ARROW = 13.0, 34.0
# Stride of the vertices that are projected to find the head in the view.
_STRIDE = 7
_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_scrollbar
    | imgui.WindowFlags_.no_scroll_with_mouse
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)


class GuideFeature(Feature):
    """The guided pose, shown at the first start and from the Help menu."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self._guide: Guide | None = None if context.settings.welcome_done else Guide()
        self._key: object = None
        self._rectangle: Rectangle | None = None
        self._height = 0.0

    @property
    def shown(self) -> bool:
        """True while the guided pose is shown."""
        return self._guide is not None

    @property
    def step(self) -> Step | None:
        """The current step, or None."""
        return self._guide.current if self._guide is not None else None

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the Help menu."""
        return (
            Action(
                "guide",
                "Guided pose",
                "Help",
                self.show,
                help="Make a first smile in five steps; marks in the view show where to press",
            ),
        )

    def show(self) -> None:
        """Start from the first step."""
        self._guide, self._key = Guide(), None

    def dismiss(self) -> None:
        """Close the guided pose."""
        self._guide = self._rectangle = None

    def contains(self, position: Pixel) -> bool:
        """Return True if a position in the window is on the card."""
        if self._rectangle is None:
            return False
        left, top, right, bottom = self._rectangle
        return left <= position[0] < right and top <= position[1] < bottom

    def cancel(self) -> bool:
        """Close the guided pose; return True if it was shown."""
        shown = self.shown
        self.dismiss()
        return shown

    def late_update(self) -> None:
        """Check which steps the user has done."""
        context = self.context
        session = context.session
        if self._guide is None or context.busy or session.solving:
            return
        key = (session, session.revision, context.viewport.view, context.meshes_saved)
        if key == self._key:
            return
        self._key = key
        heights, held = feature_heights(session)
        direction = (context.viewport.view.yaw, context.viewport.view.pitch)
        if self._guide.update(Observation(session, heights, held, direction, session.can_redo, context.meshes_saved)):
            context.redraw()

    def draw_window(self) -> None:
        """Draw the card and the ring."""
        context = self.context
        self._rectangle = None
        if self._guide is None:
            return
        if not context.settings.welcome_done:
            # Written at once: a window that is ended from outside writes nothing at its end.
            context.settings.welcome_done = True
            context.save_settings()
        viewport = context.viewport
        width = min(em(_WIDTH), viewport.size[0] - 2.0 * em(_MARGIN))
        left, top = viewport.origin[0] + em(_MARGIN), viewport.origin[1] + em(_MARGIN)
        height = self._height or em(_HEIGHT)
        head = viewport.camera.project(context.scene.vertices[::_STRIDE]) + viewport.origin
        # A photo is not covered, either.
        free = context.scene.photo is None and _is_free(head, (left, top, left + width, top + height), em(0.6))
        if free:
            self._draw_card((left, top), width)
        elif not context.notice:
            self._draw_strip()
        if self._guide is not None and not (context.toolbox.active or context.comparing or context.is_modal):
            self._draw_ring(head)

    def _begin(self, position: Pixel, size: Pixel) -> None:
        imgui.set_next_window_pos(ImVec2(*position))
        imgui.set_next_window_size(ImVec2(*size))
        imgui.push_style_color(imgui.Col_.window_bg, ImVec4(0.145, 0.150, 0.163, 0.96))
        imgui.push_style_var(imgui.StyleVar_.window_rounding, em(0.4))
        imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(em(0.9), em(0.65)))
        imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1.0, 1.0))
        imgui.begin("##guide", None, _FLAGS)
        imgui.pop_style_var(4)
        imgui.pop_style_color()
        corner, extent = imgui.get_window_pos(), imgui.get_window_size()
        self._rectangle = (corner.x, corner.y, corner.x + extent.x, corner.y + extent.y)

    def _draw_card(self, position: Pixel, width: float) -> None:
        """Draw all steps, the current one with its explanation."""
        context = self.context
        guide = self._guide
        assert guide is not None
        self._begin(position, (width, self._height or em(_HEIGHT)))
        imgui.push_font(context.fonts.bold, 0.0)
        imgui.text_unformatted("Your first pose")
        imgui.pop_font()
        imgui.same_line()
        closed = self._close_button()
        imgui.dummy(ImVec2(0.0, em(0.05)))
        for number, step in enumerate(STEPS, 1):
            _draw_step(context, number, step, step.name in guide.done, step is guide.current)
        if guide.current is None:
            imgui.dummy(ImVec2(0.0, em(0.1)))
            imgui.text_wrapped(_with_keys(CLOSING_TEXT, context.actions))
        label = "Skip" if guide.current is not None else "Close"
        imgui.dummy(ImVec2(0.0, em(0.1)))
        across = imgui.calc_text_size(label).x + 2.0 * imgui.get_style().frame_padding.x
        imgui.set_cursor_pos_x(imgui.get_window_width() - em(0.9) - across)
        closed = imgui.button(f"{label}##guide") or closed
        context.widget_rects.record("guide:skip")
        if guide.current is not None:
            tooltip("Close; Help > Guided pose shows it again  (Esc)")
        self._height = imgui.get_cursor_pos_y() - imgui.get_style().item_spacing.y + em(0.65)
        imgui.end()
        if closed:
            self.dismiss()
            context.redraw()

    def _draw_strip(self) -> None:
        """Draw the current step as one line at the bottom of the view, if the face leaves no room for the card."""
        context = self.context
        guide, viewport = self._guide, context.viewport
        assert guide is not None
        step = guide.current
        text = _with_keys(CLOSING_TEXT, context.actions) if step is None else _with_keys(step.title, context.actions)
        count = "" if step is None else f"{STEPS.index(step) + 1}/{len(STEPS)}"
        margin = em(0.5)
        room = viewport.size[0] - 2.0 * margin
        lead = imgui.calc_text_size(count).x + em(0.6) if count else 0.0
        wrap = room - em(1.8) - em(1.6) - lead
        extent = imgui.calc_text_size(text, wrap_width=wrap)
        width = min(lead + extent.x + em(1.8) + em(1.8), room)
        height = extent.y + em(1.3)
        left = viewport.origin[0] + round((viewport.size[0] - width) / 2.0)
        top = viewport.origin[1] + viewport.size[1] - margin - height
        self._begin((left, top), (width, height))
        if count:
            imgui.text_colored(ACCENT, count)
            imgui.same_line(0.0, em(0.6))
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + wrap + 1.0)
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        if step is not None:
            tooltip(_with_keys(step.text, context.actions))
        imgui.same_line()
        closed = self._close_button()
        imgui.end()
        if closed:
            self.dismiss()
            context.redraw()

    def _close_button(self) -> bool:
        """Draw a close button at the right end of the line; return True if it was pressed."""
        context = self.context
        side = em(1.3)
        imgui.set_cursor_pos(ImVec2(imgui.get_window_width() - side - em(0.45), imgui.get_cursor_pos_y() - em(0.15)))
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, 0.0))
        pressed = imgui.button(f"{Icon.CLOSE}##guide", ImVec2(side, side))
        imgui.pop_style_var()
        imgui.pop_style_color()
        context.widget_rects.record("guide:close")
        tooltip("Close; Help > Guided pose shows it again  (Esc)")
        return pressed

    def _draw_ring(self, head: np.ndarray) -> None:
        """Draw a ring where to press, and an arrow in the direction of the drag."""
        context = self.context
        step = self.step
        aim = None if step is None else _aim(context, step, head)
        if aim is None or self.contains(aim[0]):
            return
        imgui.begin("##view")
        draw, scale = imgui.get_window_draw_list(), context.viewport.ui_scale
        for colour, thickness in ((u32(EDGE, 0.65), 4.5 * scale), (u32(_WHITE, 0.95), 2.0 * scale)):
            draw.add_circle(aim[0], _RING * scale, colour, 0, thickness)
            _draw_arrow(draw, aim[0], aim[1], scale, colour, thickness)
        imgui.end()


def _is_free(head: np.ndarray, rectangle: Rectangle, margin: float) -> bool:
    """Return True if no pixel of ``head``, shape (n, 2), is in ``rectangle`` or within ``margin`` of it."""
    low = np.array(rectangle[:2]) - margin
    high = np.array(rectangle[2:]) + margin
    return not bool(((head > low) & (head < high)).all(axis=1).any())


def _draw_step(context: EditorContext, number: int, step: Step, done: bool, current: bool) -> None:
    left, title = imgui.get_cursor_pos_x(), _with_keys(step.title, context.actions)
    if done:
        imgui.text_colored(ACCENT, Icon.CHECK)
    else:
        imgui.text_colored(ACCENT if current else FAINT, str(number))
    imgui.same_line(left + em(1.5))
    if current:
        imgui.text_unformatted(title)
        imgui.set_cursor_pos(ImVec2(left + em(1.5), imgui.get_cursor_pos_y() - em(0.2)))
        imgui.begin_group()
        caption(_with_keys(step.text, context.actions))
        imgui.end_group()
    else:
        imgui.text_colored(FAINT, title)


def _with_keys(text: str, actions: Actions) -> str:
    """Return ``text`` with the names of actions in braces replaced by their keys."""
    for action in actions:
        text = text.replace(f"{{{action.name}}}", action.shortcut)
    return text


def _aim(context: EditorContext, step: Step, head: np.ndarray) -> tuple[Pixel, Pixel | None] | None:
    """Return the position in the window to press and the unit direction to drag, or None if it is not visible."""
    viewport = context.viewport
    if step.name == "orbit":
        return _place_next_to_head(viewport, head)
    vertex = context.session.model.character.feature_points.get(step.place)
    if vertex is None:
        return None
    camera, position = viewport.camera, context.scene.vertices[vertex].astype(np.float64)
    tip = position + np.array([*step.pull, 0.0])
    begin, end = camera.project(np.stack([position, tip]))
    if context.scene.occluded(camera, position[None])[0]:
        return None
    place = (float(begin[0]) + viewport.origin[0], float(begin[1]) + viewport.origin[1])
    length = float(np.hypot(*(end - begin)))
    if not viewport.contains(place):
        return None
    across, down = ((end - begin) / max(length, 1e-9)).tolist()
    return place, (across, down) if length > 1.0 else None


def _place_next_to_head(viewport: Viewport, head: np.ndarray) -> tuple[Pixel, Pixel | None] | None:
    """Return a position next to the head at the height of the mouth and the direction to drag, or None without room."""
    scale = viewport.ui_scale
    edge = viewport.origin[0] + viewport.size[0]
    side = float(head[:, 0].max())
    room = edge - side
    if room < 4.0 * _RING * scale:
        return None
    y = viewport.origin[1] + 0.45 * viewport.size[1]
    return (side + min(0.35 * room, 6.0 * _RING * scale), y), (1.0, 0.0)


def _draw_arrow(
    draw: imgui.ImDrawList, center: Pixel, direction: Pixel | None, scale: float, colour: int, thickness: float
) -> None:
    """Draw a short arrow from the ring around ``center``."""
    if direction is None:
        return
    (x, y), (dx, dy) = center, direction
    begin, end = (_RING + 5.0) * scale, (_RING + _ARROW) * scale
    tip = (x + end * dx, y + end * dy)
    draw.add_line((x + begin * dx, y + begin * dy), tip, colour, thickness)
    back, out = 7.0 * scale, 5.0 * scale
    for side in (-out, out):
        draw.add_line(tip, (tip[0] - back * dx + side * dy, tip[1] - back * dy - side * dx), colour, thickness)
