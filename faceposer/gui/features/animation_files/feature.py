"""Animations and trajectories from files, and fewer keys of what came from there."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from faceposer.animation.keyframes import TOLERANCE, Keyframes
from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.feature import Feature
from faceposer.gui.features.timeline.feature import TimelineFeature, counted
from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest

_MENU = "Animate"
_TRAJECTORIES = (".csv", ".json", ".c3d")
_WEIGHTS = (".csv", ".txt", ".json")
# Of fewer keys, how far any rig weight may be off.
_TOLERANCES = ((0.01, "Hardly any difference"), (0.02, "Small differences"), (0.05, "Visible differences"))


class AnimationFilesFeature(Feature):
    """What the menu "Animate" reads."""

    @property
    def timeline(self) -> TimelineFeature:
        """Where the keys go."""
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
                partial(self._ask, "Open an animation", "Animations", _WEIGHTS, self.open_animation),
                enabled=free,
                separated=True,
                help="Take the keys from weights over time, as Live Link Face writes them (CSV, JSON)",
            ),
            Action(
                "open-trajectories",
                "Open trajectories...",
                _MENU,
                partial(self._ask, "Open trajectories", "Trajectories", _TRAJECTORIES, self.open_trajectories),
                enabled=idle,
                help="Let the face follow trajectories of points (CSV, JSON, C3D); those in a picture take its camera, "
                "or the present view",
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
        """Leave out the keys that the others tell of, but for ``tolerance`` in any rig weight."""
        before = self.timeline.keyframes
        after = before.reduced(self.context.session.model, tolerance)
        if len(after.keys) == len(before.keys):
            self.context.notify("Every key is needed for that")
            return
        self.timeline.change(after, "Reduce keys")
        self.context.notify(f"{counted(after.keys)} of {len(before.keys)} are left")

    def open_animation(self, path: Path) -> None:
        """Make the weights in ``path`` the animation, with as many keys as the user wants."""
        from faceposer.interchange.reading import read_performance

        context = self.context
        try:
            read = read_performance(path, context.session.model)
            dense = Keyframes.of_performance(read.performance)
        except FacePoserError as error:
            context.dialogs.report("The animation is not opened", str(error))
            return
        context.settings.folder = str(path.parent.resolve())
        few = dense.reduced(context.session.model, TOLERANCE)

        def load(keyframes: Keyframes) -> None:
            self.load(keyframes, "Open an animation")
            context.notify(f"Opened {path.name}. {read.note}".strip())

        if len(few.keys) == len(dense.keys):
            load(dense)
            return
        context.dialogs.ask(
            Question(
                f"How many keys for {path.name}?",
                f"It has {len(dense.keys)} frames. With {len(few.keys)} keys it can be edited by hand, and no shape is "
                f"off by more than {TOLERANCE:g} in between. A key at every frame keeps it as it is.",
                (
                    Choice(f"{len(few.keys)} keys", lambda: load(few)),
                    Choice("Every frame", lambda: load(dense)),
                    Choice("Cancel"),
                ),
            )
        )

    def load(self, keyframes: Keyframes, label: str) -> None:
        """Make ``keyframes`` the animation, as the step ``label``."""
        self.timeline.stop()
        self.context.toolbox.cancel()
        self.context.session.animation.load(keyframes, label)
        self.timeline.present()

    def open_trajectories(self, path: Path) -> None:
        """Let the face follow the trajectories in ``path``; what comes of it is the animation."""
        from faceposer.animation.trajectory_io import read_trajectories

        context = self.context
        camera = context.viewport.camera if path.suffix.lower() == ".csv" else None
        try:
            trajectories = read_trajectories(path, context.session.model.character, camera=camera)
        except FacePoserError as error:
            context.dialogs.report("The trajectories are not opened", str(error))
            return
        context.settings.folder = str(path.parent.resolve())
        context.feature(TrajectoriesFeature).begin(trajectories, f"Follow {path.name}", None)
