"""The list of characters at the top of the side panel: installed ones, those of the user, and other files."""

from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import disabled
from faceposer.gui.widgets.dialogs import Choice, Question, TextQuestion
from faceposer.gui.widgets.text import shortened, widget_id
from faceposer.gui.widgets.theme import FAINT, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.session.character_library import LibraryEntry

_HEADINGS = {"library": "My characters", "elsewhere": "Opened from files"}
_BUTTON = 1.6
_NONE = ImVec4(0.0, 0.0, 0.0, 0.0)


def draw_characters(context: EditorContext) -> None:
    """Draw the drop-down list of characters."""
    title = context.session.model.character.title
    imgui.set_next_item_width(-1.0)
    room = imgui.get_content_region_avail().x - imgui.get_frame_height() - 2.0 * imgui.get_style().frame_padding.x
    flags = imgui.ComboFlags_.height_large.value
    opened = imgui.begin_combo("##character", shortened(title, room), flags)
    context.widget_rects.record("character")
    if not opened:
        tooltip(f"{title}\nCharacter to pose. File > Open opens others from files.")
        return
    before = "installed"
    for entry in context.characters.all(context.settings.characters):
        if entry.home != before:
            before = entry.home
            imgui.separator()
            imgui.text_colored(FAINT, _HEADINGS[entry.home])
        imgui.push_id(widget_id(entry.name))
        _draw_row(context, entry)
        imgui.pop_id()
    imgui.separator()
    action = context.actions["import"]
    if imgui.selectable(action.label, False)[0] and action.enabled():
        action.run()
    context.widget_rects.record("character:import")
    imgui.end_combo()


def _draw_row(context: EditorContext, entry: LibraryEntry) -> None:
    """Draw an entry of the list, with the buttons for one of the user's or an opened one."""
    current = entry.name == context.session.document.character
    buttons = {"installed": 0, "library": 2, "elsewhere": 1}[entry.home]
    width = imgui.get_content_region_avail().x
    side = em(_BUTTON)
    label = shortened(entry.title, width - buttons * side - em(0.3))
    left = imgui.get_cursor_pos_x()
    imgui.set_next_item_allow_overlap()
    pressed, _ = imgui.selectable(f"{label}##name", current, 0, ImVec2(width, 0.0))
    context.widget_rects.record(f"character:{entry.name}")
    if entry.home != "installed":
        tooltip(f"{entry.title}\n{entry.name}")
    if pressed and not current:
        context.open_file(entry.name)
    if entry.home == "library":
        imgui.same_line(left + width - 2.0 * side)
        if _icon_button(Icon.RENAME, side):
            imgui.close_current_popup()
            _ask_for_title(context, entry)
        context.widget_rects.record(f"character:{entry.name}:rename")
        tooltip("Rename")
    if buttons:
        imgui.same_line(left + width - side)
        with disabled(current):
            removed = _icon_button(Icon.CLOSE, side)
        context.widget_rects.record(f"character:{entry.name}:remove")
        tooltip(_removal_tooltip(entry, current))
        if removed:
            imgui.close_current_popup()
            _remove(context, entry)


def _icon_button(icon: str, side: float) -> bool:
    imgui.push_style_color(imgui.Col_.button, _NONE)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, 0.0))
    pressed = imgui.button(icon, ImVec2(side, imgui.get_text_line_height()))
    imgui.pop_style_var()
    imgui.pop_style_color()
    return bool(pressed)


def _removal_tooltip(entry: LibraryEntry, current: bool) -> str:
    if current:
        return "Remove\nThis character is open; open another one first."
    if entry.home == "elsewhere":
        return "Remove from this list\nThe file is kept."
    return "Remove..."


def _ask_for_title(context: EditorContext, entry: LibraryEntry) -> None:
    current = entry.name == context.session.document.character

    def rename(title: str) -> None:
        context.characters.rename(entry, title)
        if current:
            context.session.model.character.set_title(title.strip())
        context.notify(f"Renamed {entry.title} to {title.strip()}")

    context.dialogs.ask(TextQuestion(f"Rename {entry.title}", entry.title, "Rename", rename))


def _remove(context: EditorContext, entry: LibraryEntry) -> None:
    if entry.home == "elsewhere":
        context.settings.characters = [path for path in context.settings.characters if path != entry.name]
        return
    text = f"The file '{Path(entry.name).name}' will be deleted. Sessions that use it can no longer be opened."

    def delete() -> None:
        context.characters.remove(entry)
        context.notify(f"Removed {entry.title}")

    context.dialogs.ask(
        Question(f"Remove {entry.title}?", text, (Choice("Remove", delete), Choice("Cancel")), bad=True, default=1)
    )
