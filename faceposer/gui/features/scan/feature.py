"""Heads from scans: the texts of the dialog and its work."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh_io import MESH_SUFFIXES
from faceposer.gui.features.head_making.contents import MadeHead, Words
from faceposer.gui.features.head_making.feature import HeadMakingFeature
from faceposer.progress import Progress

if TYPE_CHECKING:
    from faceposer.gui.features.scan.marked_scan import MarkedScan


class ScanFeature(HeadMakingFeature["MarkedScan", MadeHead]):
    """State of the dialog that makes a character of scans of a head."""

    words = Words(
        ("scan", "Head from scan...", "Make a character of 3D scans of a person's head"),
        "scan",
        "Add scan",
        "Meshes of one person's head: OBJ, PLY, STL, OFF or glTF, with or without texture, in any unit and "
        "orientation. Holes, hair and an expression are fine; the character gets a neutral head.",
        "Drag points that are not in their place; arrow keys move the selected one. The others follow the fit.",
        (
            ("detail", "Detail of the scan", "Follow the scan beyond what the model of heads can show"),
            ("texture", "Texture of the scan", "Paint the skin with the colours of the scan, if it has any"),
        ),
    )
    suffixes = MESH_SUFFIXES

    def work_of_finding(self, files: Sequence[str]) -> Callable[[Progress], "list[MarkedScan]"]:
        """Return the function that reads the scans and finds their landmarks."""
        from faceposer.gui.features.scan import marked_scan

        return partial(marked_scan.find_landmarks, files)

    def work_of_fitting(
        self, marked: "Sequence[MarkedScan]", show: Callable[[NDArray[np.uint8]], None]
    ) -> Callable[[Progress], MadeHead]:
        """Return the function that makes the character."""
        from faceposer.gui.features.scan import work

        detail, texture = self.options["detail"], self.options["texture"]
        return partial(work.fit_head, marked, detail, texture, self.title.strip(), show)
