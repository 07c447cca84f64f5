"""Opening, saving and closing: unsaved work is never lost without a question."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from faceposer.errors import FacePoserError, MissingCharacterError, NoSessionError
from faceposer.files import paths
from faceposer.files.key_places import check_not_key
from faceposer.gui.actions import Action
from faceposer.gui.context import EditorContext
from faceposer.gui.missing_character import ask_for_character
from faceposer.gui.recent_files import RecentFiles
from faceposer.gui.settings import MAX_CHARACTERS, last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.interchange.meshes import foreign_library, write_posed_obj
from faceposer.session.character_library import SUFFIX as CHARACTER_SUFFIX
from faceposer.session.file_kinds import Kind, kind_of
from faceposer.session.on_disk import OpenFile, open_files_folder
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker

# Suffixes of the files that can be opened: sessions and characters.
SUFFIXES = (".json", ".npz")
_ANIMATION = "Performances are opened with Animate > Open animation"
_POINTS = (
    "Recorded points are followed with Animate > Open trajectories, and markers learned from with File > Import "
    "character"
)
# Commands for files of other kinds.
_REMEDIES: dict[Kind, str] = {
    "performance": _ANIMATION,
    "weights": f"{_ANIMATION}, and a pose of weights with File > Open pose",
    "trajectories": _POINTS,
    "table": f"{_ANIMATION}. {_POINTS}",
    "pose": "Poses of the library are in View > Poses",
    "rig": f"Rigs are imported with File > Import character. {_ANIMATION}",
    "mesh": "Posed meshes are opened with File > Open pose, and folders of shapes with File > Import character",
    "photo": "Photos are opened with File > Open photo, or dropped onto the window while no dialog is open",
    "drawing": "Drawings (.svg) are opened with File > Open drawing, and strokes of a file by 'faceposer sketch'",
    "folder": "Folders of shapes or expressions are imported with File > Import character",
}


class SessionFiles:
    """Commands of the File menu."""

    def __init__(
        self,
        context: EditorContext,
        new_worker: Callable[[], Worker],
        set_session: Callable[[Session], None],
        quit_question: Callable[[], Question | None],
        leave: Callable[[Callable[[], None]], bool],
        end: Callable[[], None],
    ) -> None:
        """Act on ``context``.

        Args:
            context: The editor.
            new_worker: Returns a solver for a session.
            set_session: Changes the edited session.
            quit_question: Returns the question of features before the window closes, if any.
            leave: Asks about work of features before the session is left; returns True if it goes on by itself.
            end: Closes the window.
        """
        self._context = context
        self._new_worker, self._set_session = new_worker, set_session
        self._quit_question, self._leave, self._end = quit_question, leave, end
        self.export_path: Path | None = None
        self.meshes_saved = 0
        self._open_file = OpenFile(open_files_folder()) if context.keeps_journal else None
        self.recent = RecentFiles(context)
        self._shared: Path | None = None

    @property
    def title(self) -> str:
        """Title of the window: the name of the document, with an asterisk if it has unsaved changes."""
        session = self._context.session
        name = session.path.name if session.path else f"{session.model.character.title} (not saved)"
        return f"{name}{'*' if session.dirty else ''} - Face Poser"

    # Opening

    def open_dialog(self) -> None:
        """Ask for a session or character file and open it."""
        self._context.ask_for_file(
            FileRequest(
                "open",
                "Open a session or a character",
                "Sessions and characters",
                SUFFIXES,
                last_folder(self._context.settings),
                lambda path: self.open(str(path)),
            )
        )

    def open(self, what: str) -> None:
        """Open the character or session ``what``, after asking about unsaved changes.

        The session that is open is reverted to its file instead: to save it first would overwrite the file.
        """
        if self._is_open(what):
            self._revert(what)
        else:
            self.guard(lambda: self._open(what))

    def _is_open(self, what: str) -> bool:
        path = self._context.session.path
        if path is None or Path(what).suffix.lower() != ".json":
            return False
        return paths.resolved(what) == paths.resolved(path)

    def _revert(self, what: str) -> None:
        """Open the session's file ``what`` again, after a warning about unsaved changes."""
        context = self._context
        context.toolbox.finish()
        context.slider_edit.let_go()
        if not context.session.dirty:
            self._open(what)
            return
        context.dialogs.ask(
            Question(
                f"Revert to the saved {Path(what).name}?",
                "The session has unsaved changes, which will be lost.",
                (Choice("Revert", lambda: self._open(what)), Choice("Cancel")),
                default=1,
            )
        )

    def _open(self, what: str, character: str = "") -> None:
        """Open ``what``, a session with another ``character`` if that is given, and ask for one if it is missing."""

        def ask(error: MissingCharacterError) -> None:
            ask_for_character(self._context, error, lambda other: self._open(what, other))

        def opening(worker: Worker) -> Session:
            session = open_session(what, worker, character)
            if character:
                session.mark_unsaved()
            return session

        missing = ask if Path(what).suffix.lower() == ".json" else None
        if self.show(opening, "The file cannot be opened", missing=missing):
            self.remember(what)

    def remember(self, what: str) -> None:
        """Add the opened ``what`` to the recent files, and its character to the known ones, if they are files."""
        if Path(what).suffix.lower() in SUFFIXES:
            self.recent.add(Path(what))
        context = self._context
        character = context.session.document.character
        if Path(character).suffix.lower() == CHARACTER_SUFFIX and not context.characters.holds(character):
            path = str(paths.absolute(paths.expand_user(character)))
            others = [known for known in context.settings.characters if known != path]
            context.settings.characters = [path, *others][:MAX_CHARACTERS]

    def new(self, character: str = "") -> None:
        """Start a new session with the ``character`` of this name or path, or the present one if "".

        The user is first asked about unsaved changes.
        """
        self.open(character or self._context.session.document.character)

    def new_with(self) -> list[Action]:
        """Return an action for each character that starts a new session with it."""
        known = self._context.characters.all(self._context.settings.characters)
        return [
            Action(f"new:{entry.name}", entry.title, "File", lambda name=entry.name: self.new(name))  # type: ignore[misc]
            for entry in known
        ]

    def show(
        self,
        opening: Callable[[Worker], Session],
        failure: str,
        remedy: str = "",
        missing: Callable[[MissingCharacterError], None] | None = None,
    ) -> bool:
        """Edit the session that ``opening`` returns; the caller has asked about unsaved changes.

        Args:
            opening: Called with the solver for the session; its FacePoserError is reported, and nothing changes.
            failure: Title of that report.
            remedy: Text appended to the error.
            missing: Called in place of the report if the character is not found.

        Returns:
            True on success.
        """
        context = self._context
        worker = self._new_worker()
        try:
            session = opening(worker)
        except FacePoserError as error:
            worker.close()
            if missing is not None and isinstance(error, MissingCharacterError):
                missing(error)
            else:
                command = _remedy(Path(error.path)) if isinstance(error, NoSessionError) else ""
                context.dialogs.report(failure, f"{error}{command}{remedy}")
            return False
        except Exception:
            worker.close()
            raise
        if session.path is not None:
            context.settings.folder = str(paths.resolved(session.path.parent))
        self.export_path = None
        self._set_session(session)
        return True

    # Saving

    def save(self, then: Callable[[], None] | None = None) -> None:
        """Save the session, asking for a path the first time, then call ``then``."""
        path = self._context.session.path
        if path is None or not paths.is_dir(path.parent):
            # There is no folder to save in, or no longer.
            self.save_as(then)
        else:
            self._save(path, then)

    def save_as(self, then: Callable[[], None] | None = None) -> None:
        """Ask for a path and save the session."""
        context = self._context
        start = context.session.path
        if start is None or not paths.can_enter(start.parent):
            name = f"{_stem(context.session.document.character)}.json" if start is None else start.name
            start = last_folder(context.settings) / name
        request = FileRequest(
            "save", "Save the session", "Sessions", (".json",), start, lambda path: self._save(path, then)
        )
        context.ask_for_file(request)

    def _save(self, path: Path, then: Callable[[], None] | None = None) -> None:
        """Save to ``path``, after asking if another program has changed the session's file."""
        context = self._context
        if self._is_open(str(path)) and context.session.changed_on_disk():
            context.dialogs.ask(
                Question(
                    f"Replace {path.name}?",
                    "Another program or window has changed this file since it was opened or saved here. Replacing it "
                    "discards these changes.",
                    (
                        Choice("Replace", lambda: self._write(path, then)),
                        Choice("Save as...", lambda: self.save_as(then)),
                        Choice("Cancel"),
                    ),
                    bad=True,
                    default=1,
                )
            )
            return
        self._write(path, then)

    def _write(self, path: Path, then: Callable[[], None] | None = None) -> None:
        context = self._context
        try:
            context.session.wait()
            context.session.save(path, context.viewport.camera)
        except FacePoserError as error:
            context.dialogs.report("The session was not saved", str(error))
            return
        context.settings.folder = str(paths.resolved(path.parent))
        self.tell_of_other_window()
        self.recent.add(path)
        context.notify(f"Saved {path.name}")
        if then is not None:
            then()

    def tell_of_other_window(self) -> None:
        """Hold the session's file, or tell the user that another window has it open."""
        path = self._context.session.path
        if self._open_file is None or self._open_file.hold(path) or path is None or self._shared == path:
            return
        self._shared = path
        self._context.dialogs.ask(
            Question(
                f"{path.name} is open in another window",
                "Both windows can save it. You will be asked before saving here replaces what was saved there.",
            )
        )

    def close(self) -> None:
        """Release the session's file for other windows."""
        if self._open_file is not None:
            self._open_file.release()

    # Export

    def export(self) -> None:
        """Save the posed face as OBJ to the last path, asking the first time."""
        if self.export_path is None:
            self.export_as()
        else:
            self._export(self.export_path)

    def export_as(self) -> None:
        """Ask for a path and save the posed face as OBJ."""
        context = self._context
        session = context.session
        last = Path(context.settings.export_path)
        usable = context.settings.export_path and paths.can_enter(last.parent)
        folder = last.parent if usable else last_folder(context.settings)
        stem = session.path.stem if session.path else _stem(session.document.character)
        start = self.export_path or folder / f"{stem}.obj"
        context.ask_for_file(
            FileRequest(
                "save",
                "Save the posed face as OBJ",
                "Meshes",
                (".obj",),
                start,
                self._export,
                beside=self._overwritten_library,
            )
        )

    def _overwritten_library(self, path: Path) -> tuple[Path, ...]:
        return foreign_library(path) if self._context.settings.materials else ()

    def _export(self, path: Path) -> None:
        context = self._context
        session = context.session
        try:
            session.wait()
            contact, materials = session.document.contact, context.settings.materials
            check_not_key(path)
            write_posed_obj(path, session.model, session.coefficients, contact, materials)
        except FacePoserError as error:
            context.dialogs.report("The mesh was not saved", str(error))
            return
        self.meshes_saved += 1
        self.export_path = paths.resolved(path)
        context.settings.export_path = str(self.export_path)
        context.notify(f"Saved {path.name}")

    # Closing

    def quit(self) -> None:
        """Close the window, after asking about running jobs and unsaved changes."""
        question = self._quit_question()
        if question is None:
            self.guard(self._end)
            return
        go_on, *others = question.choices
        choices = (Choice(go_on.label, lambda: self.guard(self._end)), *others)
        self._context.dialogs.ask(replace(question, choices=choices, holds=lambda: self._quit_question() is not None))

    def guard(self, go_on: Callable[[], None]) -> None:
        """Ask about unsaved changes, then call ``go_on``; without such changes, call it at once."""
        context = self._context
        context.toolbox.finish()
        context.slider_edit.let_go()
        if self._leave(go_on):
            return
        if not context.session.dirty:
            go_on()
            return
        name = context.session.path.name if context.session.path else "the session"
        context.dialogs.ask(
            Question(
                f"Save {name}?",
                "Unsaved changes will be lost unless you save them.",
                (
                    Choice("Save", lambda: self.save(go_on)),
                    Choice("Don't save", go_on),
                    Choice("Cancel"),
                ),
            )
        )


def _remedy(path: Path) -> str:
    """Return the sentence about the command of the window for a file that is not a session, with a space, or ""."""
    text = _REMEDIES.get(kind_of(path), "")
    return f" {text}." if text else ""


def _stem(character: str) -> str:
    return Path(character).stem
