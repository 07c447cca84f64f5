"""Content of the tab "Head": random heads, mixtures, attributes and the skin."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.features.head.lines import Line
from faceposer.gui.features.head.skin_panel import draw_skin
from faceposer.gui.features.head.state import HeadState
from faceposer.gui.features.head.variations import Variations
from faceposer.gui.widgets.basic import (
    action_button,
    button_width,
    caption,
    disabled,
    fitted_button,
    heading,
    section,
    toggle_button,
)
from faceposer.gui.widgets.sliders import reset_button, row_label, slider, slider_room
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT_DARK, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.identity.identity import GROTESQUE, Identity

if TYPE_CHECKING:
    from faceposer.identity.attributes import Attribute
    from faceposer.identity.editing import HeadEditor

# Distance from the average, relative to people, up to which heads are like those of most people.
_PEOPLE = 1.25
# Distances from the average, relative to people, up to which a head is described by each text.
_LIKELIHOODS = (
    (0.6, "nearly average"),
    (_PEOPLE, "like most people"),
    (1.8, "unusual"),
    (float("inf"), "unlike people"),
)
_CLAMP = imgui.SliderFlags_.clamp_on_input.value
_MOST_VARIETY = 1.5
_SAME = 1e-3
# Width of the labels of attributes, in font sizes.
_LABEL = 7.6
# Height of the tab in font sizes below which all of it scrolls.
_LOW = 18.0


class HeadPanel:
    """Content of the tab."""

    def __init__(self, head: HeadState, variations: Variations) -> None:
        """Show the state of ``head`` and its ``variations``."""
        self._head, self._variations = head, variations
        self._filter = ""

    def draw(self) -> None:
        """Draw the tab."""
        head, context = self._head, self._head.context
        if context.session.head_held:
            caption(context.session.head_held)
            return
        editor = head.editor
        if editor is None:
            caption(head.failure or "Measuring the head...")
            return
        # The button stays in sight below the part that scrolls, unless that needs the room.
        low = imgui.get_content_region_avail().y < em(_LOW)
        imgui.begin_child("##head", (0.0, 0.0 if low else -imgui.get_frame_height_with_spacing()))
        with disabled(context.toolbox.active or (context.playing and not head.busy)):
            self._draw_likelihood(editor)
            self._draw_random(editor)
            self._draw_lines(editor)
            self._draw_attributes(editor)
            draw_skin(head)
        if low:
            action_button(context.widget_rects, context.actions["head-save"], -1.0)
        imgui.end_child()
        if not low:
            action_button(context.widget_rects, context.actions["head-save"], -1.0)

    def draw_tool_options(self) -> None:
        """Draw the options of the tool that drags points of the head."""
        tool, context = self._head.tool, self._head.context
        heading(context.fonts, tool.label)
        row_label("Head spread", "Share of the head that follows a dragged point")
        imgui.set_next_item_width(-1.0)
        _, tool.spread = slider("##head-spread", tool.spread, 0.0, 1.0, "%.2f", _CLAMP)
        context.widget_rects.record("head:spread")
        caption("Drag points of the skin. Symmetry (X) changes both sides alike. Locked parts in the tab Head stay.")

    def _draw_likelihood(self, editor: "HeadEditor") -> None:
        distance = editor.distance(self._head.identity)
        words = next(text for limit, text in _LIKELIHOODS if distance <= limit)
        tip = f"Distance from the average head: {distance:.2f}, in standard deviations of people. People have about 1."
        row_label("Likelihood", tip)
        imgui.text_unformatted(shortened(words, imgui.get_content_region_avail().x))
        tooltip(tip)

    # Random heads

    def _draw_random(self, editor: "HeadEditor") -> None:
        head, context = self._head, self._head.context
        width = button_width(3)
        for i, name in enumerate(("head-random", "head-average", "head-original")):
            if i:
                imgui.same_line()
            action_button(context.widget_rects, context.actions[name], width, label=name[5:].capitalize())
        row_label("Variety", "How much random heads differ from the average, relative to people")
        imgui.set_next_item_width(-1.0)
        _, head.variety = slider("##head-variety", head.variety, 0.1, _MOST_VARIETY, "%.2f", _CLAMP)
        context.widget_rects.record("head:variety")
        names = [*editor.segment_names, "skin"]
        width = button_width(len(names))
        caption("Parts that change; click one to lock it")
        # The longest name fills its button.
        imgui.push_style_var(imgui.StyleVar_.frame_padding, (0.0, imgui.get_style().frame_padding.y))
        for i, name in enumerate(names):
            if i:
                imgui.same_line()
            free = name not in head.locked
            if toggle_button(f"{shortened(name.capitalize(), width)}##free-{name}", free, ACCENT_DARK, width):
                head.locked ^= {name}
                head.tool.locked = head.locked - {"skin"}
            context.widget_rects.record(f"head:free:{name}")
            tooltip(
                f"{name.capitalize()}\n{'Changes' if free else 'Locked'}; click to {'lock' if free else 'unlock'} it"
            )
        imgui.pop_style_var()
        shown, top = self._variations.shown, imgui.get_cursor_pos_y()
        if fitted_button(
            context.widget_rects,
            "Other variations" if shown else "Variations",
            "head:variations",
            imgui.get_content_region_avail().x if not shown else button_width(2),
            "Nine heads around this one to choose from",
        ):
            self._variations.make()
        if shown:
            imgui.same_line()
            if fitted_button(context.widget_rects, "Close", "head:variations-close", button_width(1), "Close the grid"):
                self._variations.close()
            self._variations.draw()
            if self._variations.scroll_to():
                self._scroll_to(top, imgui.get_cursor_pos_y())

    def _scroll_to(self, top: float, bottom: float) -> None:
        """Scroll no farther than needed to show what is from ``top`` to ``bottom``, or its begin if it is too high."""
        scroll, height = imgui.get_scroll_y(), imgui.get_window_height()
        wanted = min(max(scroll, bottom - height), top)
        if wanted != scroll:
            imgui.set_scroll_y(wanted)
            self._head.context.redraw()

    # Lines of heads

    def _draw_lines(self, editor: "HeadEditor") -> None:
        head, context = self._head, self._head.context
        row_label("Caricature", "Deviation from the average: 0 is the average head, 1 this one, more exaggerates it")
        imgui.set_next_item_width(-1.0)
        present = head.caricatures.of(head.identity)
        value = 1.0 if present is None else present.value
        most = self._most_caricature(editor, head.identity if present is None else present.start)
        changed, value = slider("##caricature", value, 0.0, most, "%.2f", _CLAMP)
        context.widget_rects.record("head:caricature")

        def scaled(before: Identity) -> Identity:
            line = head.caricatures.of(before)
            start = before if line is None else line.start
            result = start.scaled(value)
            head.caricatures.add(result, Line(start, None, value))
            return result

        head.edit("caricature", "Caricature", changed, scaled)
        self._draw_mixture()

    @staticmethod
    def _most_caricature(editor: "HeadEditor", start: Identity) -> float:
        """Return the factor at which ``start`` becomes grotesque, less for heads that are caricatures already."""
        return GROTESQUE * max(min(_PEOPLE / max(editor.distance(start), 1e-6), 1.0), 1.0 / GROTESQUE)

    def _draw_mixture(self) -> None:
        head, context = self._head, self._head.context
        row_label("Mix with", "Another character with the same mesh, towards which the slider moves this head")
        entries = [one for one in context.characters.all(context.settings.characters) if head.mixes(one)]
        titles = {entry.name: entry.title for entry in entries}
        imgui.set_next_item_width(-1.0)
        opened = imgui.begin_combo("##head-other", titles.get(head.other, "Choose a character"))
        context.widget_rects.record("head:other")
        if opened:
            for entry in entries:
                if imgui.selectable(f"{entry.title}##{entry.name}", entry.name == head.other)[0]:
                    self._choose_other(entry.name)
                context.widget_rects.record(f"head:other:{entry.name}")
            imgui.end_combo()
        if not head.other:
            return
        end = head.other_head()
        assert end is not None
        present = head.mixtures.of(head.identity, end)
        value = 0.0 if present is None else present.value
        row_label("Share")
        imgui.set_next_item_width(-1.0)
        changed, percent = slider("##head-share", 100.0 * value, 0.0, 100.0, "%.0f %%", _CLAMP)
        context.widget_rects.record("head:share")

        def mixed(before: Identity) -> Identity:
            line = head.mixtures.of(before, end)
            start = before if line is None else line.start
            result = head.mixed(start, end, percent / 100.0)
            head.mixtures.add(result, Line(start, end, percent / 100.0))
            return result

        head.edit("mixture", "Mix heads", changed, mixed)

    def _choose_other(self, name: str) -> None:
        head = self._head
        before, head.other = head.other, name
        try:
            head.other_head()
        except FacePoserError as error:
            head.other = before
            head.context.dialogs.report("This character cannot be mixed in", str(error))

    # Attributes

    def _draw_attributes(self, editor: "HeadEditor") -> None:
        head, context = self._head, self._head.context
        heading(context.fonts, "Attributes")
        imgui.set_next_item_width(-1.0)
        _, self._filter = imgui.input_text_with_hint("##head-filter", "Find an attribute", self._filter)
        context.widget_rects.record("head:filter")
        _, head.keeps_features = imgui.checkbox("Keep features", head.keeps_features)
        context.widget_rects.record("head:keep")
        tooltip("A person's age, gender, weight and ethnicity change without the measures of the face")
        imgui.same_line()
        _, head.skin_follows = imgui.checkbox("Skin follows", head.skin_follows)
        context.widget_rects.record("head:skin-follows")
        tooltip("Age and gender also change the skin and its hair, once the skin is one of the model")
        wanted = self._filter.strip().lower()
        groups: dict[str, list[Attribute]] = {}
        for attribute in editor.attributes.attributes:
            if wanted in f"{attribute.group} {attribute.title}".lower():
                groups.setdefault(attribute.group, []).append(attribute)
        for i, (group, attributes) in enumerate(groups.items()):
            flags = imgui.TreeNodeFlags_.default_open.value if i == 0 or wanted else 0
            opened = section(group, flags)
            context.widget_rects.record(f"head:group:{group}")
            if opened:
                for attribute in attributes:
                    self._draw_attribute(attribute)
        if not groups:
            caption("No attribute matches the filter.")

    def _draw_attribute(self, attribute: "Attribute") -> None:
        head, context = self._head, self._head.context
        name = attribute.name
        value = head.values[name]
        low, high = attribute.limits
        measured = f" ({attribute.measurement(value):.1f} cm)" if attribute.unit == "cm" else ""
        tip = f"{attribute.title}{measured}\n{attribute.less} to {attribute.more}; 0 is average"
        row_label(attribute.title, tip, _LABEL)
        imgui.set_next_item_width(slider_room())
        changed, new = slider(f"##{name}", value, min(low, value), max(high, value), "%.2f", _CLAMP)
        context.widget_rects.record(f"head:{name}")
        label = f"Set {attribute.title.lower()}"
        head.edit(name, label, changed, lambda before: head.with_attribute(before, name, new))
        original = head.original_values[name]
        at_default = abs(value - original) < _SAME
        if reset_button(context.widget_rects, f"head:{name}", at_default, "Back to the value of the original head"):
            head.set_identity(head.with_attribute(head.identity, name, original), label)
