"""Poses in the window: the library, and the pose that is being applied."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
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
from faceposer.session.session import Session
from faceposer.viewer.actions import Action, Submenu
from faceposer.viewer.app import App
from faceposer.viewer.features import Feature
from faceposer.viewer.file_dialogs import FileRequest
from faceposer.viewer.panels.dialogs import Choice, Question
from faceposer.viewer.panels.pose_library import Category, PosesPanel
from faceposer.viewer.panels.pose_name import NameDialog
from faceposer.viewer.pictures import write_png
from faceposer.viewer.portraits import FILE_SIZE, Portraits

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Application:
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
    reach: "Reach"
    strength: float


@dataclass(frozen=True)
class Reach:
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

    def __init__(self, app: App) -> None:
        super().__init__(app)
        self.reach = Reach()
        self.category: Category = "all"
        self.filter = ""
        self.portraits = Portraits(app)
        self._panel, self._name_dialog = PosesPanel(self), NameDialog(app)
        self._application: Application | None = None
        self._starters: list[Entry] | None = None
        self._own: tuple[Path, int, list[Entry]] | None = None

    # What the window asks for

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.0 if self.portraits.waiting and not self.app.toolbox.active else super().patience

    @property
    def covers(self) -> bool:
        """Whether the question for a name is open."""
        return self._name_dialog.open

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the menu "Pose"."""

        def free() -> bool:
            return not self.app.busy

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

    def follow(self) -> None:
        """Draw a picture that is wanted, unless the user is dragging."""
        if not self.app.toolbox.active:
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
        folder = self.app.settings.poses_folder
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
                self.app.dialogs.report("The poses cannot be listed", str(error))
            self._own = (library.folder, stamp, own)
        return [entry for entry in self._starters if self.weights(entry) is not None] + self._own[2]

    def weights(self, entry: Entry) -> Array | None:
        """Return the weights of a pose on this face, shape (S,), or None where it does not fit."""
        return None if entry.pose is None else weights_on(entry.pose, self.app.session.model.subject)

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
    def application(self) -> Application | None:
        """The pose that was applied last, while the face still starts from it."""
        last = self._application
        if last is None or last.session is not self.app.session or not np.array_equal(self._start(), last.after):
            return None
        return last

    def apply(self, pose: Pose) -> None:
        """Put ``pose`` on the face at full strength; where it is there already, anew with what it is to reach now."""
        app = self.app
        if app.busy:
            return
        app.comparing = False
        last = self.application
        again = last is not None and last.pose == pose
        before = last.before if last is not None and again else self._start()
        # Changes of one and the same application are one step of the history.
        with app.session.edit(f"Apply {pose.name}", merges=again):
            self._put(pose, before, self.reach, 1.0)
        app.redraw()

    def apply_flipped(self, pose: Pose) -> None:
        """Put ``pose`` on the face with left and right exchanged."""
        self._safely(lambda: self.apply(flipped_pose(self.app.session.model, pose)))

    def set_strength(self, strength: float) -> None:
        """Change how far the applied pose goes, inside the edit that is open."""
        last = self.application
        if last is not None:
            self._put(last.pose, last.before, last.reach, strength)

    def reset_strength(self) -> None:
        """Let the applied pose go all the way, no further."""
        last = self.application
        if last is not None and not self.app.busy:
            with self.app.session.edit(f"Apply {last.pose.name}", merges=True):
                self.set_strength(1.0)

    def _put(self, pose: Pose, before: Array, reach: Reach, strength: float) -> None:
        session = self.app.session
        regions = None if len(reach.regions) == len(REGIONS) else reach.regions
        after = applied(session.model, before, pose, strength, regions, reach.side, reach.blend)
        session.set_start(after)
        self._application = Application(session, pose, before, after, reach, strength)

    def _start(self) -> Array:
        start = self.app.session.document.start
        return self.app.session.model.neutral() if start is None else start

    def mirror(self, source: Literal["left", "right"]) -> None:
        """Make the other side the image of the side ``source``."""
        self._settle(lambda: mirrored(self.app.session.model, self.app.session.coefficients, source), "Mirror the face")

    def flip(self) -> None:
        """Exchange left and right."""
        self._settle(lambda: flipped(self.app.session.model, self.app.session.coefficients), "Flip the face")

    def _settle(self, pose: Callable[[], Array], label: str) -> None:
        def settle() -> None:
            self.app.toolbox.cancel()
            self.app.comparing = False
            self.app.session.wait()
            self.app.session.settle(pose(), label)

        self._safely(settle)

    # Keeping

    def ask_to_save(self) -> None:
        """Ask for a name and keep this face under it."""
        self.app.toolbox.finish()
        self._name_dialog.ask("Save pose", "Save", self._free_name(), self._save)

    def ask_to_rename(self, entry: Entry) -> None:
        """Ask for another name of a pose."""

        def rename(name: str, overwrite: bool) -> None:
            self.library.rename(entry.path, name, overwrite)
            self.app.notify(f"Renamed to {name}")

        self._name_dialog.ask("Rename pose", "Rename", entry.title, rename)

    def ask_to_update(self, entry: Entry) -> None:
        """Ask whether this face is to take the place of the one that a pose has."""

        def update() -> None:
            session = self.app.session
            session.wait()
            tags = () if entry.pose is None else entry.pose.tags
            self.library.update(entry.path, pose_of(session.model, session.coefficients, entry.title, tags))
            self._picture(entry.path)

        self.app.dialogs.ask(
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

        self.app.dialogs.ask(
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
            self.app.settings.poses_folder = str(folder.resolve())
            self.category = "mine"

        start = library.folder if library.folder.is_dir() else Path.home()
        self.app.dialogs_ask(FileRequest("folder", "Folder of your poses", "Folders", (), start, choose))

    def _save(self, name: str, overwrite: bool) -> None:
        """Keep this face as the pose ``name``, with its picture.

        Raises:
            PoseExistsError: If there is one of that name that is not to be replaced.
            FacePoserError: If it cannot be written.
        """
        session = self.app.session
        session.wait()
        path = self.library.save(pose_of(session.model, session.coefficients, checked_name(name)), overwrite)
        self._picture(path)
        self.filter = ""
        if self.category != "all":
            self.category = "mine"
        self.app.notify(f"Saved the pose {name}")

    def _picture(self, path: Path) -> None:
        """Write the picture of the face beside the file ``path`` of its pose."""
        write_png(path.with_suffix(".png"), self.portraits.draw(self.app.session.coefficients, FILE_SIZE))
        self._own = None

    def _free_name(self) -> str:
        """Return a name that no pose has yet."""
        taken = {entry.title.casefold() for entry in self.entries()}
        return next(name for i in range(1, len(taken) + 2) if (name := f"Pose {i}").casefold() not in taken)

    def _safely(self, do: Callable[[], object]) -> None:
        try:
            do()
        except FacePoserError as error:
            self.app.dialogs.report("That did not work", str(error))


def _searched(entry: Entry) -> str:
    pose = entry.pose
    return entry.title.casefold() if pose is None else " ".join((pose.name, pose.note, *pose.tags)).casefold()
