"""Poses in the window: the library, and the pose that is being applied."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.poses.name_dialog import NameDialog
from faceposer.gui.features.poses.panel import Category, PosesPanel
from faceposer.gui.features.poses.portraits import FILE_SIZE, Portraits
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.poses.applying import (
    REGIONS,
    Blend,
    Region,
    Side,
    applied,
    flipped,
    flipped_pose,
    mirrored,
    pose_of,
    weights_on,
)
from faceposer.poses.library import Entry, PoseLibrary, own_folder, starter_poses
from faceposer.poses.pose_file import Pose, checked_name
from faceposer.render.images import write_png
from faceposer.session.session import Session

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AppliedPose:
    """A pose that has been put on the face and can still be changed.

    Attributes:
        session: The session of the face.
        pose: What was applied.
        before: The pose that the face started from before, shape (r,).
        after: The one that it starts from now, shape (r,): where that is another, something else came between.
        reach: What of the face it reaches, and how.
        strength: How far.
    """

    session: Session
    pose: Pose
    before: Array
    after: Array
    reach: "PoseMask"
    strength: float


@dataclass(frozen=True)
class PoseMask:
    """What of the face a pose reaches.

    Attributes:
        regions: Which regions.
        side: Which side.
        blend: Whether it takes the place of what is there, or comes on top.
    """

    regions: frozenset[Region] = frozenset(REGIONS)
    side: Side = "both"
    blend: Blend = "replace"

    @property
    def words(self) -> str:
        """What it reaches, where that is less than the whole face, else ""."""
        regions = [region for region in REGIONS if region in self.regions]
        return ", ".join((*regions * (len(regions) < len(REGIONS)), *[self.side] * (self.side != "both")))


class PosesFeature(Feature):
    """The tab "Poses".

    Attributes:
        reach: What of the face the next pose reaches.
        category: Which poses are shown.
        filter: What their names or notes must contain.
        portraits: Their pictures.
    """

    tab = ("Poses", "Expressions, visemes and poses of your own")

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.reach = PoseMask()
        self.category: Category = "all"
        self.filter = ""
        self.portraits = Portraits(context)
        self._panel, self._name_dialog = PosesPanel(self), NameDialog(context)
        self._application: AppliedPose | None = None
        self._starters: list[Entry] | None = None
        self._own: tuple[Path, int, list[Entry]] | None = None

    # What the window asks for

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.0 if self.portraits.waiting and not self.context.toolbox.active else super().patience

    @property
    def is_modal(self) -> bool:
        """Whether the question for a name is open."""
        return self._name_dialog.open

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the menu "Pose"."""

        def free() -> bool:
            return not self.context.busy

        return (
            Action("pose-save", "Save pose...", "Pose", self.ask_to_save, (), free, help="Keep this face as a pose"),
            Action(
                "pose-mirror",
                "Mirror left to right",
                "Pose",
                lambda: self.mirror("left"),
                (),
                free,
                separated=True,
                help="Make the right side of the face the image of the left; clears the constraints, as Accept does",
            ),
            Action(
                "pose-mirror-right",
                "Mirror right to left",
                "Pose",
                lambda: self.mirror("right"),
                (),
                free,
                help="Make the left side of the face the image of the right; clears the constraints, as Accept does",
            ),
            Action(
                "pose-flip",
                "Flip",
                "Pose",
                self.flip,
                (),
                free,
                help="Exchange left and right of the face; clears the constraints, as Accept does",
            ),
            Action(
                "pose-folder",
                "Choose folder of poses...",
                "Pose",
                self.ask_for_folder,
                (),
                free,
                separated=True,
                help="Keep your poses in another folder",
            ),
        )

    def session_changed(self) -> None:
        """Draw the pictures anew, of the face that is shown now."""
        self._application = None
        self.portraits.forget()

    def update(self) -> None:
        """Draw a picture that is wanted, unless the user is dragging."""
        if not self.context.toolbox.active:
            self.portraits.follow()

    def draw_tab(self) -> None:
        """Draw the tab."""
        self._panel.draw()

    def draw_dialog(self) -> None:
        """Draw the question for a name."""
        self._name_dialog.draw()

    def close(self) -> None:
        """Free the pictures."""
        self.portraits.release()

    # The library

    @property
    def library(self) -> PoseLibrary:
        """The user's poses."""
        folder = self.context.settings.poses_folder
        return PoseLibrary(Path(folder) if folder else own_folder())

    def entries(self) -> list[Entry]:
        """Return what there is for this face: what comes with the program and fits it, then all of the user's."""
        if self._starters is None:
            self._starters = starter_poses()
        library = self.library
        stamp = library.stamp
        if self._own is None or self._own[:2] != (library.folder, stamp):
            own: list[Entry] = []
            try:
                own = library.entries()
            except FacePoserError as error:
                self.context.dialogs.report("The poses cannot be listed", str(error))
            self._own = (library.folder, stamp, own)
        return [entry for entry in self._starters if self.weights(entry) is not None] + self._own[2]

    def weights(self, entry: Entry) -> Array | None:
        """Return the weights of a pose on this face, shape (S,), or None where it does not fit."""
        return None if entry.pose is None else weights_on(entry.pose, self.context.session.model.character)

    def shown(self) -> list[Entry]:
        """Return the entries of the chosen category that the filter lets through."""
        wanted = self.filter.strip().casefold()
        return [entry for entry in self.entries() if self._in_category(entry) and wanted in _searched(entry)]

    def _in_category(self, entry: Entry) -> bool:
        if self.category == "mine":
            return not entry.shipped
        return self.category == "all" or (entry.pose is not None and self.category in entry.pose.tags)

    # Applying

    @property
    def application(self) -> AppliedPose | None:
        """The pose that was applied last, while the face still starts from it."""
        last = self._application
        if last is None or last.session is not self.context.session or not np.array_equal(self._start(), last.after):
            return None
        return last

    def apply(self, pose: Pose) -> None:
        """Put ``pose`` on the face at full strength; where it is there already, anew with what it is to reach now."""
        context = self.context
        if context.busy:
            return
        context.comparing = False
        last = self.application
        again = last is not None and last.pose == pose
        before = last.before if last is not None and again else self._start()
        # Changes of one and the same application are one step of the history.
        with context.session.edit(f"Apply {pose.name}", merges=again):
            self._put(pose, before, self.reach, 1.0)
        context.redraw()

    def apply_flipped(self, pose: Pose) -> None:
        """Put ``pose`` on the face with left and right exchanged."""
        self._safely(lambda: self.apply(flipped_pose(self.context.session.model, pose)))

    def set_strength(self, strength: float) -> None:
        """Change how far the applied pose goes, inside the edit that is open."""
        last = self.application
        if last is not None:
            self._put(last.pose, last.before, last.reach, strength)

    def reset_strength(self) -> None:
        """Let the applied pose go all the way, no further."""
        last = self.application
        if last is not None and not self.context.busy:
            with self.context.session.edit(f"Apply {last.pose.name}", merges=True):
                self.set_strength(1.0)

    def _put(self, pose: Pose, before: Array, reach: PoseMask, strength: float) -> None:
        session = self.context.session
        regions = None if len(reach.regions) == len(REGIONS) else reach.regions
        after = applied(session.model, before, pose, strength, regions, reach.side, reach.blend)
        session.set_start(after)
        self._application = AppliedPose(session, pose, before, after, reach, strength)

    def _start(self) -> Array:
        start = self.context.session.document.start
        return self.context.session.model.neutral() if start is None else start

    def mirror(self, source: Literal["left", "right"]) -> None:
        """Make the other side the image of the side ``source``."""
        self._settle(
            lambda: mirrored(self.context.session.model, self.context.session.coefficients, source), "Mirror the face"
        )

    def flip(self) -> None:
        """Exchange left and right."""
        self._settle(lambda: flipped(self.context.session.model, self.context.session.coefficients), "Flip the face")

    def _settle(self, pose: Callable[[], Array], label: str) -> None:
        def settle() -> None:
            self.context.toolbox.cancel()
            self.context.comparing = False
            self.context.session.wait()
            self.context.session.rebase_pose(pose(), label)

        self._safely(settle)

    # Keeping

    def ask_to_save(self) -> None:
        """Ask for a name and keep this face under it."""
        self.context.toolbox.finish()
        self._name_dialog.ask("Save pose", "Save", self._free_name(), self._save)

    def ask_to_rename(self, entry: Entry) -> None:
        """Ask for another name of a pose."""

        def rename(name: str, overwrite: bool) -> None:
            self.library.rename(entry.path, name, overwrite)
            self.context.notify(f"Renamed to {name}")

        self._name_dialog.ask("Rename pose", "Rename", entry.title, rename)

    def ask_to_update(self, entry: Entry) -> None:
        """Ask whether this face is to take the place of the one that a pose has."""

        def update() -> None:
            session = self.context.session
            session.wait()
            tags = () if entry.pose is None else entry.pose.tags
            self.library.update(entry.path, pose_of(session.model, session.coefficients, entry.title, tags))
            self._picture(entry.path)

        self.context.dialogs.ask(
            Question(
                f"Replace '{entry.title}'?",
                "It becomes the face as it is now. What it has been is lost.",
                (Choice("Replace", lambda: self._safely(update)), Choice("Cancel")),
                default=1,
            )
        )

    def ask_to_delete(self, entry: Entry) -> None:
        """Ask whether a pose is to go."""

        def delete() -> None:
            self._safely(lambda: self.library.delete(entry.path))

        self.context.dialogs.ask(
            Question(
                f"Delete '{entry.title}'?",
                f"The file {entry.path.name} and its picture are removed. This cannot be undone.",
                (Choice("Delete", delete), Choice("Cancel")),
                default=1,
            )
        )

    def ask_for_folder(self) -> None:
        """Ask where the user's poses are."""
        library = self.library

        def choose(folder: Path) -> None:
            self.context.settings.poses_folder = str(folder.resolve())
            self.category = "mine"

        start = library.folder if library.folder.is_dir() else Path.home()
        self.context.ask_for_file(FileRequest("folder", "Folder of your poses", "Folders", (), start, choose))

    def _save(self, name: str, overwrite: bool) -> None:
        """Keep this face as the pose ``name``, with its picture.

        Raises:
            PoseExistsError: If there is one of that name that is not to be replaced.
            FacePoserError: If it cannot be written.
        """
        session = self.context.session
        session.wait()
        path = self.library.save(pose_of(session.model, session.coefficients, checked_name(name)), overwrite)
        self._picture(path)
        self.filter = ""
        if self.category != "all":
            self.category = "mine"
        self.context.notify(f"Saved the pose {name}")

    def _picture(self, path: Path) -> None:
        """Write the picture of the face beside the file ``path`` of its pose."""
        write_png(path.with_suffix(".png"), self.portraits.draw(self.context.session.coefficients, FILE_SIZE))
        self._own = None

    def _free_name(self) -> str:
        """Return a name that no pose has yet."""
        taken = {entry.title.casefold() for entry in self.entries()}
        return next(name for i in range(1, len(taken) + 2) if (name := f"Pose {i}").casefold() not in taken)

    def _safely(self, do: Callable[[], object]) -> None:
        try:
            do()
        except FacePoserError as error:
            self.context.dialogs.report("That did not work", str(error))


def _searched(entry: Entry) -> str:
    pose = entry.pose
    return entry.title.casefold() if pose is None else " ".join((pose.name, pose.note, *pose.tags)).casefold()
