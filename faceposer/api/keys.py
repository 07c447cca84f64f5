"""Folders of key poses for cloning by examples (docs/transfer.md)."""

from os import PathLike
from pathlib import Path
from typing import Literal, Self, get_args

from faceposer.api import checks
from faceposer.files.atomic import check_sequence_folder
from faceposer.model.performance import Performance
from faceposer.session.key_compositions import Composition, compose_keys, folder_importance
from faceposer.session.key_edits import add_key, choose_keys, rename_key
from faceposer.session.key_folder import SIDES, KeyFolder, Side
from faceposer.session.key_proposals import Proposal, create_keys
from faceposer.session.keys import load_keys
from faceposer.transfer.examples import MOST_KEYS
from faceposer.transfer.key_coverage import Coverage, HelpfulFrame, coverage, helpful_frames
from faceposer.transfer.key_models import Importance

PathName = str | PathLike[str]


class KeyPoses:
    """Pairs of key poses of two characters, in a folder of plain files; ``Face.transfer_to`` follows them."""

    def __init__(self, folder: PathName) -> None:
        """Open a ``folder`` of key poses."""
        self.folder = _path(folder, "The folder of keys")
        self._files()

    @classmethod
    def create(
        cls, source: str, target: PathName, folder: PathName, poses: PathName | None = None, propose: Proposal = "auto"
    ) -> Self:
        """Create a folder of keys from the pose libraries of two characters, with proposals for missing poses.

        Args:
            source: Name or file of the character that plays.
            target: Name or file of the character that follows, or its neutral mesh (.obj, .ply).
            folder: New or empty folder.
            poses: Folder of the source's poses; None for the built-in ones.
            propose: How missing poses are proposed: "auto", "distances" or "weights".
        """
        checks.one_of(propose, get_args(Proposal), "The proposal")
        place = _path(folder, "The folder of keys")
        names = checks.path_name(source, "The source"), checks.path_name(target, "The target")
        library = None if poses is None else _path(poses, "The folder of poses")
        check_sequence_folder(place)
        create_keys(place, *names, library, proposal=propose)
        return cls(folder)

    @property
    def names(self) -> list[str]:
        """Names of the keys, complete or not."""
        return [entry.name for entry in self._files().entries()]

    def add(self, name: str, source: PathName, target: PathName | None = None, replace: bool = False) -> str:
        """Add a pair from files (pose, session, weights or mesh), and return the name of its files.

        Args:
            name: Name of the key.
            source: File of the source.
            target: File of the target; None for a proposal.
            replace: Replace a key of this name.
        """
        title, pose = checks.text(name, "The name of a key"), _path(source, "The source")
        answer = None if target is None else _path(target, "The target")
        return add_key(self._files(), title, pose, answer, replaces=replace)[0]

    def remove(self, name: str) -> None:
        """Delete the files of the key with this name."""
        self._files().remove(checks.text(name, "The name of a key"))

    def rename(self, name: str, new: str) -> str:
        """Rename a key, its files and the poses in them, and return the new name of its files."""
        return rename_key(self._files(), *(checks.text(each, "The name of a key") for each in (name, new)))

    def choose(self, take: PathName, count: int) -> list[str]:
        """Add the frames of an animation, a file of weights, that help most, and return the names of the new keys."""
        number = int(checks.number(count, 1, MOST_KEYS, "The number of keys"))
        return [name for name, _ in choose_keys(self._files(), _path(take, "The animation"), number)]

    def compose(self, meeting: Literal["smooth", "switch"] = "smooth") -> Composition:
        """Add the combinations of emotional and verbal keys; "switch" is the rule as printed in the paper."""
        checks.one_of(meeting, ("smooth", "switch"), "The rule")
        return compose_keys(self._files(), meeting)

    def importance(self, side: Side = "source") -> Importance:
        """Return the importance of the vertices of a character for speech."""
        return folder_importance(self._files(), checks.one_of(side, SIDES, "The side"))[0]

    def coverage(self, performance: Performance) -> Coverage:
        """Return how far the frames of a ``performance`` of the source are from all combinations of keys."""
        transfer = load_keys(self._files()).transfer
        return coverage(transfer, checks.performance_of(performance, transfer.source).coefficients)

    def helpful_frames(self, performance: Performance, count: int = 5) -> list[HelpfulFrame]:
        """Return up to ``count`` frames of a ``performance`` of the source that would help most as keys."""
        transfer = load_keys(self._files()).transfer
        poses = checks.performance_of(performance, transfer.source).coefficients
        return helpful_frames(transfer, poses, int(checks.number(count, 1, MOST_KEYS, "The number of frames")))

    def _files(self) -> KeyFolder:
        return KeyFolder.read(self.folder)


def _path(value: object, label: str) -> Path:
    return Path(checks.path_name(value, label))
