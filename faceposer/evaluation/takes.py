"""Performances as a study wants them: read, cleaned of tracking errors but not of sparse frames, split into folds."""

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

from faceposer.errors import FacePoserError
from faceposer.evaluation.setting import StudyContext
from faceposer.files.reading import open_text, read_bytes
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_file import load_character
from faceposer.training.capture import Capture, read_capture
from faceposer.training.expressions import Recipe, clean

Array = NDArray[np.float64]
Sparse = Literal["auto", "yes", "no"]

#: Shares of a take, from its first frame, that the folds learn from and test on. Between the two a gap is left out,
#: since neighbouring frames are alike.
FOLDS: dict[int, tuple[tuple[float, float], tuple[float, float]]] = {
    1: ((0.0, 0.60), (0.62, 1.0)),
    2: ((0.40, 1.0), (0.0, 0.38)),
}
# A take with fewer frames a second is sparse: between two of its frames a face may do anything.
_SPARSE_RATE = 10
# Where no times tell, a take is sparse if so many of its frames seem to jump.
_SPARSE_SHARE = 0.2
# Jumps that no weight can make.
_NO_JUMP = 1e9
# The rate up to which a recipe's ``jump`` is the change between two frames: at twice the rate motion has half of it.
_JUMP_RATE = 30.0


@dataclass(frozen=True)
class Source:
    """What a study learns from and is tested on, by name.

    Attributes:
        character: Name or file of the face.
        captures: Files to learn from.
        tests: Files to test on; those to learn from if there is a ``fold``.
        recipe: How the shipped prior is learned.
        fold: Number of a fold of the captures, or None to learn from all of them and test on ``tests``.
        sparse: Whether the frames of a take are too far apart for jumps to tell of tracking errors; "auto" looks.
        performers: Name of the performer of each of the ``captures``; if left out, all are of one.
        left_out: Name of the performer of the ``tests`` where performers are left out in turn, else None.
        within: Name of the only performer whose takes a ``fold`` splits; the others' are wholly learned from. None to
            split all takes.
        contact: Whether faces are measured after the contact step.
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
        """Return the setting, and the frames to test on as weights of the character's shapes, shape (F, S).

        Raises:
            FacePoserError: If a file cannot be read, or the character has none of ARKit's shapes.
        """
        character = load_character(self.character)
        # Each take is cleaned as it needs; the recipe then finds nothing left to drop.
        recipe = replace(self.recipe, jump=_NO_JUMP)
        learned = [steady(path, self.recipe.jump, self.sparse) for path in self.captures]
        if self.fold is None:
            tests = [steady(path, self.recipe.jump, self.sparse) for path in self.tests]
        else:
            first, second = FOLDS[self.fold]
            split = [self.within in (None, name) for name in self._owners]
            tests = [_part(take, second) for take, parts in zip(learned, split, strict=True) if parts]
            learned = [_part(take, first) if parts else take for take, parts in zip(learned, split, strict=True)]
        setting = replace(StudyContext.of(character, learned, recipe, self.performers), contact=self.contact)
        return setting, setting.rig_weights(np.concatenate([clean(take, recipe) for take in tests]))

    @property
    def _owners(self) -> tuple[str, ...]:
        return self.performers or ("",) * len(self.captures)

    def identity(self, character: Character) -> dict[str, object]:
        """Return what tells this source from another, for JSON: checksums of what is in the files, not their names.

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
            # Absent from studies without it, so that those of older versions go on.
            **({"contact": True} if self.contact else {}),
            "recipe": {name: getattr(self.recipe, name) for name in self.recipe.__dataclass_fields__},
        }


def steady(path: Path, jump: float, sparse: Sparse = "auto") -> Capture:
    """Return the take in ``path`` with all of ARKit's shapes, without frames that ``jump`` if it is not sparse.

    Args:
        path: Of the take.
        jump: Change of a weight between two frames, at up to 30 frames a second, that is taken for a tracking error; of
            takes with more frames a second, as much less as there are more.
        sparse: Whether its frames are too far apart for that.

    Raises:
        FacePoserError: If the file cannot be read as a capture.
    """
    take = read_capture(path).with_shapes(ARKIT_SHAPES)
    rate = frames_a_second(path)
    without = take.without_jumps(jump * min(1.0, _JUMP_RATE / (rate or _JUMP_RATE)))
    if sparse == "auto":
        dropped = 1.0 - len(without.weights) / len(take.weights)
        sparse = "yes" if (rate is not None and rate < _SPARSE_RATE) or dropped > _SPARSE_SHARE else "no"
    return take if sparse == "yes" else without


def frames_a_second(path: Path) -> float | None:
    """Return how many frames of the take in ``path`` fall into one second by its times, or None where it has none."""
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
            f"A capture of {len(take.weights)} frames is too short to learn from one part and test on another; "
            "give a longer one, or another to test on with --capture-test."
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
