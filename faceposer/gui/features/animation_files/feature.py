"""Import of animations and trajectories from files, and key reduction."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from faceposer.animation.keyframes import TOLERANCE, Keyframes
from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.feature import Feature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest

_MENU = "Animate"
_TRAJECTORIES = (".csv", ".json", ".c3d", ".trc")
_WEIGHTS = (".csv", ".txt", ".json", ".glb", ".gltf")
# Tolerances of any rig weight, for key reduction.
_TOLERANCES = ((0.01, "Hardly any difference"), (0.02, "Small differences"), (0.05, "Visible differences"))


class AnimationFilesFeature(Feature):
    """Entries of the menu "Animate" that read files and reduce keys."""

    @property
    def timeline(self) -> TimelineFeature:
        """The timeline that receives the keys."""
        return self.context.feature(TimelineFeature)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Animate"."""

        def free() -> bool:
            return self.timeline.free

        def idle() -> bool:
            return free() and self.context.feature(TrajectoriesFeature).job is None

        return [
            Submenu(
                "reduce-keys",
                "Reduce keys",
                _MENU,
                self._reductions,
                lambda: free() and len(self.timeline.keyframes.keys) > 2,
                separated=True,
            ),
            Action(
                "open-animation",
                "Open animation...",
                _MENU,
                partial(self._ask, "Open animation", "Animations", _WEIGHTS, self.open_animation),
                enabled=free,
                separated=True,
                help="Read keys from recorded weights, such as those of Live Link Face (CSV, JSON, GLB)",
            ),
            Action(
                "open-trajectories",
                "Open trajectories...",
                _MENU,
                partial(self._ask, "Open trajectories", "Trajectories", _TRAJECTORIES, self.open_trajectories),
                enabled=idle,
                help="Animate the face to follow recorded points (CSV, JSON, C3D, TRC). Points of an image without a "
                "camera are those of the current view",
            ),
        ]

    def _reductions(self) -> list[Action]:
        return [
            Action(f"reduce-keys-{i}", f"{label} ({tolerance:g})", _MENU, partial(self.reduce, tolerance))
            for i, (tolerance, label) in enumerate(_TOLERANCES)
        ]

    def _ask(self, title: str, kind: str, suffixes: tuple[str, ...], done: Callable[[Path], None]) -> None:
        self.timeline.stop()
        start = last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", title, kind, suffixes, start, done))

    def reduce(self, tolerance: float) -> None:
        """Remove keys that interpolation reproduces within ``tolerance`` of every rig weight."""
        before = self.timeline.keyframes
        after = before.reduced(self.context.session.model, tolerance)
        if len(after.keys) == len(before.keys):
            self.context.notify("No key can be removed within this tolerance")
            return
        self.timeline.change(after, "Reduce keys")
        self.context.notify(f"Reduced {len(before.keys)} keys to {len(after.keys)}")

    def open_animation(self, path: Path) -> None:
        """Load the weights in ``path`` as the animation, after asking for the number of keys."""
        from faceposer.interchange.reading import read_performance

        context = self.context
        try:
            read = read_performance(path, context.session.model)
            dense = Keyframes.of_performance(read.performance)
        except FacePoserError as error:
            context.dialogs.report("The animation cannot be opened", str(error))
            return
        context.settings.folder = str(paths.resolved(path.parent))
        few = dense.reduced(context.session.model, TOLERANCE)
        performance = read.performance
        length = f"{counted(len(performance), 'frame', 'frames')} at {performance.rate:.5g} fps"

        def load(keyframes: Keyframes) -> None:
            self.load(keyframes, "Open an animation")
            context.notify(f"Opened {path.name}: {length}. {read.note}".strip())

        if len(few.keys) == len(dense.keys):
            load(dense)
            return
        context.dialogs.ask(
            Question(
                f"How many keys for {path.name}?",
                f"The animation has {length}, {performance.seconds:.2f} s. With "
                f"{counted(len(few.keys), 'key')}, differences are small, and the animation is easier to edit. A key "
                f"at every frame keeps the animation unchanged.{_remarks(read.note)}",
                (
                    Choice(f"{len(few.keys)} keys", lambda: load(few)),
                    Choice("Every frame", lambda: load(dense)),
                    Choice("Cancel"),
                ),
            )
        )

    def load(self, keyframes: Keyframes, label: str) -> None:
        """Replace the animation by ``keyframes``, as the step ``label`` of the history."""
        self.timeline.stop()
        self.context.toolbox.cancel()
        self.context.session.animation.load(keyframes, label)
        self.timeline.present()

    def open_trajectories(self, path: Path) -> None:
        """Solve for an animation that follows the trajectories in ``path``."""
        from faceposer.animation.trajectory_io import read_trajectories

        context = self.context
        camera = context.viewport.camera if path.suffix.lower() == ".csv" else None
        try:
            trajectories = read_trajectories(path, context.session.model.character, camera=camera)
        except FacePoserError as error:
            context.dialogs.report("The trajectories cannot be opened", str(error))
            return
        context.settings.folder = str(paths.resolved(path.parent))
        context.feature(TrajectoriesFeature).solve(trajectories, f"Follow {path.name}", None)


def _remarks(note: str) -> str:
    """Return what was assumed and lost in reading, as a paragraph of its own."""
    return f"\n\n{note}" if note else ""
