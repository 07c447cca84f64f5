"""Tab of the poses: thumbnails, and options for applying a pose."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from imgui_bundle import ImVec2, imgui

from faceposer.gui.features.poses.state import Category
from faceposer.gui.widgets.basic import action_button, button_width, caption, choice, toggle_button
from faceposer.gui.widgets.sliders import reset_button, slider, slider_room
from faceposer.gui.widgets.text import shortened, widget_id
from faceposer.gui.widgets.theme import ACCENT, ACCENT_DARK, FAINT, FIELD, INK, RAISED_MORE, WARNING, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.poses.applying import GREATEST_STRENGTH, LEAST_STRENGTH, REGIONS, Array, Blend, Region, Side, misfit
from faceposer.poses.library import Entry

if TYPE_CHECKING:
    from faceposer.gui.features.poses.commands import PoseCommands

_Name = TypeVar("_Name", bound=str)

_COLUMNS = 3
_LEAST_GRID = 9.0
_CATEGORIES: tuple[tuple[Category, str, str], ...] = (
    ("all", "All", "All poses"),
    ("expression", "Expressions", "Poses with the tag expression, such as the six basic expressions"),
    ("viseme", "Visemes", "Poses with the tag viseme: mouth shapes of speech"),
    ("mine", "Mine", "Poses that you have saved"),
)
_REGION_TIPS = {
    "brows": "the brows",
    "eyes": "the eyes and lids",
    "cheeks": "the cheeks and nose",
    "mouth": "the mouth, jaw and tongue",
}
_SIDES: tuple[tuple[Side, str, str], ...] = (
    ("both", "Both sides", "Apply poses to both sides of the face."),
    ("left", "Left", "Apply poses to the character's left side only, without shapes of both sides such as the jaw."),
    ("right", "Right", "Apply poses to the character's right side only, without shapes of both sides such as the jaw."),
)
_BLENDS: tuple[tuple[Blend, str, str], ...] = (
    ("replace", "Replace", "Replace the pose of the face."),
    ("add", "Add", "Add the pose to that of the face, such as a viseme to a smile."),
)


class PosesPanel:
    """Content of the tab."""

    def __init__(self, poses: "PoseCommands") -> None:
        """Show the state of ``poses``."""
        self._poses = poses

    def draw(self) -> None:
        """Draw the tab."""
        poses, context = self._poses, self._poses.context
        imgui.set_next_item_width(-1.0)
        _, poses.filter = imgui.input_text_with_hint("##poses-filter", "Find a pose", poses.filter)
        context.widget_rects.record("poses:filter")
        poses.category = _choice(context.widget_rects, "poses:category", _CATEGORIES, poses.category, by_text=True)
        style = imgui.get_style()
        below = 6 * imgui.get_frame_height_with_spacing() + 2.0 * style.item_spacing.y
        height = max(imgui.get_content_region_avail().y - below, em(_LEAST_GRID))
        imgui.begin_child("##poses-grid", ImVec2(0.0, height))
        self._draw_grid()
        imgui.end_child()
        imgui.separator()
        imgui.begin_disabled(context.toolbox.active or context.playing)
        self._draw_strength()
        self._draw_mask()
        imgui.end_disabled()
        self._draw_buttons()

    # Thumbnails

    def _draw_grid(self) -> None:
        entries = self._poses.shown()
        if not entries:
            self._draw_empty()
            return
        gap = round(em(0.35))
        # Reserve room for the scroll bar, so that the thumbnails keep their size when it appears.
        room = imgui.get_window_width() - imgui.get_style().scrollbar_size
        side = max(int((room - gap * (_COLUMNS - 1)) / _COLUMNS), 8)
        imgui.push_style_var(imgui.StyleVar_.item_spacing, (gap, gap))
        for i, entry in enumerate(entries):
            if i % _COLUMNS:
                imgui.same_line()
            self._draw_cell(entry, side)
        imgui.pop_style_var()

    def _draw_empty(self) -> None:
        poses = self._poses
        imgui.dummy((0.0, em(0.3)))
        if poses.filter.strip():
            caption("No pose matches the filter.")
        elif poses.category == "mine":
            caption("No saved poses. Save the current pose to add it here.")
        else:
            caption("The built-in poses need ARKit shapes, which this character does not have.")

    def _draw_cell(self, entry: Entry, side: int) -> None:
        poses, context = self._poses, self._poses.context
        fits = poses.weights(entry) is not None
        last = poses.applied_pose
        active = last is not None and last.pose == entry.pose
        imgui.push_id(widget_id(str(entry.path)))
        low = imgui.get_cursor_screen_pos()
        size = ImVec2(side, side + imgui.get_text_line_height() + em(0.25))
        pressed = imgui.invisible_button("cell", size)
        seen, hovered = imgui.is_item_visible(), imgui.is_item_hovered()
        context.widget_rects.record(f"pose:{entry.title}")
        tooltip(self._tip(entry, fits))
        if seen:
            self._paint_cell(entry, low, side, fits, active, hovered)
        if pressed and fits and entry.pose is not None:
            poses.apply(entry.pose)
        self._draw_menu(entry, fits)
        imgui.pop_id()

    def _tip(self, entry: Entry, fits: bool) -> str:
        if entry.pose is None:
            return entry.problem
        if not fits:
            return misfit(entry.pose, self._poses.context.session.model.character)
        return f"{entry.title}. {entry.pose.note}" if entry.pose.note else entry.title

    def _paint_cell(self, entry: Entry, low: ImVec2, side: int, fits: bool, active: bool, hovered: bool) -> None:
        draw = imgui.get_window_draw_list()
        high = ImVec2(low.x + side, low.y + side)
        rounding = em(0.2)
        texture = self._texture(entry, side, fits)
        draw.add_rect_filled(low, high, u32(FIELD), rounding)
        if texture is not None:
            # Textures have their first row at the top, both drawn ones and those of files.
            tint = u32((1.0, 1.0, 1.0, 1.0 if fits else 0.35))
            draw.add_image_rounded(
                imgui.ImTextureRef(texture), low, high, ImVec2(0.0, 0.0), ImVec2(1.0, 1.0), tint, rounding
            )
        elif entry.pose is None or not fits:
            text = Icon.WARNING if entry.pose is None else Icon.EYE_OFF
            extent = imgui.calc_text_size(text)
            colour = u32(WARNING if entry.pose is None else FAINT)
            draw.add_text((low.x + 0.5 * (side - extent.x), low.y + 0.5 * (side - extent.y)), colour, text)
        if active or hovered:
            thick = max(round(em(0.13)), 1) if active else max(round(em(0.07)), 1)
            draw.add_rect(low, high, u32(ACCENT if active else RAISED_MORE), rounding, thickness=thick)
        name = shortened(entry.title, side)
        across = imgui.calc_text_size(name).x
        colour = u32(INK if active or hovered else FAINT, 1.0 if fits else 0.6)
        draw.add_text((round(low.x + 0.5 * (side - across)), round(high.y + em(0.1))), colour, name)

    def _texture(self, entry: Entry, side: int, fits: bool) -> int | None:
        poses, context = self._poses, self._poses.context
        pose = entry.pose
        if pose is None:
            return None
        if not fits:
            try:
                return poses.portraits.of_file(entry.picture, entry.picture.stat().st_mtime_ns)
            except OSError:
                return None
        pixels = round(side * context.pixel_ratio)

        def coefficients() -> Array:
            weights = poses.weights(entry)
            assert weights is not None
            return context.session.model.coefficients_of(weights)

        return poses.portraits.of_pose(pose, coefficients, pixels)

    def _draw_menu(self, entry: Entry, fits: bool) -> None:
        poses = self._poses
        if not imgui.begin_popup_context_item("##pose-menu"):
            return
        pose = entry.pose
        items: list[tuple[str, str, bool, Callable[[], None]]] = []
        if pose is not None:
            items += [
                ("apply", "Apply", fits, lambda: poses.apply(pose)),
                ("flip", "Apply flipped", fits, lambda: poses.apply_flipped(pose)),
            ]
        if not entry.shipped:
            items += [
                ("update", "Replace with current pose...", pose is not None, lambda: poses.ask_to_update(entry)),
                ("rename", "Rename...", pose is not None, lambda: poses.ask_to_rename(entry)),
                ("delete", "Delete...", True, lambda: poses.ask_to_delete(entry)),
            ]
        for name, label, enabled, run in items:
            if name == "update":
                imgui.separator()
            if imgui.menu_item_simple(label, "", False, enabled):
                run()
            poses.context.widget_rects.record(f"pose-menu:{name}")
        imgui.end_popup()

    # Options

    def _draw_strength(self) -> None:
        poses, context = self._poses, self._poses.context
        last = poses.applied_pose
        imgui.align_text_to_frame_padding()
        if last is None:
            imgui.text_disabled("Click a pose to apply it")
        else:
            mask = f", {last.mask.description}" if last.mask.description else ""
            imgui.text_unformatted(shortened(f"{last.pose.name}{mask}", imgui.get_content_region_avail().x))
        percent = 100.0 * (1.0 if last is None else last.strength)
        imgui.begin_disabled(last is None)
        imgui.set_next_item_width(slider_room())
        changed, value = slider(
            "##strength",
            percent,
            100.0 * LEAST_STRENGTH,
            100.0 * GREATEST_STRENGTH,
            "Strength %.0f %%",
            imgui.SliderFlags_.clamp_on_input.value,
        )
        context.widget_rects.record("poses:strength")
        if last is not None:
            context.slider_edit.update(
                context.session,
                "pose-strength",
                f"Apply {last.pose.name}",
                changed,
                lambda: poses.set_strength(value / 100.0),
                merges=True,
            )
        imgui.end_disabled()
        tooltip("Strength of the pose; negative values apply its opposite. Ctrl+click to type a value.")
        if reset_button(context.widget_rects, "poses:strength", percent == 100.0, "Reset to 100 %"):
            poses.reset_strength()

    def _draw_mask(self) -> None:
        poses, rects = self._poses, self._poses.context.widget_rects
        regions = self._draw_regions(poses.mask.regions)
        side = _choice(rects, "poses:side", _SIDES, poses.mask.side)
        blend = _choice(rects, "poses:blend", _BLENDS, poses.mask.blend)
        poses.mask = replace(poses.mask, regions=regions, side=side, blend=blend)

    def _draw_regions(self, regions: frozenset[Region]) -> frozenset[Region]:
        """Draw the toggles of the regions and return the selected regions, or all if none is selected."""
        context = self._poses.context
        everything = frozenset(REGIONS)
        gap = max(round(em(0.1)), 1)
        width = (imgui.get_content_region_avail().x - gap * len(REGIONS)) / (len(REGIONS) + 1)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, (em(0.1), imgui.get_style().frame_padding.y))
        chosen = regions
        if toggle_button("Face##region", regions == everything, ACCENT_DARK, width):
            chosen = everything
        context.widget_rects.record("poses:region:all")
        tooltip("Apply poses to the whole face.")
        for region in REGIONS:
            imgui.same_line(0.0, gap)
            on = region in regions and regions != everything
            if toggle_button(f"{region.title()}##region", on, ACCENT_DARK, width):
                # The first press selects a single region, further presses add to it.
                chosen = frozenset((region,)) if regions == everything else regions ^ {region}
            context.widget_rects.record(f"poses:region:{region}")
            tooltip(f"Apply poses to {_REGION_TIPS[region]}, and to the other selected regions.")
        imgui.pop_style_var()
        return chosen or everything

    def _draw_buttons(self) -> None:
        poses, context = self._poses, self._poses.context
        width = button_width(3)
        action_button(context.widget_rects, context.actions["pose-save"], width, "Save...")
        imgui.same_line()
        mirror = "pose-mirror-right" if poses.mask.side == "right" else "pose-mirror"
        action_button(context.widget_rects, context.actions[mirror], width, "Mirror")
        imgui.same_line()
        action_button(context.widget_rects, context.actions["pose-flip"], width, "Flip")


def _choice(
    rects: WidgetRects, name: str, rows: Sequence[tuple[_Name, str, str]], value: _Name, by_text: bool = False
) -> _Name:
    """Draw a row of buttons of which one is selected, and return its name."""
    names = [row[0] for row in rows]
    labels, tips = [row[1] for row in rows], [row[2] for row in rows]
    return names[choice(rects, name, labels, names.index(value), tips, by_text)]
