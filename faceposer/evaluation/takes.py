"""Performances of a study: read, cleaned of tracking errors unless frames are sparse, and split into folds."""

import csv
import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.evaluation.setting import StudyContext
from faceposer.files.reading import open_text, read_bytes
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_file import load_character
from faceposer.training.capture import Capture, read_capture
from faceposer.training.expressions import Recipe, clean

Array = NDArray[np.float64]
Sparse = Literal["auto", "yes", "no"]

#: Ranges of a take, as shares of its frames, that each fold learns from and tests on. The gap in between is not used,
#: since neighbouring frames are similar.
FOLDS: dict[int, tuple[tuple[float, float], tuple[float, float]]] = {
    1: ((0.0, 0.60), (0.62, 1.0)),
    2: ((0.40, 1.0), (0.0, 0.38)),
}
# Frames per second below which a take is sparse: a face can change arbitrarily between two of its frames.
_SPARSE_RATE = 10
# Share of frames that seem to jump above which a take without timestamps is sparse.
_SPARSE_SHARE = 0.2
# A threshold for jumps that no weight reaches.
_NO_JUMP = 1e9
# Frame rate up to which a recipe's ``jump`` is the change between two frames; at twice the rate, it is half of it.
_JUMP_RATE = 30.0


@dataclass(frozen=True)
class Source:
    """Training and test data of a study, by file name.

    Attributes:
        character: Name or file of the face.
        captures: Files to learn from.
        tests: Files to test on; ignored with a ``fold``.
        recipe: Recipe of the shipped prior.
        fold: Number of a fold of the captures, or None to learn from all of them and test on ``tests``.
        sparse: "yes" if frames are too far apart in time for jumps to indicate tracking errors; "auto" decides by the
            timestamps.
        performers: Name of the performer of each of the ``captures``; empty if all are of one performer.
        left_out: Name of the performer of the ``tests`` in leave-one-out studies, else None.
        within: Name of the only performer whose takes are split by ``fold``; those of others are used for learning as
            a whole. None to split all takes.
        contact: True if faces are measured after the contact step.
    """

    character: str
    captures: tuple[Path, ...]
    tests: tuple[Path, ...]
    recipe: Recipe
    fold: int | None = None
    sparse: Sparse = "auto"
    performers: tuple[str, ...] = ()
    left_out: str | None = None
    within: str | None = None
    contact: bool = False

    def load(self) -> tuple[StudyContext, Array]:
        """Return the setting, and the test frames as weights of the character's shapes, shape (F, S).

        Raises:
            FacePoserError: If a file cannot be read, or the character has none of ARKit's shapes.
        """
        character = load_character(self.character)
        # Takes are cleaned here, individually, so that the recipe need not drop jumps.
        recipe = replace(self.recipe, jump=_NO_JUMP)
        learned = [steady(path, self.recipe.jump, self.sparse) for path in self.captures]
        if self.fold is None:
            tests = [steady(path, self.recipe.jump, self.sparse) for path in self.tests]
        else:
            first, second = FOLDS[self.fold]
            is_split = [self.within in (None, name) for name in self._owners]
            tests = [_part(take, second) for take, split in zip(learned, is_split, strict=True) if split]
            learned = [_part(take, first) if split else take for take, split in zip(learned, is_split, strict=True)]
        setting = replace(StudyContext.of(character, learned, recipe, self.performers), contact=self.contact)
        return setting, setting.rig_weights(np.concatenate([clean(take, recipe) for take in tests]))

    @property
    def _owners(self) -> tuple[str, ...]:
        return self.performers or ("",) * len(self.captures)

    def identity(self, character: Character) -> dict[str, object]:
        """Return the identity of this data, for JSON: checksums of the contents of files.

        Raises:
            FacePoserError: If a file cannot be read.
        """
        digest = hashlib.sha256()
        for array in (character.vertices, character.polygons, character.shapes):
            digest.update(np.ascontiguousarray(array).tobytes())
        tests = self.captures if self.fold is not None else self.tests
        return {
            "subject": character.name,
            "subject_sha256": digest.hexdigest(),
            "performer_left_out": self.left_out,
            "captures": [
                {"file": path.name, "sha256": _checksum(path), **({"performer": performer} if performer else {})}
                for path, performer in zip(self.captures, self._owners, strict=True)
            ],
            "captures_test": [{"file": path.name, "sha256": _checksum(path)} for path in tests],
            "fold": self.fold,
            "fold_within": self.within,
            "sparse": self.sparse,
            # Omitted without contact, so that studies of older versions can be continued.
            **({"contact": True} if self.contact else {}),
            "recipe": {name: getattr(self.recipe, name) for name in self.recipe.__dataclass_fields__},
        }


def steady(path: Path, jump: float, sparse: Sparse = "auto") -> Capture:
    """Read a take with all of ARKit's shapes, without frames that jump unless it is sparse.

    Args:
        path: File of the take.
        jump: Change of a weight between two frames that indicates a tracking error, at up to 30 frames per second; at
            higher rates, it is scaled down in proportion.
        sparse: "yes" if frames are too far apart in time for this test; "auto" decides by the timestamps.

    Raises:
        FacePoserError: If the file cannot be read as a capture.
    """
    take = read_capture(path).with_shapes(ARKIT_SHAPES)
    rate = frames_a_second(path)
    cleaned = take.without_jumps(jump * min(1.0, _JUMP_RATE / (rate or _JUMP_RATE)))
    if sparse == "auto":
        dropped = 1.0 - len(cleaned.weights) / len(take.weights)
        sparse = "yes" if (rate is not None and rate < _SPARSE_RATE) or dropped > _SPARSE_SHARE else "no"
    return take if sparse == "yes" else cleaned


def frames_a_second(path: Path) -> float | None:
    """Return the median number of frames per second of the take in ``path``, or None without timestamps."""
    seconds: Counter[str] = Counter()
    with open_text(path, "utf-8-sig", newline="") as file:
        for cells in csv.reader(file):
            first = cells[0].strip() if cells else ""
            if match := re.match(r"(\d+:\d+:\d+)\b", first):
                seconds[match.group(1)] += 1
            elif first.lower() == "k" and len(cells) > 1 and re.fullmatch(r"\d+(\.\d*)?", cells[1].strip()):
                seconds[str(int(float(cells[1])) // 1000)] += 1
    return float(np.median(list(seconds.values()))) if seconds else None


def _part(take: Capture, shares: Sequence[float]) -> Capture:
    begin, end = (round(share * len(take.weights)) for share in shares)
    if end - begin < 2:
        raise FacePoserError(
            f"A capture of {counted(len(take.weights), 'frame')} is too short to be split into training and "
            f"test frames; give a "
            "longer one, or test on another with --capture-test."
        )
    return replace(take, weights=take.weights[begin:end])


def _checksum(path: Path) -> str:
    try:
        return hashlib.sha256(read_bytes(path)).hexdigest()
    except OSError as error:
        raise FacePoserError(
            f"The capture '{path}' cannot be read ({error.strerror}); give a CSV file of Live Link Face or a text of "
            "Face Cap."
        ) from error
