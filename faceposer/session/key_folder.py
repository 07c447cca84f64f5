"""Folders of key poses for cloning by examples (docs/transfer.md).

``keys.json`` names the two characters. The folders ``source`` and ``target`` have the poses, as pose files (.json) or
meshes (.obj, .ply); files of the same name are a pair.
"""

import os
import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from faceposer.errors import FacePoserError, counted
from faceposer.files import key_places, paths
from faceposer.files.atomic import atomic_files
from faceposer.files.json_documents import JsonDocument, check_header, convert, read_json
from faceposer.files.writing import write_json
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.poses.library import safe_stem
from faceposer.poses.pose_file import Pose, pose_text, read_pose
from faceposer.session.document import absolute_character
from faceposer.session.key_entries import KeyFiles, KeyTakenError, checked_key_name, count_with_neutral, delete_keys
from faceposer.transfer.examples import MOST_KEYS
from faceposer.transfer.key_parameters import FEWEST_POINTS, Regions

FORMAT, VERSION = "faceposer.keys", 1
#: Name of the file that describes a folder of keys.
DESCRIPTION = key_places.DESCRIPTION
Side = key_places.Side
SIDES = key_places.SIDES
#: Suffixes of key poses.
SUFFIXES = (".json", *POSED_MESH_SUFFIXES)
#: Tags of poses: emotional and verbal keys, which are composed to others, and those.
EXPRESSION, VISEME, COMPOSED = "expression", "viseme", "composed"

_Name = Annotated[str, Meta(min_length=1, max_length=4096)]


class _KeysFile(JsonDocument):
    source: _Name
    target: _Name
    regions: Regions = "whole"
    points: Annotated[tuple[_Name, ...], Meta(min_length=1, max_length=200)] | None = None
    threshold: Annotated[float, Meta(ge=1e-15, le=0.5)] | None = None
    expressions: Annotated[tuple[_Name, ...], Meta(max_length=MOST_KEYS)] = ()
    visemes: Annotated[tuple[_Name, ...], Meta(max_length=MOST_KEYS)] = ()


@dataclass(frozen=True)
class KeyFolder:
    """A folder of key poses.

    Attributes:
        folder: The folder.
        source: Name or file of the character that plays.
        target: Name or file of the character that follows; the neutral mesh (.obj, .ply) of one without shapes.
        regions: Regions that are cloned separately.
        points: Feature points of the source that give the parameters; None for all.
        expressions: Names of the emotional keys, beside the poses with the tag "expression".
        visemes: Names of the verbal keys, beside the poses with the tag "viseme".
        threshold: Share of the largest variance of the keys below which directions are dropped; None to damp them.
    """

    folder: Path
    source: str
    target: str
    regions: Regions = "whole"
    points: tuple[str, ...] | None = None
    expressions: tuple[str, ...] = ()
    visemes: tuple[str, ...] = ()
    threshold: float | None = None

    @classmethod
    def read(cls, folder: Path) -> "KeyFolder":
        """Return the folder of keys in ``folder``.

        Raises:
            FacePoserError: If it has no valid description.
        """
        path = folder / DESCRIPTION
        if not paths.is_file(path):
            if not paths.exists(folder):
                raise FacePoserError(f"There is no folder '{folder}'; choose or create another folder of key poses.")
            raise FacePoserError(
                f"'{folder}' is not a folder of keys: it has no '{DESCRIPTION}'; choose or create another one."
            )
        return read_json(path, "keys", lambda data: cls.from_json(folder, data))

    @classmethod
    def from_json(cls, folder: Path, data: Any) -> "KeyFolder":
        """Return the folder of keys described by ``data``.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; the message names it.
        """
        check_header(data, FORMAT, VERSION)
        form = convert(data, _KeysFile)
        both = sorted({*form.expressions} & {*form.visemes})
        if both:
            raise FacePoserError(f"expressions and visemes both name '{both[0]}'; leave it in one of them.")
        points = form.points
        if points is not None and len({*points}) < FEWEST_POINTS:
            raise FacePoserError(
                f"points names {counted(len({*points}), 'feature point')}, but cloning needs at least {FEWEST_POINTS}; "
                "add others, or remove points to use all of the source."
            )
        return cls(
            folder,
            form.source,
            form.target,
            form.regions,
            form.points,
            form.expressions,
            form.visemes,
            form.threshold,
        )

    def write(self) -> None:
        """Write the description of the folder, which is created if necessary.

        Raises:
            FacePoserError: If it cannot be written.
        """
        data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "source": self.source, "target": self.target}
        if self.regions != "whole":
            data["regions"] = self.regions
        if self.threshold is not None:
            data["threshold"] = self.threshold
        for name in ("points", "expressions", "visemes"):
            if getattr(self, name):
                data[name] = list(getattr(self, name))
        try:
            for side in SIDES:
                (self.folder / side).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FacePoserError(
                f"The folder '{self.folder}' cannot be created: {error.strerror}; choose another one."
            ) from error
        write_json(self.folder / DESCRIPTION, data, "description of the keys", ascii_only=False)

    def character(self, side: Side) -> str:
        """Return the name or path of a character, with paths relative to the folder made absolute."""
        name = self.source if side == "source" else self.target
        if Path(name).suffix.lower() in POSED_MESH_SUFFIXES:
            return os.path.normpath((self.folder / paths.expand_user(name)).absolute())
        return absolute_character(name, self.folder.absolute())

    @property
    def is_mesh(self) -> bool:
        """True if the target is a mesh without shapes."""
        return Path(self.target).suffix.lower() in POSED_MESH_SUFFIXES

    def entries(self) -> list[KeyFiles]:
        """Return the keys of the folder by name, complete or not.

        Raises:
            FacePoserError: If a folder cannot be listed, or has too many.
        """
        entries = self._listed()
        count = count_with_neutral([entry.name for entry in entries])
        if count > MOST_KEYS:
            raise FacePoserError(
                f"'{self.folder}' has {count} keys with the neutral face, more than the maximum of {MOST_KEYS}; remove "
                "some of them."
            )
        return entries

    def _listed(self) -> list[KeyFiles]:
        """Return the keys by name, however many there are."""
        found = {side: self._files(side) for side in SIDES}
        names = sorted({*found["source"], *found["target"]})
        return [KeyFiles.of(name, *(found[side].get(name, []) for side in SIDES)) for name in names]

    def entry(self, name: str) -> KeyFiles | None:
        """Return the key with this name, or None.

        Raises:
            FacePoserError: If a folder cannot be listed, or the key has two files of one side.
        """
        entry = next((entry for entry in self._listed() if entry.name == name), None)
        if entry is not None and entry.problem:
            raise FacePoserError(entry.problem)
        return entry

    def existing(self, name: str) -> KeyFiles:
        """Return the key with this name.

        Raises:
            FacePoserError: If there is none, a folder cannot be listed, or the key has two files of one side.
        """
        entry = self.entry(name)
        if entry is None:
            near = get_close_matches(name, [entry.name for entry in self._listed()], 1)
            help_ = f"did you mean '{near[0]}'?" if near else f"its keys are the files in '{self.folder / 'source'}'."
            raise FacePoserError(f"'{self.folder}' has no key '{name}'; {help_}")
        return entry

    def check_room(self, more: int) -> None:
        """Check that ``more`` keys can be added.

        Raises:
            FacePoserError: If the folder would have too many.
        """
        room = MOST_KEYS - count_with_neutral([entry.name for entry in self._listed()])
        if more > room:
            left = f"only {room} can be added" if room > 0 else "none can be added"
            raise FacePoserError(
                f"'{self.folder}' may have {MOST_KEYS} keys with the neutral face: {left}; remove others first."
            )

    def place(self, entry: KeyFiles | None, name: str, side: Side, suffix: str) -> Path:
        """Return the file that is written for one side of the key ``name``.

        Args:
            entry: The key, if there is one.
            name: Its name.
            side: Side that is written.
            suffix: Format, such as ".json"; the present file is replaced if it has this one, in any spelling.
        """
        present: Path | None = None if entry is None else getattr(entry, side)
        if present is not None and present.suffix.lower() == suffix:
            return present
        return self.folder / side / f"{name}{suffix}"

    def pairs(self) -> list[KeyFiles]:
        """Return the keys of the folder, all of them with both files.

        Raises:
            FacePoserError: If one lacks a file.
        """
        entries = self.entries()
        for entry in entries:
            self.complete(entry)
        return entries

    def complete(self, entry: KeyFiles) -> tuple[Path, Path]:
        """Return the files of both sides of a key.

        Raises:
            FacePoserError: If it lacks one, or has two of one side.
        """
        if entry.problem:
            raise FacePoserError(entry.problem)
        for side in SIDES:
            if getattr(entry, side) is None:
                suffix = "obj" if side == "target" and self.is_mesh else "json"
                raise FacePoserError(
                    f"The key '{entry.name}' has no {side} in '{self.folder / side}'; add a pose or a mesh with "
                    f"this name there, such as '{entry.name}.{suffix}', or remove the key."
                )
        assert entry.source is not None
        assert entry.target is not None
        return entry.source, entry.target

    def _files(self, side: Side) -> dict[str, list[Path]]:
        folder = self.folder / side
        try:
            files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.name[0] != ".")
        except OSError as error:
            raise FacePoserError(
                f"The folder '{folder}' of the keys cannot be listed: {error.strerror}; put it back, or choose another "
                "folder of key poses."
            ) from error
        found: dict[str, list[Path]] = {}
        for path in files:
            found.setdefault(path.stem, []).append(path)
        return found

    def kinds(self) -> Mapping[str, str]:
        """Return the kind of each key that has one: "expression", "viseme" or "composed".

        Raises:
            FacePoserError: If a pose cannot be read.
        """
        kinds: dict[str, str] = {}
        for entry in self.entries():
            tags: set[str] = set()
            for path in (entry.source, entry.target):
                if path is not None and path.suffix.lower() == ".json":
                    tags.update(read_pose(path).tags)
            kind = self.kind_of(entry.name, tags)
            if kind:
                kinds[entry.name] = kind
        return kinds

    def kind_of(self, name: str, tags: Collection[str]) -> str:
        """Return the kind of the key ``name`` whose poses have these ``tags``, or ""."""
        known = {*tags}
        if name in self.expressions:
            known.add(EXPRESSION)
        if name in self.visemes:
            known.add(VISEME)
        return next((kind for kind in (COMPOSED, VISEME, EXPRESSION) if kind in known), "")

    def add(self, source: Pose, target: Pose | Path | None, replace: bool = False, durable: bool = True) -> str:
        """Write a pair, named as ``source``, and return the name of its files.

        Args:
            source: Pose of the source.
            target: Pose of the target, or a mesh that is copied; None to leave it to the artist, and to keep that of a
                key that is replaced.
            replace: Replace a key of this name, when the new one is complete.
            durable: See ``atomic_file``.

        Raises:
            FacePoserError: If the name is taken and ``replace`` is False, there are too many keys, or a file cannot be
                written; then nothing has changed.
        """
        name = safe_stem(checked_key_name(source.name))
        old = self.entry(name)
        if old is None:
            self.check_room(1)
        elif not replace:
            raise KeyTakenError(self.folder, name)
        written: dict[Path, Pose | Path] = {self.place(old, name, "source", ".json"): source}
        if target is not None:
            suffix = ".json" if isinstance(target, Pose) else target.suffix.lower()
            written[self.place(old, name, "target", suffix)] = target
        with atomic_files(list(written), "key", durable) as temporaries:
            for (path, content), temporary in zip(written.items(), temporaries, strict=True):
                if isinstance(content, Pose):
                    temporary.write_text(pose_text(path, content), encoding="utf-8", newline="\n")
                else:
                    shutil.copyfile(content, temporary)
        # Files in other formats are deleted last: a key is never without its old or its new ones.
        replaced = () if old is None else (old.source, None if target is None else old.target)
        delete_keys(path for path in replaced if path is not None and path not in written)
        return name

    def remove(self, name: str) -> None:
        """Delete the files of the key with this name.

        Raises:
            FacePoserError: If there is none, or a file cannot be deleted.
        """
        entry = self.existing(name)
        delete_keys(path for path in (entry.source, entry.target) if path is not None)
        if name in (*self.expressions, *self.visemes):
            expressions, visemes = (
                tuple(other for other in names if other != name) for names in (self.expressions, self.visemes)
            )
            replace(self, expressions=expressions, visemes=visemes).write()
