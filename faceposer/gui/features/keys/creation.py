"""Dialog that creates a folder of key poses: the target, and how its missing poses are proposed."""

from collections.abc import Callable
from pathlib import Path
from typing import get_args

from imgui_bundle import imgui

from faceposer.files import paths
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.basic import caption, choice
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.modal import modal, modal_body, modal_buttons, modal_entered, modal_escaped, modal_title
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed, widget_id
from faceposer.gui.widgets.theme import Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.poses.library import safe_stem
from faceposer.session.key_folder import SUFFIXES
from faceposer.session.key_proposals import Proposal

_WIDTH, _LABEL = 30.0, 5.6
_BUTTONS, _LEAST = (("create", "Create..."), ("cancel", "Cancel")), 7.0
_PROPOSALS: tuple[Proposal, ...] = get_args(Proposal)
_LABELS = ("Automatic", "Distances", "Weights")
_TIPS = (
    "Propose by weights between rigs that have mostly the same shapes, otherwise by distances",
    "Propose by distances between feature points, for any two characters",
    "Propose by the weights of ARKit shapes that both characters have",
)


class CreationDialog:
    """The dialog.

    Attributes:
        open: True while it is shown.
        to: Name or file of the target.
        proposal: How missing poses of the target are proposed.
    """

    def __init__(self, context: EditorContext, create: Callable[[Path, str, str, Proposal], object]) -> None:
        """Ask in the window of ``context``, then call ``create`` with folder, source, target and proposal."""
        self._context, self._create = context, create
        self.open = False
        self.to = ""
        self.proposal: Proposal = "auto"
        self._titles: dict[str, str] = {}
        self._cancelled: Callable[[], object] = lambda: None

    def show(self, to: str = "", cancelled: Callable[[], object] = lambda: None) -> None:
        """Open the dialog, with the target ``to`` if it is given; ``cancelled`` is called if the user gives up."""
        context = self._context
        context.toolbox.finish()
        context.slider_edit.let_go()
        files = {name: title for name, title in self._titles.items() if Path(name).suffix and paths.is_file(name)}
        listed = {entry.name: entry.title for entry in context.characters.all(context.settings.characters)}
        self._titles = listed | files
        if to:
            self._titles.setdefault(to, Path(to).stem)
        source = context.session.document.character
        # A character needs no key poses for itself.
        self._titles.pop(source, None)
        self.to = to or (self.to if self.to in self._titles else "")
        if self.to in ("", source):
            self.to = next((name for name in self._titles if name != source), source)
        self.open, self._cancelled = True, cancelled
        context.redraw()

    def draw(self) -> None:
        """Draw the dialog if it is open and no other is above it."""
        context = self._context
        if not self.open or context.dialogs.open or context.file_dialogs.open:
            return
        with modal("##keys-new", _WIDTH) as shown:
            if shown:
                self._draw_content()

    def _draw_content(self) -> None:
        context, rects = self._context, self._context.widget_rects
        modal_title(context.fonts, "New key poses")
        with modal_body(_BUTTONS, _LEAST):
            source = context.session.model.character.title
            caption(
                f"Pairs of an expression of {source} and what it looks like on the target, in a folder of files. "
                "Poses that the target lacks are proposed, for you to edit."
            )
            imgui.dummy((0.0, em(0.2)))
            row_label("Target", "Character that follows", _LABEL)
            imgui.set_next_item_width(-em(2.8))
            opened = imgui.begin_combo("##keys-to", displayed(self._titles.get(self.to, Path(self.to).stem)))
            rects.record("keys-new:to")
            if opened:
                for name, title in self._titles.items():
                    if imgui.selectable(f"{displayed(title)}##{widget_id(name)}", name == self.to)[0]:
                        self.to = name
                    rects.record(f"keys-new:to:{name}")
                imgui.end_combo()
            imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
            if imgui.button(f"{Icon.FILE}##keys-to-file", (-1.0, 0.0)):
                self._ask_for_target()
            rects.record("keys-new:file")
            tooltip("Choose a character file, or the neutral mesh of a character without shapes")
            if self.is_mesh:
                caption("The target is a mesh without shapes: sculpt a mesh for each key pose in another program.")
            else:
                row_label("Propose by", "How poses that the target lacks are proposed", _LABEL)
                index = choice(rects, "keys-new:proposal", _LABELS, _PROPOSALS.index(self.proposal), _TIPS)
                self.proposal = _PROPOSALS[index]
        tips = {"create": "Choose the name of the new folder"}
        pressed = modal_buttons(rects, "keys-new", _BUTTONS, 0, _LEAST, tips=tips)
        if modal_escaped():
            pressed = "cancel"
        elif modal_entered():
            pressed = "create"
        if pressed == "cancel":
            self.open = False
            imgui.close_current_popup()
            self._cancelled()
        elif pressed == "create":
            self._ask_for_folder()

    @property
    def is_mesh(self) -> bool:
        """True if the target is a mesh without shapes."""
        return Path(self.to).suffix.lower() in POSED_MESH_SUFFIXES

    def _ask_for_target(self) -> None:
        def chosen(path: Path) -> None:
            self.to = str(path)
            self._titles.setdefault(self.to, path.stem)

        suffixes = (".npz", *POSED_MESH_SUFFIXES)
        folder = last_folder(self._context.settings)
        self._context.ask_for_file(FileRequest("open", "Choose target", "Characters", suffixes, folder, chosen))

    def _ask_for_folder(self) -> None:
        source = self._context.session.document.character

        def chosen(path: Path) -> None:
            self.open = False
            self._create(path, source, self.to, self.proposal)

        titles = (self._context.session.model.character.title, self._titles.get(self.to, Path(self.to).stem))
        name = safe_stem(" ".join((*titles, "keys")))
        place = last_folder(self._context.settings) / name
        self._context.ask_for_file(
            FileRequest("new folder", "New folder of key poses", "Key poses", SUFFIXES, place, chosen)
        )
