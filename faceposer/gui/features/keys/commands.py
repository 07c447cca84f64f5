"""Key poses in the window: the open folder, and the commands that change it, with their work in the background."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.gui.context import EditorContext
from faceposer.gui.features.keys.adding import AddingDialog
from faceposer.gui.features.keys.covering import Covering
from faceposer.gui.features.keys.creation import CreationDialog
from faceposer.gui.features.keys.editing import KeyEditing
from faceposer.gui.features.keys.faces import KeyFaces
from faceposer.gui.features.keys.importance import ImportanceDialog, drawn_importance
from faceposer.gui.features.keys.open_keys import OpenKeys
from faceposer.gui.features.keys.work import KeyWork
from faceposer.gui.name_dialog import NameDialog
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.poses.applying import pose_of
from faceposer.progress import Progress
from faceposer.session.key_compositions import compose_keys
from faceposer.session.key_edits import add_key_pose, propose_again, rename_key, save_key
from faceposer.session.key_folder import COMPOSED, EXPRESSION, VISEME, KeyFolder, Side
from faceposer.session.key_kinds import set_kind
from faceposer.session.key_proposals import Proposal, create_keys
from faceposer.session.key_set import ListedKey
from faceposer.transfer.key_parameters import Regions

# Kinds of keys in the order of the list.
_ORDER = (EXPRESSION, VISEME, "", COMPOSED)


class KeyCommands:
    """The open key poses and their commands.

    Attributes:
        context: The editor.
        opened: The open folder of keys.
        editing: The key that is edited.
        covering: Coverage of the animation.
        faces: Pictures of both faces.
        creation: Dialog for a new folder.
        importance: Dialog with the importance of the vertices for speech.
        adding: Dialog that adds the present pose.
        naming: Dialog that asks for another name.
        latest: Name of the key that was added or changed last, or "".
        sought: Name of the key to which the list has to scroll, or "".
        shown: True while the strip is shown.
        kind: Kind of the keys that are listed, or "" for all.
        work: Work in the background.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.opened = OpenKeys(context)
        self.editing = KeyEditing(context, self.opened)
        self.covering = Covering(context)
        self.faces = KeyFaces(context)
        self.creation = CreationDialog(context, self._create)
        self.importance = ImportanceDialog(context)
        self.adding = AddingDialog(context, self._add)
        self.naming = NameDialog(context)
        self.shown = False
        self.kind = ""
        self.latest = self.sought = ""
        self.work = KeyWork(context, self.opened.read)
        self._created: Callable[[], object] = lambda: None

    # Folders

    def toggle(self) -> None:
        """Show or hide the strip."""
        self.shown = not self.shown
        if self.shown:
            self.opened.open_last()
        self.context.redraw()

    def ask_for_folder(self) -> None:
        """Ask for a folder of keys."""
        folder = self.opened.folder
        start = last_folder(self.context.settings) if folder is None else folder.parent
        self.context.ask_for_file(
            FileRequest("folder", "Open folder of key poses", "Key poses", (), start, self.opened.open)
        )

    def ask_for_new(self, to: str = "", done: Callable[[], object] = lambda: None) -> None:
        """Ask for the target, ``to`` at first, and the place of a new folder; ``done`` is called at the end."""
        self._created = done
        self.creation.show(to, done)

    def _create(self, folder: Path, source: str, target: str, proposal: Proposal) -> None:
        def work(progress: Progress) -> KeyFolder:
            return create_keys(folder, source, target, proposal=proposal, progress=progress)

        def created(keys: KeyFolder) -> None:
            self.opened.open(keys.folder)

        # The dialog that asked for them comes back in any case.
        self.work.run("New key poses", "The key poses were not created", work, created, self._created)

    def set_regions(self, regions: Regions) -> None:
        """Clone ``regions`` of the face separately, in the description of the folder."""
        keys = self.opened.keys
        if keys is not None and keys.folder.regions != regions:
            self._try(lambda: replace(keys.folder, regions=regions).write(), "The regions were not changed")
            self.opened.read()

    # Pairs

    def listed(self) -> list[ListedKey]:
        """Return the keys of the chosen kind: emotional and verbal ones, others, and compositions."""
        keys = () if self.opened.keys is None else self.opened.keys.keys
        chosen = [key for key in keys if not self.kind or key.kind == self.kind]
        return sorted(chosen, key=lambda key: _ORDER.index(key.kind))

    def show_left_out(self) -> None:
        """Show the next of the keys that are left out of the clone."""
        keys = self.opened.keys
        names = [] if keys is None else [key.name for key in keys.left_out]
        if names:
            following = names.index(self.latest) + 1 if self.latest in names else 0
            self.latest = self.sought = names[following % len(names)]
            self.kind = ""
            self.context.redraw()

    def poses_side(self, side: Side) -> bool:
        """Return True if the session poses the character of this side."""
        keys = self.opened.keys
        return (
            keys is not None
            and keys.is_of(side, self.context.session.model)
            and not (side == "target" and keys.folder.is_mesh)
        )

    def present_pose(self) -> NDArray[np.float64] | None:
        """Return the present pose of the source, shape (r,): of the session, or of the one before an edited key."""
        keys = self.opened.transferable
        session = self.context.session if self.editing.before is None else self.editing.before
        if keys is None or not keys.is_of("source", session.model):
            return None
        return keys.source_poses(session.model, session.coefficients[None])[0]

    def ask_to_add(self) -> None:
        """Ask for name and kind, and add the present pose of the source."""
        keys = self.opened.keys
        if keys is not None:
            self.adding.show({key.name: key.title for key in keys.keys}, not keys.folder.is_mesh)

    def _add(self, name: str, kind: str, replaces: bool) -> None:
        keys, session = self.opened.keys, self.context.session
        if keys is None:
            return
        session.wait()
        folder, pose = keys.folder, pose_of(session.model, session.coefficients, name, (kind,) if kind else ())

        def added(stem: str) -> None:
            self.latest = self.sought = stem
            if self.kind not in ("", kind):
                self.kind = ""
            self.context.notify(f"{'Replaced' if replaces else 'Added'} the key pose {pose.name}")

        self.work.run(
            "Add key pose",
            "The key pose was not added",
            lambda progress: add_key_pose(folder, pose, replaces, progress=progress),
            added,
        )

    def set_kind(self, key: ListedKey, kind: str) -> None:
        """Make ``key`` emotional ("expression"), verbal ("viseme") or neither ("")."""
        keys = self.opened.keys
        if keys is not None and key.kind != kind:
            self._try(lambda: set_kind(keys.folder, key.name, kind), "The kind was not changed")
            self.latest = self.sought = key.name
            self.opened.read()

    def replace_side(self, key: ListedKey, side: Side) -> None:
        """Replace one side of ``key`` by the present pose."""
        keys, session = self.opened.keys, self.context.session
        if keys is None:
            return

        def write() -> None:
            session.wait()
            save_key(keys.folder, key.name, side, session.model, session.coefficients)
            self.context.notify(f"Replaced the {side} of {key.title}")

        def replace() -> None:
            self._try(write, "The key pose was not replaced")
            self.opened.read()

        self._ask_to_overwrite(key, side, replace)

    def propose(self, key: ListedKey) -> None:
        """Propose the target's pose of ``key`` again."""
        keys = self.opened.keys
        if keys is None:
            return
        folder = keys.folder

        def propose() -> None:
            self.work.run(
                "Propose key pose",
                "Nothing was proposed",
                lambda progress: propose_again(folder, key.name),
                lambda _: self.context.notify(f"Proposed the target of {key.title}"),
            )

        self._ask_to_overwrite(key, "target", propose)

    def _ask_to_overwrite(self, key: ListedKey, side: Side, proceed: Callable[[], None]) -> None:
        """Ask before one side of ``key`` is lost, unless there is none, or only a proposal."""
        path = key.files.source if side == "source" else key.files.target
        is_mesh = path is not None and path.suffix.lower() != ".json"
        # Meshes are refused without a question.
        if path is None or is_mesh or (side == "target" and key.proposed):
            proceed()
            return
        text = "Its present pose is lost. This cannot be undone."
        choices = (Choice("Replace", proceed), Choice("Cancel"))
        self.context.dialogs.ask(Question(f"Replace the {side} of {key.title}?", text, choices, default=1))

    def ask_to_rename(self, key: ListedKey) -> None:
        """Ask for another name of ``key``."""
        keys = self.opened.keys
        if keys is None:
            return

        def rename(name: str, _: bool) -> None:
            self.latest = self.sought = rename_key(keys.folder, key.name, name)
            self.editing.renamed(key.name, self.latest, name)
            self.opened.read()

        self.context.toolbox.finish()
        self.naming.ask("Rename key pose", "Rename", key.title, rename)

    def ask_to_remove(self, key: ListedKey) -> None:
        """Ask whether to remove ``key``."""
        keys = self.opened.keys
        if keys is None:
            return

        def remove() -> None:
            self._try(lambda: keys.folder.remove(key.name), "The key pose was not removed")
            self.opened.read()

        text = "The files of both sides are deleted. This cannot be undone."
        choices = (Choice("Remove", remove), Choice("Cancel"))
        self.context.dialogs.ask(Question(f"Remove the key pose {key.title}?", text, choices, default=1))

    # All keys

    def compose(self) -> None:
        """Combine each emotional with each verbal key."""
        keys = self.opened.keys
        if keys is not None:
            folder = keys.folder
            self.work.run(
                "Compose key poses",
                "The key poses were not composed",
                lambda progress: compose_keys(folder, progress=progress),
                lambda report: self.context.notify(
                    f"Composed {counted(report.composed, 'key pose')}"
                    + (f"; kept {report.kept} that you changed" if report.kept else "")
                ),
            )

    def show_importance(self, side: Side) -> None:
        """Show how important each vertex of one side is for speech."""
        keys = self.opened.keys
        model = None if keys is None else keys.models[side]
        if keys is not None and model is not None:
            folder = keys.folder
            self.work.run(
                "Importance for speech",
                "The importance cannot be shown",
                lambda progress: drawn_importance(folder, side, progress),
                lambda picture: self.importance.show(picture, model.character.title),
            )

    def _try(self, command: Callable[[], object], failure: str) -> None:
        try:
            command()
        except FacePoserError as error:
            self.context.dialogs.report(failure, str(error))
