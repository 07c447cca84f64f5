"""Question when the character of a session is not found: another one can be chosen."""

from collections.abc import Callable
from pathlib import Path

from faceposer.errors import MissingCharacterError
from faceposer.files import paths
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.session.character_library import SUFFIX


def ask_for_character(context: EditorContext, error: MissingCharacterError, done: Callable[[str], None]) -> None:
    """Report ``error`` and offer the present character or one from a file, with which ``done`` is called."""
    present, title = context.session.document.character, context.session.model.character.title
    library = context.characters.folder
    start = library if paths.is_dir(library) else last_folder(context.settings)

    def choose() -> None:
        context.ask_for_file(
            FileRequest("open", "Choose character", "Characters", (SUFFIX,), start, lambda path: done(str(path)))
        )

    context.dialogs.ask(
        Question(
            f"The character '{Path(error.character).stem}' is not found",
            f"{error} The session can be opened with another character of the same mesh; the file is not changed.",
            (
                Choice("Choose character...", choose),
                Choice(f"Use {title}", lambda: done(present)),
                Choice("Cancel"),
            ),
            bad=True,
        )
    )
