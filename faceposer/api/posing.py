"""Starting pose, pose library and mirroring for ``Face``."""

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.api import checks
from faceposer.errors import FacePoserError
from faceposer.poses import applying, library
from faceposer.poses.pose_file import Pose, checked_name, read_pose
from faceposer.session.session import Session

PathName = str | PathLike[str]
# Largest weight of a shape, as in files of weights.
_LARGEST_WEIGHT = 1000.0


class PosingMixin:
    """Starting pose of a face: by weights, from the pose library, from files, and by mirroring.

    Attributes:
        session: The document with its history.
    """

    session: Session

    def set_weights(self, weights: Mapping[str, float]) -> None:
        """Set the starting pose by ``weights`` of the rig's shapes, by name; weights that are not given are 0."""
        for name, weight in weights.items():
            checks.number(weight, -_LARGEST_WEIGHT, _LARGEST_WEIGHT, f"The weight of '{name}'")
        try:
            start = self.session.model.coefficients_of(weights)
        except KeyError as error:
            raise FacePoserError(f"'{self.session.model.character.title}' has no shape '{error.args[0]}'.") from error
        self._start_from(start, "Set the weights")

    def apply_pose(
        self,
        pose: Pose | PathName,
        strength: float = 1.0,
        regions: Iterable[applying.Region] | applying.Region | None = None,
        side: applying.Side = "both",
        blend: applying.Blend = "replace",
    ) -> None:
        """Apply ``pose`` to the starting pose.

        Args:
            pose: A pose, its file (.json), or the name of a pose in the user's library or of a built-in pose.
            strength: From -1 to 2; 1 gives the pose itself.
            regions: The affected regions: "brows", "eyes", "cheeks" and "mouth"; None for the whole face.
            side: The affected side of the face.
            blend: "replace" interpolates from the start to the pose, "add" adds the pose to the start.
        """
        chosen = pose if isinstance(pose, Pose) else self._find_pose(pose)
        start = self.session.model.neutral() if self.session.document.start is None else self.session.document.start
        affected = None if regions is None else checks.some_of(regions, applying.REGIONS, "A region")
        checks.one_of(side, get_args(applying.Side), "A side")
        checks.one_of(blend, get_args(applying.Blend), "The blend")
        checks.number(strength, applying.LEAST_STRENGTH, applying.GREATEST_STRENGTH, "The strength")
        posed = applying.applied(self.session.model, start, chosen, strength, affected, side, blend)
        self._start_from(posed, f"Apply {chosen.name}")

    def mirror(self, source: Literal["left", "right"] = "left") -> None:
        """Mirror the side ``source`` to the other side of the face; constraints are then removed."""
        checks.one_of(source, ("left", "right"), "The source of mirroring")
        self.session.rebase_pose(
            applying.mirrored(self.session.model, self.session.coefficients, source), "Mirror the face"
        )

    def flip(self) -> None:
        """Swap the left and right side of the face; constraints are then removed."""
        self.session.rebase_pose(applying.flipped(self.session.model, self.session.coefficients), "Flip the face")

    def pose(self, name: str) -> Pose:
        """Return the current pose as a library pose called ``name``."""
        return applying.pose_of(self.session.model, self.session.coefficients, checked_name(name))

    def save_pose(self, name: str, folder: PathName | None = None, overwrite: bool = False) -> Path:
        """Write the current pose to the user's library, or to ``folder``, and return its file."""
        target = library.default_pose_folder() if folder is None else checks.file_path(folder, "A folder")
        return library.PoseLibrary(target).save(self.pose(name), overwrite)

    def take_pose(self, path: PathName, frame: int = 0) -> str:
        """Set the starting pose from a mesh (.obj, .ply) or a frame of weights, and return a remark on the fit.

        Args:
            path: The file, as ``faceposer.interchange.reading.read_pose`` reads it.
            frame: Frame of the weights, from 0.
        """
        from faceposer.interchange.reading import read_pose

        read = read_pose(checks.file_path(path), self.session.model, frame)
        self._start_from(read.coefficients, "Open a pose")
        return read.note

    def _start_from(self, start: NDArray[np.float64], label: str) -> None:
        with self.session.edit(label):
            self.session.set_start(start)

    def _find_pose(self, name: PathName) -> Pose:
        text = checks.path_name(name, "A pose")
        if Path(text).suffix.lower() == library.SUFFIX:
            return read_pose(Path(text))
        own = library.PoseLibrary(library.default_pose_folder()).entries()
        entries = [
            entry
            for entry in (*own, *library.starter_poses())
            if entry.pose is not None and applying.weights_on(entry.pose, self.session.model.character) is not None
        ]
        pose = library.found(entries, text, f"for '{self.session.model.character.title}'").pose
        assert pose is not None
        return pose
