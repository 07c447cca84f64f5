"""The pose library in the window, and the commands that apply, mirror and save poses."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.user_folders import home_folder
from faceposer.gui.context import EditorContext
from faceposer.gui.features.poses.portraits import FILE_SIZE, Portraits
from faceposer.gui.features.poses.state import AppliedPose, Category, PoseMask
from faceposer.gui.name_dialog import NameDialog
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.poses.applying import (
    REGIONS,
    applied,
    flipped,
    flipped_pose,
    mirrored,
    pose_of,
    weights_on,
)
from faceposer.poses.library import Entry, PoseLibrary, default_pose_folder, starter_poses
from faceposer.poses.pose_file import Pose, checked_name
from faceposer.render.images import write_png

Array = NDArray[np.float64]


class PoseCommands:
    """The tab "Poses".

    Attributes:
        context: The editor.
        mask: Part of the face that the next pose affects.
        category: Category of the poses that are shown.
        filter: Text that their names, notes or tags contain.
        portraits: Thumbnails of the poses.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.mask = PoseMask()
        self.category: Category = "all"
        self.filter = ""
        self.portraits = Portraits(context)
        self._name_dialog = NameDialog(context)
        self._applied: AppliedPose | None = None
        self._starters: list[Entry] | None = None
        self._own: tuple[Path, int, list[Entry]] | None = None

    # Library

    @property
    def library(self) -> PoseLibrary:
        """The user's pose library."""
        folder = self.context.settings.poses_folder
        return PoseLibrary(Path(folder) if folder else default_pose_folder())

    def entries(self) -> list[Entry]:
        """Return the built-in poses that fit this face, followed by all poses of the user."""
        if self._starters is None:
            self._starters = starter_poses()
        library = self.library
        stamp = library.stamp
        if self._own is None or self._own[:2] != (library.folder, stamp):
            own: list[Entry] = []
            try:
                own = library.entries()
            except FacePoserError as error:
                self.context.dialogs.report("The pose library cannot be read", str(error))
            self._own = (library.folder, stamp, own)
        return [entry for entry in self._starters if self.weights(entry) is not None] + self._own[2]

    def weights(self, entry: Entry) -> Array | None:
        """Return the weights of a pose on this face, shape (S,), or None if it does not fit."""
        return None if entry.pose is None else weights_on(entry.pose, self.context.session.model.character)

    def shown(self) -> list[Entry]:
        """Return the entries of the chosen category that match the filter."""
        text = self.filter.strip().casefold()
        return [entry for entry in self.entries() if self._in_category(entry) and text in _searchable_text(entry)]

    def _in_category(self, entry: Entry) -> bool:
        if self.category == "mine":
            return not entry.shipped
        return self.category == "all" or (entry.pose is not None and self.category in entry.pose.tags)

    # Applying poses

    @property
    def applied_pose(self) -> AppliedPose | None:
        """The pose that was applied last, while the session still starts from it."""
        last = self._applied
        if last is None or last.session is not self.context.session or not np.array_equal(self._start(), last.after):
            return None
        return last

    def apply(self, pose: Pose) -> None:
        """Apply ``pose`` at full strength with the current mask. If it was applied last, apply it again."""
        context = self.context
        if context.busy:
            return
        context.comparing = False
        last = self.applied_pose
        again = last is not None and last.pose == pose
        before = last.before if last is not None and again else self._start()
        # Adjustments of the same pose are one step of the history.
        with context.session.edit(f"Apply {pose.name}", merges=again):
            self._set_applied(pose, before, self.mask, 1.0)
        context.redraw()

    def apply_flipped(self, pose: Pose) -> None:
        """Apply ``pose`` with left and right swapped."""
        self._run(lambda: self.apply(flipped_pose(self.context.session.model, pose)), "The pose cannot be flipped")

    def set_strength(self, strength: float) -> None:
        """Change the strength of the applied pose within the open edit."""
        last = self.applied_pose
        if last is not None:
            self._set_applied(last.pose, last.before, last.mask, strength)

    def reset_strength(self) -> None:
        """Reset the strength of the applied pose to 100 %."""
        last = self.applied_pose
        if last is not None and not self.context.busy:
            with self.context.session.edit(f"Apply {last.pose.name}", merges=True):
                self.set_strength(1.0)

    def _set_applied(self, pose: Pose, before: Array, mask: PoseMask, strength: float) -> None:
        """Start the session from ``pose`` applied to ``before``."""
        session = self.context.session
        regions = None if len(mask.regions) == len(REGIONS) else mask.regions
        after = applied(session.model, before, pose, strength, regions, mask.side, mask.blend)
        session.set_start(after)
        self._applied = AppliedPose(session, pose, before, after, mask, strength)

    def _start(self) -> Array:
        start = self.context.session.document.start
        return self.context.session.model.neutral() if start is None else start

    def mirror(self, source: Literal["left", "right"]) -> None:
        """Mirror the side ``source`` of the face to the other side."""
        self._rebase(
            lambda: mirrored(self.context.session.model, self.context.session.coefficients, source),
            "Mirror the face",
            "The face cannot be mirrored",
        )

    def flip(self) -> None:
        """Swap the left and right side of the face."""
        self._rebase(
            lambda: flipped(self.context.session.model, self.context.session.coefficients),
            "Flip the face",
            "The face cannot be flipped",
        )

    def _rebase(self, pose: Callable[[], Array], label: str, failure: str) -> None:
        """Start from ``pose``, without constraints; report an error under the title ``failure``."""

        def rebase() -> None:
            self.context.toolbox.cancel()
            self.context.comparing = False
            self.context.session.wait()
            self.context.session.rebase_pose(pose(), label)

        self._run(rebase, failure)

    # Saving poses

    def ask_to_save(self) -> None:
        """Ask for a name and save the current pose under it."""
        self.context.toolbox.finish()
        self._name_dialog.ask("Save pose", "Save", self._free_name(), self._save)

    def ask_to_rename(self, entry: Entry) -> None:
        """Ask for a new name of a pose."""

        def rename(name: str, overwrite: bool) -> None:
            self.library.rename(entry.path, name, overwrite)
            self.context.notify(f"Renamed to {name}")

        self._name_dialog.ask("Rename pose", "Rename", entry.title, rename)

    def ask_to_update(self, entry: Entry) -> None:
        """Ask whether to replace a saved pose by the current one."""

        def update() -> None:
            session = self.context.session
            session.wait()
            tags = () if entry.pose is None else entry.pose.tags
            self.library.update(entry.path, pose_of(session.model, session.coefficients, entry.title, tags))
            self._write_image(entry.path)

        self.context.dialogs.ask(
            Question(
                f"Replace '{entry.title}'?",
                "The saved pose is replaced by the current one. This cannot be undone.",
                (
                    Choice("Replace", lambda: self._run(update, "The pose cannot be replaced")),
                    Choice("Cancel"),
                ),
                default=1,
            )
        )

    def ask_to_delete(self, entry: Entry) -> None:
        """Ask whether to delete a saved pose."""

        def delete() -> None:
            self._run(lambda: self.library.delete(entry.path), "The pose cannot be deleted")

        self.context.dialogs.ask(
            Question(
                f"Delete '{entry.title}'?",
                f"The file {entry.path.name} and its image are deleted. This cannot be undone.",
                (Choice("Delete", delete), Choice("Cancel")),
                default=1,
            )
        )

    def ask_for_folder(self) -> None:
        """Ask for the folder of the user's poses."""
        library = self.library

        def choose(folder: Path) -> None:
            self.context.settings.poses_folder = str(paths.resolved(folder))
            self.category = "mine"

        start = library.folder if paths.can_enter(library.folder) else home_folder()
        self.context.ask_for_file(FileRequest("folder", "Choose folder of poses", "Folders", (), start, choose))

    def _save(self, name: str, overwrite: bool) -> None:
        """Save the current pose as ``name``, with its image.

        Raises:
            PoseExistsError: If a pose of that name exists and ``overwrite`` is False.
            FacePoserError: If the file cannot be written.
        """
        session = self.context.session
        session.wait()
        path = self.library.save(pose_of(session.model, session.coefficients, checked_name(name)), overwrite)
        self._write_image(path)
        self.filter = ""
        if self.category != "all":
            self.category = "mine"
        self.context.notify(f"Saved the pose {name}")

    def _write_image(self, path: Path) -> None:
        """Write the image of the current pose next to its file ``path``."""
        write_png(path.with_suffix(".png"), self.portraits.draw(self.context.session.coefficients, FILE_SIZE))
        self._own = None

    def _free_name(self) -> str:
        """Return a name that is not in use."""
        taken = {entry.title.casefold() for entry in self.entries()}
        return next(name for i in range(1, len(taken) + 2) if (name := f"Pose {i}").casefold() not in taken)

    def _run(self, command: Callable[[], object], failure: str) -> None:
        """Run ``command``, and report its FacePoserError under the title ``failure``."""
        try:
            command()
        except FacePoserError as error:
            self.context.dialogs.report(failure, str(error))


def _searchable_text(entry: Entry) -> str:
    pose = entry.pose
    return entry.title.casefold() if pose is None else " ".join((pose.name, pose.note, *pose.tags)).casefold()
