"""Editing of key poses: a side of a pair becomes the session, and is saved to its file."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.features.keys.open_keys import OpenKeys
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.document import Document
from faceposer.session.key_edits import save_key
from faceposer.session.key_folder import KeyFolder, Side
from faceposer.session.key_set import ListedKey
from faceposer.session.opening import session_for
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker
from faceposer.transfer.source_heads import is_same_rig, on_character

# Key poses are of the characters themselves, and their files have no head.
_HELD = "The head cannot be changed while a key pose is edited: go back from the key pose first."


@dataclass(frozen=True, eq=False)
class Edited:
    """The key that is edited.

    Attributes:
        folder: Folder of the key.
        name: Name of its files.
        title: Its name for the user.
        side: Side that is edited.
        session: Session with its pose.
    """

    folder: KeyFolder
    name: str
    title: str
    side: Side
    session: Session


class KeyEditing:
    """The edited key, and the session before it."""

    def __init__(self, context: EditorContext, opened: OpenKeys) -> None:
        """Edit keys of ``opened``."""
        self._context, self._opened = context, opened
        self._edited: Edited | None = None
        self._before: Session | None = None

    @property
    def edited(self) -> Edited | None:
        """The key in the window, or None."""
        edited = self._edited
        return edited if edited is not None and edited.session is self._context.session else None

    @property
    def changed(self) -> bool:
        """True if the edited key has changes that are not saved."""
        return self.edited is not None and self._context.session.dirty

    @property
    def before(self) -> Session | None:
        """The session that was edited before the first key, while a key is edited."""
        return self._before if self.edited is not None else None

    def edit(self, key: ListedKey, side: Side) -> None:
        """Show one side of ``key`` for editing, after a question about changes of another key.

        The session before the first key is put aside with its history and its unsaved changes.
        """
        keys = self._opened.keys
        edited = self.edited
        if self._context.busy or keys is None or (edited and (edited.name, edited.side) == (key.name, side)):
            return
        path = key.files.source if side == "source" else key.files.target
        if side == "target" and keys.folder.is_mesh:
            self._refuse(f"The target of '{keys.folder.folder}' is a mesh without shapes; sculpt its keys elsewhere.")
        elif path is not None and path.suffix.lower() != ".json":
            self._refuse(f"The key '{path}' is a mesh; change it in the program in which it was sculpted.")
        else:
            self._leave(lambda: self._open(keys.folder, key, side))

    def _refuse(self, reason: str) -> None:
        self._context.dialogs.report("The key pose cannot be edited here", reason)

    def _open(self, folder: KeyFolder, key: ListedKey, side: Side) -> None:
        context = self._context
        before = context.session if self.edited is None else self._before
        keys = self._opened.keys
        listed = None if keys is None else keys.models[side]

        def opening(worker: Worker) -> Session:
            document = Document(folder.character(side))
            session = session_for(document, None, worker)
            pose = key.poses[side]
            if pose is not None and listed is not None:
                # The character may have been made anew since the keys were read.
                if not is_same_rig(listed, session.model):
                    raise FacePoserError(f"The character '{document.character}' has changed; try again.")
                pose = on_character(session.model, listed, pose[None])[0]
                document = session.document.with_start(pose).posed(pose)
                session = Session(session.base_model, document, worker)
            session.head_held = _HELD
            return session

        if context.show_session(opening, "The key pose cannot be edited"):
            self._edited = Edited(folder, key.name, key.title, side, context.session)
            self._before = before
            context.notify(f"Editing the {side} of {key.title}")

    def save(self) -> None:
        """Save the edited key, which changes the clone."""
        self._save()

    def _save(self) -> bool:
        edited, context = self.edited, self._context
        if edited is None:
            return False
        context.toolbox.finish()
        session = context.session
        try:
            session.wait()
            save_key(edited.folder, edited.name, edited.side, session.model, session.coefficients)
        except FacePoserError as error:
            context.dialogs.report("The key pose was not saved", str(error))
            return False
        session.mark_saved()
        context.notify(f"Saved the key pose {edited.title}")
        self._opened.read()
        return True

    def renamed(self, name: str, new: str, title: str) -> None:
        """Edit on if the key ``name`` that is edited has been renamed to ``new``, with another title for the user."""
        if self._edited is not None and self._edited.name == name:
            self._edited = replace(self._edited, name=new, title=title)

    def back(self) -> None:
        """Return to the session before the first key, with its history."""
        self._leave(self._restore)

    def leave(self, proceed: Callable[[], None]) -> bool:
        """Ask about the key, then about the session that was put aside; return False if no key is edited."""
        if self.edited is None:
            return False

        def ask_about_session() -> None:
            if self._before is not None and self._before.dirty:
                self._restore()
                self._context.guard_changes(proceed)
            else:
                proceed()

        self._leave(ask_about_session)
        return True

    def _restore(self) -> None:
        before = self._before
        if before is None:
            return

        def opening(worker: Worker) -> Session:
            # Its solver ended when it was left.
            before.worker = worker
            return before

        if self._context.show_session(opening, "The session cannot be shown"):
            self._edited = self._before = None

    def _leave(self, proceed: Callable[[], None]) -> None:
        """Ask about unsaved changes of the key, then call ``proceed`` unless the user cancels."""
        context, edited = self._context, self.edited
        context.toolbox.finish()
        context.slider_edit.let_go()
        if edited is None or not context.session.dirty:
            proceed()
            return

        def save() -> None:
            if self._save():
                proceed()

        choices = (Choice("Save", save), Choice("Don't save", proceed), Choice("Cancel"))
        text = "Changes of the key pose will be lost unless you save them."
        context.dialogs.ask(Question(f"Save the key pose {edited.title}?", text, choices))
