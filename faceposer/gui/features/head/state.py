"""State of the head in the window: its identity, and edits of it by sliders, random heads and mixtures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.features.head.lines import Lines
from faceposer.gui.widgets.dialogs import TextQuestion
from faceposer.identity.identity import Identity, SkinTexture
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from faceposer.model.character_names import checked_title, file_stem
from faceposer.progress import Progress
from faceposer.session.character_library import LibraryEntry
from faceposer.session.jobs import ThreadJob
from faceposer.tools.head_tool import HeadTool

if TYPE_CHECKING:
    from faceposer.identity.editing import HeadEditor

# Shipped characters whose heads are of other topologies.
_NO_PEOPLE = ("creature", "low")
#: Name of the part of a head beside the segments of its shape.
SKIN = "skin"


@dataclass(frozen=True, eq=False)
class _Drag:
    """The drag of a slider: its key, the name of the step, and the head before it."""

    key: str
    label: str
    before: Identity


class HeadState:
    """The head of the open character, and what the tab *Head* has of it.

    Attributes:
        context: The editor.
        variety: Standard deviations of random heads, relative to those of people.
        locked: Parts that random heads leave as they are: names of segments, and "skin".
        keeps_features: True if attributes of the person leave those of the face as they are.
        skin_follows: True if age and gender change a skin of the model, too.
        other: Character to mix with, as a name or path, or "".
        caricatures: Lines through the average.
        mixtures: Lines to heads of other characters.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.variety = 0.8
        self.locked: frozenset[str] = frozenset()
        self.keeps_features = False
        self.skin_follows = True
        self.other = ""
        self.caricatures, self.mixtures = Lines(), Lines()
        self._job: ThreadJob[None] | None = None
        self._editor: HeadEditor | None = None
        # A character whose head could not be measured, and why.
        self._failed: tuple[Character, str] | None = None
        self._drag: _Drag | None = None
        # Number of the last frame in which the slider of the drag was drawn.
        self._drawn = 0
        self._seed = 0
        self._measured: tuple[Identity | None, dict[str, float]] = (None, {})
        self._original: tuple[HeadEditor | None, dict[str, float]] = (None, {})
        self._others: dict[str, Identity] = {}
        self._own_skin: tuple[HeadEditor, SkinTexture] | None = None

    @property
    def tool(self) -> HeadTool:
        """The tool that drags points of the head."""
        return self.context.toolbox.head_tool

    @property
    def applies(self) -> bool:
        """True if the head of the open character can be edited."""
        return self.tool.usable(self.context.session.base_model.character)

    @property
    def busy(self) -> bool:
        """True while a slider of the tab is dragged."""
        return self._drag is not None

    # The present head

    @property
    def failure(self) -> str | None:
        """Why the head of the open character cannot be edited, if its preparation has failed."""
        character = self.context.session.base_model.character
        return self._failed[1] if self._failed is not None and self._failed[0] is character else None

    @property
    def editor(self) -> "HeadEditor | None":
        """The editor of the character's head; None while it is prepared in the background, and after a `failure`."""
        character = self.context.session.base_model.character
        if self._editor is not None and self._editor.character is character:
            return self._editor
        if self._job is None and self.failure is None:

            def prepare(_progress: Progress) -> None:
                from faceposer.identity.editing import head_editor

                try:
                    editor = head_editor(character)
                    _ = editor.maker
                except FacePoserError as error:
                    self._failed = (character, str(error))
                else:
                    self._editor = editor

            self._job = ThreadJob(prepare, self.context.wake)
        return None

    def require_editor(self) -> "HeadEditor":
        """Return the editor, prepared now if need be."""
        from faceposer.identity.editing import head_editor

        self._editor = head_editor(self.context.session.base_model.character)
        return self._editor

    @property
    def identity(self) -> Identity:
        """The head that is shown."""
        session = self.context.session
        if session.preview is not None:
            return session.preview.identity
        return session.document.identity or self.require_editor().own

    @property
    def values(self) -> dict[str, float]:
        """Values of all attributes of the head that is shown."""
        identity = self.identity
        if self._measured[0] is not identity:
            self._measured = (identity, self.require_editor().measure(identity))
        return self._measured[1]

    @property
    def original_values(self) -> dict[str, float]:
        """Values of all attributes of the character's own head."""
        editor = self.require_editor()
        if self._original[0] is not editor:
            self._original = (editor, editor.measure(editor.own))
        return self._original[1]

    # Edits

    def edit(self, key: str, label: str, changed: bool, make: Callable[[Identity], Identity]) -> None:
        """Start, continue or end the drag of the last drawn slider, which is one step of the history.

        Args:
            key: Identifier of the slider.
            label: Name of the step.
            changed: True if its value has just changed.
            make: Returns the head for the new value from the one before the drag.
        """
        if imgui.is_item_activated() and not self.context.busy:
            self._drag = _Drag(key, label, self.identity)
        if self._drag is None or self._drag.key != key:
            return
        self._drawn = imgui.get_frame_count()
        if changed:
            try:
                self.context.session.preview_identity(make(self._drag.before))
            except FacePoserError:
                imgui.internal.clear_active_id()
                self._end_drag(keep=False)
                raise
            self.context.redraw()
        if imgui.is_key_pressed(imgui.Key.escape, False):
            imgui.internal.clear_active_id()
            self._end_drag(keep=False)
        elif not imgui.is_item_active():
            self._end_drag(keep=True)

    def with_attribute(self, identity: Identity, name: str, value: float) -> Identity:
        """Return the head with another value of an attribute, by the options of the tab."""
        editor = self.require_editor()
        keep = editor.attributes.names if self.keeps_features else None
        return editor.with_attributes(identity, {name: value}, keep, skin_follows=self.skin_follows)

    def _end_drag(self, keep: bool) -> None:
        assert self._drag is not None
        drag, self._drag = self._drag, None
        session = self.context.session
        preview = session.preview
        session.preview_identity(None)
        if keep and preview is not None:
            self.set_identity(preview.identity, drag.label)
        self.context.redraw()

    def set_identity(self, identity: Identity | None, label: str) -> None:
        """Change the head as one step, and say so if constraints end with it."""
        session = self.context.session
        constrained = bool(session.document.constraints)
        session.set_identity(identity, label)
        if constrained:
            self.context.notify("The pose is accepted without its constraints: they belonged to the other head")

    def randomise(self) -> None:
        """Change to a random head; what is locked stays."""
        if self.locked >= {*self.require_editor().segment_names, SKIN}:
            self.context.notify("Nothing changes, since all parts are locked: click one in the tab Head to unlock it")
            return
        self._seed += 1
        self.set_identity(self.random_head(self._seed), "Random head")

    def random_head(self, seed: int) -> Identity:
        """Return a random head near the density of people, with what is locked as it is."""
        editor = self.require_editor()
        present = self.identity
        free = [name for name in editor.segment_names if name not in self.locked]
        head = present
        if free:
            every = len(free) == len(editor.segment_names)
            head = editor.random(seed, present, None if every else free, self.variety)
        return head if SKIN in self.locked else replace(head, texture=editor.random_texture(seed, head))

    def average(self) -> None:
        """Change to the average head."""
        self.set_identity(replace(self.require_editor().average, texture=self.identity.texture), "Average head")

    def restore_original(self) -> None:
        """Return to the head of the character's file."""
        self.set_identity(None, "Original head")

    def mixes(self, entry: LibraryEntry) -> bool:
        """Return True if the character ``entry`` may have a head to mix with: of those shipped, only people do."""
        return entry.home != "installed" or entry.name not in _NO_PEOPLE

    def other_head(self) -> Identity | None:
        """Return the head of the character to mix with, or None without one.

        Raises:
            FacePoserError: If it cannot be read, or its head is of another topology.
        """
        if not self.other:
            return None
        if self.other not in self._others:
            from faceposer.identity.editing import head_editor

            editor = head_editor(load_character(self.other))
            self._others[self.other] = replace(editor.own, texture=editor.own_texture())
        return self._others[self.other]

    def mixed(self, start: Identity, end: Identity, share: float) -> Identity:
        """Return the head at ``share`` from ``start`` to the other character's, ``end``; skins are mixed, too."""
        if share <= 0.0:
            return start
        if start.texture is None:
            start = replace(start, texture=self.own_texture)
        return start.mixed(end, share)

    @property
    def own_texture(self) -> SkinTexture:
        """The skin of the model that is most like the character's own."""
        known = self.known_own_texture
        if known is None:
            editor = self.require_editor()
            known = editor.own_texture()
            self._own_skin = (editor, known)
        return known

    @property
    def known_own_texture(self) -> SkinTexture | None:
        """`own_texture` if it has been estimated."""
        if self._own_skin is None or self._own_skin[0] is not self.require_editor():
            return None
        return self._own_skin[1]

    # Characters

    def ask_to_save(self) -> None:
        """Ask for the name of a new character with this head."""
        base, taken = self.context.session.base_model.character.title, self._titles
        title = next(title for i in count(2) if (title := f"{base} {i}").casefold() not in taken)
        self.context.dialogs.ask(TextQuestion("Save head as character", title, "Save", self.save))

    @property
    def _titles(self) -> set[str]:
        """Titles of all characters in the list, in lower case."""
        return {entry.title.casefold() for entry in self.context.characters.all(self.context.settings.characters)}

    def save(self, title: str) -> None:
        """Save the character with this head to the library of characters.

        Raises:
            FacePoserError: If the name is not possible or taken, or the file cannot be written.
        """
        from faceposer.identity.head_choices import named_character

        title, context = checked_title(title), self.context
        if title.casefold() in self._titles:
            raise FacePoserError(f"There is a character {title} already; choose another name.")
        library = context.characters
        library.make_folder()
        path = library.new_path(file_stem(title))
        save_character(path, named_character(self.require_editor(), self.identity, path.stem, title))
        context.notify(f"Saved {title}. It is in the list of characters at the top of the panel.")
