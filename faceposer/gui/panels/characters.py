"""The list of characters at the top of the panel: the program's, the imported ones, and files elsewhere."""

from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import tooltip
from faceposer.gui.widgets.dialogs import Choice, Question, TextQuestion
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import FAINT, Icon, em
from faceposer.session.character_library import Character

_HEADINGS = {"library": "Imported", "elsewhere": "Opened from files"}
_BUTTON = 1.6
_NONE = ImVec4(0.0, 0.0, 0.0, 0.0)


def draw_characters(context: EditorContext) -> None:
    """Draw the drop-down list."""
    title = context.session.model.subject.title
    imgui.set_next_item_width(-1.0)
    room = imgui.get_content_region_avail().x - imgui.get_frame_height() - 2.0 * imgui.get_style().frame_padding.x
    flags = imgui.ComboFlags_.height_large.value
    opened = imgui.begin_combo("##subject", shortened(title, room), flags)
    context.widget_rects.record("subject")
    if not opened:
        tooltip(f"{title}\nThe character to pose; {context.actions['open'].shortcut} opens others from files")
        return
    before = "installed"
    for character in context.characters.all(context.settings.characters):
        if character.home != before:
            before = character.home
            imgui.separator()
            imgui.text_colored(FAINT, _HEADINGS[character.home])
        imgui.push_id(character.name)
        _draw_row(context, character)
        imgui.pop_id()
    imgui.separator()
    action = context.actions["import"]
    if imgui.selectable(action.label, False)[0] and action.enabled():
        action.run()
    context.widget_rects.record("subject:import")
    imgui.end_combo()


def _draw_row(context: EditorContext, character: Character) -> None:
    """Draw a character, with the buttons of one that is the user's own."""
    here = character.name == context.session.document.subject
    buttons = {"installed": 0, "library": 2, "elsewhere": 1}[character.home]
    width = imgui.get_content_region_avail().x
    side = em(_BUTTON)
    label = shortened(character.title, width - buttons * side - em(0.3))
    left = imgui.get_cursor_pos_x()
    imgui.set_next_item_allow_overlap()
    pressed, _ = imgui.selectable(f"{label}##name", here, 0, ImVec2(width, 0.0))
    context.widget_rects.record(f"subject:{character.name}")
    if character.home != "installed":
        tooltip(f"{character.title}\n{character.name}")
    if pressed and not here:
        context.open_file(character.name)
    if character.home == "library":
        imgui.same_line(left + width - 2.0 * side)
        if _icon_button(Icon.RENAME, side):
            imgui.close_current_popup()
            _ask_for_title(context, character)
        context.widget_rects.record(f"subject:{character.name}:rename")
        tooltip("Rename")
    if buttons:
        imgui.same_line(left + width - side)
        imgui.begin_disabled(here)
        gone = _icon_button(Icon.CLOSE, side)
        imgui.end_disabled()
        context.widget_rects.record(f"subject:{character.name}:remove")
        tooltip(_removal(character, here))
        if gone:
            imgui.close_current_popup()
            _remove(context, character)


def _icon_button(icon: str, side: float) -> bool:
    imgui.push_style_color(imgui.Col_.button, _NONE)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, 0.0))
    pressed = imgui.button(icon, ImVec2(side, imgui.get_text_line_height()))
    imgui.pop_style_var()
    imgui.pop_style_color()
    return bool(pressed)


def _removal(character: Character, here: bool) -> str:
    if here:
        return "Remove\nIt is the one that is open; open another character first."
    if character.home == "elsewhere":
        return "Remove from this list\nThe file stays."
    return "Remove..."


def _ask_for_title(context: EditorContext, character: Character) -> None:
    here = character.name == context.session.document.subject

    def rename(title: str) -> None:
        context.characters.rename(character, title)
        context.notify(f"{character.title} is now called {title.strip()}")
        if here:
            context.notify("The open session shows the new name when it is opened again")

    context.dialogs.ask(TextQuestion(f"Rename {character.title}", character.title, "Rename", rename))


def _remove(context: EditorContext, character: Character) -> None:
    if character.home == "elsewhere":
        context.settings.characters = [path for path in context.settings.characters if path != character.name]
        return
    text = f"Its file '{Path(character.name).name}' is deleted. Sessions that use it can then not be opened."

    def delete() -> None:
        context.characters.remove(character)
        context.notify(f"{character.title} is removed")

    context.dialogs.ask(
        Question(f"Remove {character.title}?", text, (Choice("Remove", delete), Choice("Cancel")), bad=True)
    )
