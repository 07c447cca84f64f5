"""The dialog over the window while a face follows trajectories: how far it is, and a button that ends it."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.theme import ACCENT_DARK, em

if TYPE_CHECKING:
    from faceposer.gui.features.trajectories.feature import TrajectoriesFeature

_NAME, _WIDTH = "##following", 26.0


def draw_following(following: "TrajectoriesFeature") -> None:
    """Draw the dialog, or put it away where nothing is solved any more."""
    wanted = following.is_modal
    if not wanted and not imgui.is_popup_open(_NAME):
        return
    if wanted and not imgui.is_popup_open(_NAME):
        imgui.open_popup(_NAME)
    view = imgui.get_main_viewport()
    width = min(em(_WIDTH), view.size.x - em(1))
    imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
    imgui.set_next_window_size_constraints((width, 0.0), (width, view.size.y))
    imgui.push_style_var(imgui.StyleVar_.window_padding, (em(1.4), em(1.2)))
    flags = (
        imgui.WindowFlags_.no_title_bar
        | imgui.WindowFlags_.no_resize
        | imgui.WindowFlags_.no_move
        | imgui.WindowFlags_.always_auto_resize
        | imgui.WindowFlags_.no_saved_settings
    )
    shown = imgui.begin_popup_modal(_NAME, None, flags)[0]
    imgui.pop_style_var()
    if not shown:
        return
    if not wanted:
        imgui.close_current_popup()
    elif following.job is not None:
        _draw(following)
    imgui.end_popup()


def _draw(following: "TrajectoriesFeature") -> None:
    context, job = following.context, following.job
    assert job is not None
    imgui.push_font(context.fonts.bold, 0.0)
    imgui.text_unformatted("The face follows the trajectories")
    imgui.pop_font()
    imgui.dummy((0.0, em(0.2)))
    imgui.push_style_color(imgui.Col_.plot_histogram, ACCENT_DARK)
    imgui.progress_bar(job.share, (-1.0, em(1.5)), f"{100.0 * job.share:.0f} %")
    imgui.pop_style_color()
    context.widget_rects.record("following")
    caption(following.progress)
    imgui.dummy((0.0, em(0.3)))
    width = em(6)
    imgui.set_cursor_pos_x(imgui.get_window_width() - width - imgui.get_style().window_padding.x)
    imgui.begin_disabled(job.stopping)
    if imgui.button("Cancel##following", (width, 0.0)) or imgui.is_key_pressed(imgui.Key.escape, False):
        following.stop()
    imgui.end_disabled()
    context.widget_rects.record("following:cancel")
