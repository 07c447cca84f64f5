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
from faceposer.gui.widgets.sliders import reset_button, row_label, slider, slider_room
from faceposer.gui.widgets.text import text_width
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.identity.photos import LIKELIHOODS
from faceposer.photo.reading import PHOTO_SUFFIXES
from faceposer.progress import Progress
from faceposer.session.document import Document
from faceposer.session.opening import load_model
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker

if TYPE_CHECKING:
    from faceposer.gui.features.photo_head.marked_photo import MarkedPhoto
    from faceposer.gui.features.photo_head.work import PhotoHead

_LIKENESS_TIP = (
    "How closely the head follows the photos. Left: as like as possible, unusual if need be. Right: more like usual "
    "heads. 1 is the most probable head."
)
_LABEL = 6.0


class PhotoHeadFeature(HeadMakingFeature["MarkedPhoto", "PhotoHead"]):
    """State of the dialog that makes a character of photos of a person.

    Attributes:
        likelihood: Weight of the density of heads: below 1 for more likeness.
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
        self.likelihood, self.painting = 1.0, False

    def show(self) -> None:
        """Open the dialog, with the options as they are at first."""
        self.likelihood, self.painting = 1.0, False
        super().show()

    def work_of_finding(self, files: Sequence[str]) -> Callable[[Progress], "list[MarkedPhoto]"]:
        """Return the function that reads the photos and finds their faces."""
        from faceposer.gui.features.photo_head import marked_photo

        return partial(marked_photo.find_faces, files)

    def work_of_fitting(
        self, marked: "Sequence[MarkedPhoto]", show: Callable[[NDArray[np.uint8]], None]
    ) -> Callable[[Progress], "PhotoHead"]:
        """Return the function that makes the character."""
        from faceposer.gui.features.photo_head import work

        return partial(work.fit_head, marked, self.likelihood, self.title.strip(), self.painting, show)

    def draw_options(self) -> None:
        """Draw the balance between likeness and likelihood, and the choice of paintings."""
        rects = self.context.widget_rects
        row_label("Likeness", _LIKENESS_TIP, _LABEL)
        end = "Likelihood"
        imgui.set_next_item_width(slider_room() - text_width(end) - imgui.get_style().item_spacing.x)
        flags = imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.clamp_on_input.value
        _, value = slider("##likelihood", self.likelihood, *LIKELIHOODS, "%.2f", flags)
        self.likelihood = value if math.isfinite(value) else 1.0
        rects.record("photo-head:likelihood")
        tooltip(_LIKENESS_TIP)
        imgui.same_line()
        imgui.text_unformatted(end)
        tooltip(_LIKENESS_TIP)
        if reset_button(rects, "photo-head:likelihood", self.likelihood == 1.0, "Reset to 1"):
            self.likelihood = 1.0
        _, self.painting = imgui.checkbox("Painting or drawing", self.painting)
        rects.record("photo-head:painting")
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
