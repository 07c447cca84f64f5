"""State of the dialog that animates the face by a film: the part that is used, the work, and its result."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from faceposer.animation.keyframes import Keyframes
from faceposer.errors import FacePoserError
from faceposer.film.film import Film, Span, check_span, seconds_of
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob

if TYPE_CHECKING:
    from faceposer.film.expression import FilmExpression
    from faceposer.gui.features.film.stills import Stills

# Share of the time after which keys are chosen.
_KEYS = 0.97

Page = Literal["form", "working", "result"]


@dataclass(frozen=True, eq=False)
class MadeKeys:
    """What the work returns: the expressions, with a key at every frame, and with few keys."""

    found: "FilmExpression"
    dense: Keyframes
    few: Keyframes


class FilmState:
    """State of the dialog that animates the face by a film.

    Attributes:
        context: The editor.
        open: True while the dialog is shown.
        film: The film, or None.
        start: Beginning of the part that is used, as typed.
        end: Its end, as typed; "" for that of the film.
        colours: Follow the colours of the face, too.
        error: Reason why the last step failed, one sentence, or "".
        job: The work in progress, or None.
        result: The keys that were made, or None.
        stills: Small pictures of the film that is followed, or None.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.open = False
        self.film: Film | None = None
        self.start, self.end, self.colours = "", "", True
        self.error = ""
        self.job: ThreadJob[MadeKeys] | None = None
        self.result: MadeKeys | None = None
        self.stills: Stills | None = None

    @property
    def page(self) -> Page:
        """Current page of the dialog."""
        if self.job is not None:
            return "working"
        return "form" if self.result is None else "result"

    def close_dialog(self) -> None:
        """Close the dialog; its film is forgotten."""
        self.open, self.error, self.result, self.film = False, "", None, None
        self.stills = None
        self.context.redraw()

    def follow(self) -> None:
        """Follow the face in the background."""
        from faceposer.gui.features.film.stills import Stills

        assert self.film is not None
        try:
            times = [seconds_of(text) if text.strip() else None for text in (self.start, self.end)]
        except ValueError as error:
            self.error = f"'{error}' is no time in seconds such as 12.5, nor 1:02.5."
            return
        span = Span(times[0] or 0.0, times[1])
        if span.end is not None and span.end <= span.start:
            self.error = "The end of the part is not after its beginning; give a later time."
            return
        try:
            check_span(self.film, span)
        except FacePoserError as error:
            self.error = str(error)
            return
        self.error, self.stills = "", Stills()
        work = partial(_work, self.film.path, self.context.session.model, span, self.colours, self.stills)
        self.job = ThreadJob(work, self.context.wake, "Opening the film")
        self.context.redraw()

    def back(self) -> None:
        """Return to the form, with its part as it was, and forget the result."""
        self.result = None
        self.context.redraw()

    def ask_to_discard(self) -> None:
        """Close the dialog after a question, since the result is lost."""
        choices = (Choice("Discard", self.close_dialog), Choice("Cancel"))
        text = "To have it again, the film has to be followed again."
        self.context.dialogs.ask(Question("Discard the animation of the film?", text, choices, default=1))

    def stop(self) -> None:
        """Cancel the work; the animation stays as it is."""
        if self.job is not None:
            self.job.cancel()

    def take(self, few: bool) -> None:
        """Set the keys, ``few`` of them or one at every frame, as one step of the history, and close the dialog."""
        raise NotImplementedError


def _work(path: Path, model: FaceModel, span: Span, colours: bool, stills: "Stills", progress: Progress) -> MadeKeys:
    from faceposer.film.expression import expression_of_film

    found = expression_of_film(
        path, model, span=span, colours=colours, progress=progress.part(0.0, _KEYS), watch=stills.watch
    )
    progress.at("Choosing keys", _KEYS)
    return MadeKeys(found, Keyframes.of_performance(found.performance), found.keys(model, progress))
