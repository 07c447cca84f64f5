"""Heads from photos: the texts of the dialog, its work, and the session with the photo and its expression."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.head_making.contents import Words
from faceposer.gui.features.head_making.feature import HeadMakingFeature
from faceposer.gui.widgets.sliders import row_label, slider
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.photo.reading import PHOTO_SUFFIXES
from faceposer.progress import Progress
from faceposer.session.document import Document
from faceposer.session.opening import load_model
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker

if TYPE_CHECKING:
    from faceposer.gui.features.photo_head.marked_photo import MarkedPhoto
    from faceposer.gui.features.photo_head.work import PhotoHead

# Decimal logarithm of the greatest weight of the density of heads, and of its inverse.
_MOST = 0.7


class PhotoHeadFeature(HeadMakingFeature["MarkedPhoto", "PhotoHead"]):
    """State of the dialog that makes a character of photos of a person.

    Attributes:
        likelihood: Decimal logarithm of the weight of the density of heads: negative for more likeness.
        painting: True for paintings and drawings, whose light cannot be trusted.
    """

    words = Words(
        (
            "photo-head",
            "Head from photos...",
            "Make a character of photos of a person",
        ),
        "photo",
        "Add photo",
        "Photos of one person with a large face, not turned by more than 60 degrees. Photos from several sides "
        "determine the head better. Hair over the face, glasses and folds of a smile leave traces in the skin.",
        "Drag points that are not in their place; arrow keys move the selected one.",
        (),
    )
    suffixes = PHOTO_SUFFIXES

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.likelihood, self.painting = 0.0, False

    def work_of_finding(self, files: Sequence[str]) -> Callable[[Progress], "list[MarkedPhoto]"]:
        """Return the function that reads the photos and finds their faces."""
        from faceposer.gui.features.photo_head import marked_photo

        return partial(marked_photo.find_faces, files)

    def work_of_fitting(
        self, marked: "Sequence[MarkedPhoto]", show: Callable[[NDArray[np.uint8]], None]
    ) -> Callable[[Progress], "PhotoHead"]:
        """Return the function that makes the character."""
        from faceposer.gui.features.photo_head import work

        return partial(work.fit_head, marked, 10.0**self.likelihood, self.title.strip(), self.painting, show)

    def draw_options(self) -> None:
        """Draw the balance between likeness and likelihood, and the choice of paintings."""
        tip = "Left: as much like the photo as possible; right: a head that is more usual. 1 balances both."
        row_label("Likelihood", tip)
        imgui.set_next_item_width(-1.0)
        text = f"{10.0**self.likelihood:.2f}"
        _, value = slider("##likelihood", self.likelihood, -_MOST, _MOST, text)
        self.likelihood = value if math.isfinite(value) else 0.0
        self.context.widget_rects.record("photo-head:likelihood")
        _, self.painting = imgui.checkbox("Painting or drawing", self.painting)
        self.context.widget_rects.record("photo-head:painting")
        tooltip("Shape from landmarks alone; the skin keeps the painter's colours, whatever light they stand for")

    def opened(self, result: "PhotoHead", path: Path) -> None:
        """Show the character in the file ``path`` with the photo behind it and the photo's expression."""

        def opening(worker: Worker) -> Session:
            model = load_model(str(path))
            photo = result.photo
            document = Document(str(path), photos=(photo,), camera=photo.camera)
            return Session(model, document.with_start(result.pose).posed(result.pose), worker)

        def show() -> None:
            if self.context.show_session(opening, "The head cannot be shown"):
                self.context.session.mark_unsaved()
                self.context.notify(f"Press {self.context.actions['frame'].shortcut} to zoom in on the head")

        show()
