"""Opening, saving and leaving: nothing of the user's work is dropped without asking."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import FacePoserError
from faceposer.interchange.meshes import write_posed_obj
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker
from faceposer.viewer.file_dialogs import FileRequest
from faceposer.viewer.panels.dialogs import Choice, Question
from faceposer.viewer.recent import RecentFiles
from faceposer.viewer.settings import last_folder

if TYPE_CHECKING:
    from faceposer.viewer.app import App

# Of what can be opened by its path: sessions and subjects.
SUFFIXES = (".json", ".npz")


class Files:
    """What the File menu does."""

    def __init__(self, app: "App") -> None:
        """Serve ``app``."""
        self._app = app
        self.export_path: Path | None = None
        self.meshes_saved = 0
        self.recent = RecentFiles(app)

    @property
    def title(self) -> str:
        """Name of the document, with an asterisk if a save would keep something that its file does not have."""
        session = self._app.session
        name = session.path.name if session.path else f"{session.model.subject.title} (not saved)"
        return f"{name}{'*' if session.dirty else ''} - Face Poser"

    # Opening

    def open_dialog(self) -> None:
        """Ask for a session or a subject and open it."""
        self._app.dialogs_ask(
            FileRequest(
                "open",
                "Open a session or a subject",
                "Sessions and subjects",
                SUFFIXES,
                last_folder(self._app.settings),
                lambda path: self.open(str(path)),
            )
        )

    def open(self, what: str) -> None:
        """Open the subject or session ``what``, after asking about changes that are not saved.

        Of the session that is open already, one can only want what its file holds, and to save would write over that.
        """
        if self._is_open(what):
            self._revert(what)
        else:
            self.guard(lambda: self._open(what))

    def _is_open(self, what: str) -> bool:
        path = self._app.session.path
        return path is not None and Path(what).suffix.lower() == ".json" and Path(what).resolve() == path.resolve()

    def _revert(self, what: str) -> None:
        """Open the file ``what`` of the session again, after asking whether changes may be lost."""
        app = self._app
        app.toolbox.finish()
        app.slider_edit.let_go()
        if not app.session.dirty:
            self._open(what)
            return
        app.dialogs.ask(
            Question(
                f"Revert to the saved {Path(what).name}?",
                "It is open, with changes that are not saved. They will be lost.",
                (Choice("Revert", lambda: self._open(what)), Choice("Cancel")),
                default=1,
            )
        )

    def _open(self, what: str) -> None:
        if self.show(lambda worker: open_session(what, worker), "This cannot be opened"):
            self.remember(what)

    def remember(self, what: str) -> None:
        """Put ``what``, which was opened, among the recent files if it is a file."""
        if Path(what).suffix.lower() in SUFFIXES:
            self.recent.add(Path(what))

    def show(self, opening: Callable[[Worker], Session], failure: str, comfort: str = "") -> bool:
        """Edit the session that ``opening`` gives; the caller has asked about changes that are not saved.

        Args:
            opening: Is given what solves for the session; a FacePoserError of it is told, and nothing changes.
            failure: Title of what is told then.
            comfort: Is added to the error.

        Returns:
            Whether there was one.
        """
        app = self._app
        worker = app.new_worker()
        try:
            session = opening(worker)
        except FacePoserError as error:
            worker.close()
            app.dialogs.report(failure, f"{error}{comfort}")
            return False
        except Exception:
            worker.close()
            raise
        if session.path is not None:
            app.settings.folder = str(session.path.parent.resolve())
        self.export_path = None
        app.set_session(session)
        return True

    # Saving

    def save(self, then: Callable[[], None] | None = None) -> None:
        """Save the session, asking where the first time; go on with ``then`` once it is saved."""
        path = self._app.session.path
        if path is None:
            self.save_as(then)
        else:
            self._save(path, then)

    def save_as(self, then: Callable[[], None] | None = None) -> None:
        """Ask where and save the session there."""
        app = self._app
        start = app.session.path or last_folder(app.settings) / f"{_stem(app.session.document.subject)}.json"
        request = FileRequest(
            "save", "Save the session", "Sessions", (".json",), start, lambda path: self._save(path, then)
        )
        app.dialogs_ask(request)

    def _save(self, path: Path, then: Callable[[], None] | None = None) -> None:
        app = self._app
        try:
            app.session.wait()
            app.session.save(path, app.viewport.camera)
        except FacePoserError as error:
            app.dialogs.report("The session is not saved", str(error))
            return
        app.settings.folder = str(path.parent.resolve())
        self.recent.add(path)
        app.notify(f"Saved {path.name}")
        if then is not None:
            then()

    # Export

    def export(self) -> None:
        """Write the posed face as OBJ where it went last, asking the first time."""
        if self.export_path is None:
            self.export_as()
        else:
            self._export(self.export_path)

    def export_as(self) -> None:
        """Ask where and write the posed face as OBJ there."""
        app = self._app
        session = app.session
        last = Path(app.settings.export_path)
        folder = last.parent if app.settings.export_path and last.parent.is_dir() else last_folder(app.settings)
        stem = session.path.stem if session.path else _stem(session.document.subject)
        start = self.export_path or folder / f"{stem}.obj"
        app.dialogs_ask(FileRequest("save", "Save the posed face as OBJ", "Meshes", (".obj",), start, self._export))

    def _export(self, path: Path) -> None:
        app = self._app
        try:
            app.session.wait()
            write_posed_obj(path, app.session.model, app.session.coefficients, app.session.document.contact)
        except FacePoserError as error:
            app.dialogs.report("The mesh is not saved", str(error))
            return
        self.meshes_saved += 1
        self.export_path = path.resolve()
        app.settings.export_path = str(self.export_path)
        app.notify(f"Saved {path.name}")

    # Leaving

    def quit(self) -> None:
        """Close the window, after asking about a character that is being learned and changes that are not saved."""
        app = self._app
        if not app.importing.running:
            self.guard(app.close_soon)
            return
        app.dialogs.ask(
            Question(
                "Stop learning and quit?",
                "A character is being learned. What has been learned of it so far would be lost.",
                (Choice("Stop and quit", lambda: self.guard(app.close_soon)), Choice("Go on learning")),
                default=1,
            )
        )

    def guard(self, go_on: Callable[[], None]) -> None:
        """Ask what to do with changes that are not saved, then go on; without any, go on at once."""
        app = self._app
        app.toolbox.finish()
        app.slider_edit.let_go()
        if not app.session.dirty:
            go_on()
            return
        name = app.session.path.name if app.session.path else "this pose"
        app.dialogs.ask(
            Question(
                f"Save {name}?",
                "It has changes that are not saved. Without saving they are lost.",
                (
                    Choice("Save", lambda: self.save(go_on)),
                    Choice("Don't save", go_on),
                    Choice("Cancel"),
                ),
            )
        )


def _stem(subject: str) -> str:
    return Path(subject).stem
