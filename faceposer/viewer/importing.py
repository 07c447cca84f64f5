"""A character of one's own from files: what the user asks for, the learning beside the frames, and what came of it."""

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from faceposer.errors import FacePoserError
from faceposer.viewer.panels.dialogs import Choice, Question
from faceposer.viewer.settings import last_folder

if TYPE_CHECKING:
    from faceposer.training.kinds import Kind
    from faceposer.training.request import TrainingRequest
    from faceposer.viewer.app import App

Page = Literal["form", "running", "summary"]
Regions = Literal["face", "whole", "parts"]

# Seconds between two wakings of the frame loop: progress may come for each of thousands of meshes.
_WAKE_EVERY = 0.07


@dataclass
class ImportForm:
    """What the user has entered; paths as they were typed, "" where nothing was.

    Attributes:
        source: What to learn from.
        kind: Of the source.
        captures: Performances, for a rig.
        neutral: The neutral mesh.
        marker_map: Where the markers are.
        scan: What the markers move: a subject or a mesh.
        regions: Which regions of examples get modes of their own; "parts" are ``n_parts`` found by their motion.
        n_parts: From 2 to 12.
        dimensions: Number of modes, 0 to choose it by the data; likewise ``components`` and ``factors`` of the prior.
        title: Name to show.
        credits: Where the character comes from, and its licence.
        output: The subject file to write.
        proposed: Title and output that follow from the source; what differs from them, the user has entered.
    """

    source: str = ""
    kind: "Kind" = "rig"
    captures: list[str] = field(default_factory=list)
    neutral: str = ""
    marker_map: str = ""
    scan: str = "man"
    regions: Regions = "face"
    n_parts: int = 6
    dimensions: int = 0
    components: int = 0
    factors: int = 0
    title: str = ""
    credits: str = ""
    output: str = ""
    proposed: tuple[str, str] = ("", "")

    @property
    def takes_neutral(self) -> bool:
        """Whether a neutral mesh can be told: a glTF file has its own, markers their first frame."""
        return self.kind == "examples" or (self.kind == "rig" and bool(self.source) and _path(self.source).is_dir())

    def follow_source(self, fallback: Path) -> None:
        """Guess the kind of the source, and propose title and output unless they are the user's own.

        Args:
            fallback: Folder for the output where that of the source cannot be written to.
        """
        from faceposer.training.kinds import kind_of, plain_name

        path = _path(self.source)
        if not self.source.strip() or not path.exists():
            return
        try:
            self.kind = kind_of(path)
        except FacePoserError:
            # Whatever it is, learning says what is wrong with it.
            return
        name = plain_name(path)
        folder = path.parent.absolute()
        output = (folder if os.access(folder, os.W_OK) else fallback.absolute()) / f"{name}.npz"
        if output == path.absolute():
            output = output.with_stem(f"{name}-character")
        before, self.proposed = self.proposed, (name.replace("-", " ").capitalize(), str(output))
        if self.title in ("", before[0]):
            self.title = self.proposed[0]
        if self.output in ("", before[1]):
            self.output = self.proposed[1]

    def checked_output(self) -> Path:
        """Return the file to write.

        Raises:
            FacePoserError: If something is missing, or it could not be written.
        """
        if not self.source.strip():
            raise FacePoserError("Choose what to learn the character from.")
        if self.kind == "markers" and not self.marker_map.strip():
            raise FacePoserError("Choose the map that says where on the scan each marker is.")
        if not self.output.strip():
            raise FacePoserError("Say where to save the character.")
        path = _path(self.output)
        if not path.suffix:
            path = path.with_name(f"{path.name}.npz")
        if path.suffix.lower() != ".npz":
            raise FacePoserError(f"A character is saved as .npz, and '{path.name}' ends in '{path.suffix}'.")
        if path.is_dir():
            raise FacePoserError(f"'{path}' is a folder; give the name of a file.")
        if not path.parent.is_dir():
            raise FacePoserError(f"There is no folder '{path.parent}'; make it first.")
        if path.exists() and path.samefile(_path(self.source)):
            raise FacePoserError(f"'{path.name}' is what is learned from; save the character under another name.")
        return path

    def request(self, output: Path) -> "TrainingRequest":
        """Return the form as the request that learning understands."""
        from faceposer.training.kinds import plain_name
        from faceposer.training.request import TrainingRequest

        name = plain_name(output)
        return TrainingRequest(
            kind=self.kind,
            source=_path(self.source),
            name=name,
            title=self.title.strip() or name.replace("-", " ").capitalize(),
            captures=tuple(_path(text) for text in self.captures) if self.kind == "rig" else (),
            neutral=_path(self.neutral) if self.neutral.strip() and self.takes_neutral else None,
            marker_map=_path(self.marker_map) if self.kind == "markers" else None,
            scan=self.scan.strip() or "man",
            segments=self.n_parts if self.regions == "parts" else self.regions,
            n_dimensions=(self.dimensions or None) if self.kind != "rig" else None,
            n_components=self.components or None,
            n_factors=self.factors or None,
            credits=self.credits.strip(),
        )


class Training:
    """One learning, in a thread of its own, from the form to the file.

    Attributes:
        output: The file that it writes, all or nothing.
        stage: What it does now.
        share: How much of that is done, 0 where nobody knows.
        about: What was learned (``description_of``), or None as long as there is nothing.
        error: What ended it early, or None.
    """

    def __init__(self, form: ImportForm, output: Path, wake: Callable[[], None]) -> None:
        """Begin to learn what ``form`` asks for; ``wake`` is called from the thread when there is news."""
        self.output = output
        self.stage, self.share = "Getting ready", 0.0
        self.about: dict[str, Any] | None = None
        self.error: Exception | None = None
        self._form = replace(form, captures=list(form.captures))
        self._wake = wake
        self._woken = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="training")
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return not self._thread.is_alive()

    @property
    def stopping(self) -> bool:
        """Whether the user has stopped it."""
        return self._stop.is_set()

    def stop(self) -> None:
        """Let it end at the next step, with nothing written."""
        self._stop.set()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            # Here and not above: the libraries behind take more than a second to load.
            from faceposer.model.subject_file import save_subject
            from faceposer.training.progress import Progress
            from faceposer.training.request import train
            from faceposer.training.summary import description_of

            progress = Progress(self._show, self._stop.is_set)
            progress.at("Getting ready")
            subject = train(self._form.request(self.output), progress)
            progress.at("Saving")
            save_subject(self.output, subject)
            self.about = description_of(subject)
        except Exception as error:  # it is told in the window, not here
            self.error = error
        self._wake()

    def _show(self, stage: str, share: float) -> None:
        self.stage, self.share = stage, share
        now = time.monotonic()
        if now - self._woken > _WAKE_EVERY:
            self._woken = now
            self._wake()


class Importing:
    """The dialog's state: which page is shown, and what is on it.

    Attributes:
        open: Whether the dialog is shown.
        form: What the user has entered; kept until a character came of it.
        error: What was wrong with it, one sentence, or "".
        training: The learning under way, or the last one.
        about: What was learned last.
    """

    def __init__(self, app: "App", wake: Callable[[], None]) -> None:
        """Serve ``app``; ``wake`` ends the sleep of its loop, from any thread."""
        self._app = app
        self._wake = wake
        self.open = False
        self.form = ImportForm()
        self.error = ""
        self.training: Training | None = None
        self.about: dict[str, Any] | None = None

    @property
    def page(self) -> Page:
        """What the dialog shows."""
        if self.training is not None:
            return "running"
        return "form" if self.about is None else "summary"

    @property
    def running(self) -> bool:
        """Whether something is being learned."""
        return self.training is not None

    # The form

    def show(self, source: str = "") -> None:
        """Open the dialog, with ``source`` filled in if given."""
        if self.running:
            return
        self._app.toolbox.finish()
        self._app.slider_edit.let_go()
        self.open, self.about, self.error = True, None, ""
        if source:
            self.set_source(source)
        self._app.redraw()

    def close(self) -> None:
        """Put the dialog away; what was entered is there the next time."""
        self.open, self.about, self.error = False, None, ""
        self._app.redraw()

    def set_source(self, source: str) -> None:
        """Learn from ``source``, whose kind is guessed."""
        if source == self.form.source:
            return
        self.form.source, self.error = source, ""
        self.form.follow_source(last_folder(self._app.settings))

    def takes(self, path: str) -> bool:
        """Whether a file or folder that was dropped is something for this dialog."""
        from faceposer.geometry.gltf_io import GLTF_SUFFIXES
        from faceposer.training.kinds import MARKER_SUFFIXES

        on_form = self.open and self.page == "form"
        suffix = Path(path).suffix.lower()
        return Path(path).is_dir() or suffix in (*GLTF_SUFFIXES, *MARKER_SUFFIXES) or (on_form and suffix == ".npz")

    def drop(self, paths: tuple[str, ...]) -> None:
        """Take what was dropped: a source, or performances for the rig that is the source already."""
        if self.running:
            return
        csv = [path for path in paths if path.lower().endswith(".csv")]
        if self.open and self.page == "form" and self.form.source and self.form.kind == "rig" and csv:
            self.form.captures += [path for path in csv if path not in self.form.captures]
        else:
            self.show(paths[0])
        self._app.redraw()

    # Learning

    def start(self) -> None:
        """Learn what the form asks for, after asking whether a file that is there may be replaced."""
        self.error = ""
        try:
            output = self.form.checked_output()
        except FacePoserError as error:
            self.error = str(error)
            return
        if not output.exists():
            self._train(output)
            return
        self._app.dialogs.ask(
            Question(
                f"Replace {output.name}?",
                f"There is a file of this name in '{output.parent}'.",
                (Choice("Replace", lambda: self._train(output)), Choice("Cancel")),
                default=1,
            )
        )

    def _train(self, output: Path) -> None:
        self.form.output = str(output)
        self.training = Training(self.form, output, self._wake)
        self._app.redraw()

    def stop(self) -> None:
        """Stop learning; nothing is written."""
        if self.training is not None:
            self.training.stop()

    def follow(self) -> None:
        """Show what there is to be known of the learning under way.

        Raises:
            Exception: What went wrong in it, unless the user can mend it or wanted it.
        """
        training = self.training
        if training is None:
            return
        # One frame, not several as after an event: the bar moves many times a second.
        self._app.redraw(1)
        if not training.done:
            return
        self.training = None
        self._app.redraw()
        if training.about is not None:
            self.about = training.about | {"path": str(training.output)}
            self.form = ImportForm()
            return
        from faceposer.training.progress import TrainingCancelled

        if isinstance(training.error, TrainingCancelled):
            return
        if isinstance(training.error, FacePoserError):
            self.error = str(training.error)
        elif isinstance(training.error, MemoryError):
            self.error = "There is not enough memory for this; learn from fewer or from smaller meshes."
        elif training.error is not None:
            raise training.error

    def open_learned(self) -> None:
        """Pose the new character, after asking about changes that are not saved."""
        if self.about is not None:
            path = self.about["path"]
            self.close()
            self._app.files.open(path)

    def end(self) -> None:
        """Stop what is under way and wait for it, so that it can clear away what it has begun."""
        if self.training is not None:
            self.training.stop()
            self.training.join()


def _path(text: str) -> Path:
    """Return the path that was typed or pasted; some systems copy paths in quotation marks."""
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        text = text[1:-1]
    return Path(text).expanduser()
