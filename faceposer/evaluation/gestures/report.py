"""A study of gestures: rows of all characters, and the files of results."""

import random
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from PIL import Image

from faceposer.evaluation.gestures.characters import load_study_character
from faceposer.evaluation.gestures.expressions import EXPRESSIONS
from faceposer.evaluation.gestures.gesture import Gesture
from faceposer.evaluation.gestures.hand import Performed, PriorSettings
from faceposer.evaluation.gestures.pictures import Cell, Studio, beside, sheet, studio, write_jpeg
from faceposer.evaluation.gestures.rows import Row, study
from faceposer.evaluation.gestures.tables import markdown, spliced
from faceposer.files import writing

# Images per row of a sheet, and their width in pixels.
_COLUMNS, _SIDE = 9, 176
_EXPRESSION_SIDE = 240
_BEFORE = "Before"


def run(
    characters: Sequence[str],
    gestures: Sequence[Gesture],
    settings: PriorSettings,
    pictures: Path | None = None,
    sheets: Path | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Row]:
    """Perform the gestures on all ``characters``, write images, and return the rows.

    Args:
        characters: Names of characters.
        gestures: Gestures to perform on each.
        settings: Settings of the prior.
        pictures: Folder for images before and after and for the sheets, or None.
        sheets: Another folder for the sheets only, or None.
        tell: Callback for a line of progress after each character.

    Raises:
        FacePoserError: If a character cannot be read, or rendering fails.
    """
    folders = [folder for folder in (pictures, sheets) if folder is not None]
    rows: list[Row] = []
    expressions: list[Cell] = []
    for character in characters:
        model = load_study_character(character)
        results = list(study(character, model, gestures, settings))
        rows += [row for _, row in results]
        if folders:
            with studio(model.character) as renderer:
                expressions += _without_captions(renderer, [performed for performed, _ in results])
                page = _character_sheet(renderer, results, None if pictures is None else pictures / character)
                for folder in folders:
                    write_jpeg(folder / f"gestures-{character}.jpg", page)
        tell(f"{character}: {sum(row['holds'] for _, row in results)} of {len(results)} gestures hold")
    if expressions:
        page = sheet(expressions, len(EXPRESSIONS), _EXPRESSION_SIDE)
        for folder in folders:
            write_jpeg(folder / "gestures-expressions.jpg", page)
    return rows


def blind_order() -> list[Gesture]:
    """Return the expressions in the order of the sheet without captions, from the left."""
    shuffled = list(EXPRESSIONS)
    random.Random(3).shuffle(shuffled)
    return shuffled


def write_json(path: Path, rows: Sequence[Row], settings: PriorSettings) -> None:
    """Write ``rows`` with the ``settings`` of their study."""
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"settings": asdict(settings), "rows": list(rows)}
    writing.write_json(path, content, "result", ascii_only=False)


def write_page(path: Path, rows: Sequence[Row], settings: PriorSettings) -> None:
    """Write the tables of ``rows`` between the marks of the page ``path``.

    Raises:
        FacePoserError: If the page has no marks.
    """
    text = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in asdict(settings).items())
    page = spliced(path.read_text(encoding="utf-8"), markdown(rows, text))
    path.write_text(page, encoding="utf-8")


def _character_sheet(renderer: Studio, results: Sequence[tuple[Performed, Row]], folder: Path | None) -> Image.Image:
    """Return the sheet of a character, and write the images of each gesture before and after to ``folder``."""
    cells: list[Cell] = []
    for performed, row in results:
        gesture = performed.gesture
        before, after = renderer.before(gesture), renderer.after(performed)
        if folder is not None:
            write_jpeg(folder / f"{gesture.name}.jpg", beside(before, after))
        if not any(cell.label == f"{_BEFORE}, {gesture.view}" for cell in cells):
            cells.append(Cell(before, f"{_BEFORE}, {gesture.view}"))
        cells.append(Cell(after, gesture.title, row["holds"]))
    cells.sort(key=lambda cell: not cell.label.startswith(_BEFORE))
    return sheet(cells, _COLUMNS, _SIDE)


def _without_captions(renderer: Studio, results: Sequence[Performed]) -> list[Cell]:
    """Return the expressions of a character without captions, if all were performed."""
    by_name = {performed.gesture.name: performed for performed in results}
    if not all(gesture.name in by_name for gesture in EXPRESSIONS):
        return []
    return [Cell(renderer.after(by_name[gesture.name], arrows=False), "") for gesture in blind_order()]
