"""What a user asks to be learned, however it was asked, and the way to the right kind of learning."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import GLTF_SUFFIXES
from faceposer.geometry.mesh_sequence import ARRAY_SUFFIX
from faceposer.model.shape_names import canonical_shape
from faceposer.model.subject import Subject
from faceposer.training.examples import ExampleOptions, subject_from_examples
from faceposer.training.marked import subject_from_markers
from faceposer.training.progress import Progress
from faceposer.training.rigs import RigOptions, subject_from_rig

Kind = Literal["rig", "examples", "markers"]

# So many files called like ARKit's shapes make a folder a rig and not a heap of examples.
_SHAPES_IN_RIG = 5
_MARKER_SUFFIXES = (".c3d", ".csv")


@dataclass(frozen=True)
class TrainingRequest:
    """Everything that training depends on.

    Attributes:
        kind: Of the source.
        source: A rig's file or folder; a folder or .npz of example meshes; a file of marker motion.
        name: Short name of the subject.
        title: Name to show.
        captures: Performances, for a rig.
        neutral: The neutral mesh, where its name does not tell.
        marker_map: Where the markers are.
        scan: What the markers move: a mesh file, or a subject.
        segments: See ``ExampleOptions``.
        n_dimensions: Number of modes; chosen by energy if None.
        n_components: Number of factor analyzers; chosen by data left out if None.
        n_factors: Number of factors of each; likewise.
        scheduler: Address of a Dask scheduler.
        credits: Where the character comes from, and its licence.
    """

    kind: Kind
    source: Path
    name: str
    title: str
    captures: tuple[Path, ...] = ()
    neutral: Path | None = None
    marker_map: Path | None = None
    scan: str = "man"
    segments: str | int = "face"
    n_dimensions: int | None = None
    n_components: int | None = None
    n_factors: int | None = None
    scheduler: str | None = None
    credits: str = ""


def train(request: TrainingRequest, progress: Progress | None = None) -> Subject:
    """Return the subject that ``request`` describes.

    Raises:
        FacePoserError: If a file cannot be used, naming it, the place and the remedy.
        TrainingCancelled: If the user stopped it.
    """
    if not request.source.exists():
        raise FacePoserError(f"There is no '{request.source}'; check the path.")
    if request.kind == "rig":
        options = RigOptions(
            request.name,
            request.title,
            request.neutral,
            request.captures,
            request.n_components,
            request.n_factors,
            request.credits,
        )
        return subject_from_rig(request.source, options, progress)
    if request.captures:
        raise FacePoserError("Performances (--capture) say how a rig's shapes move; examples and markers need none.")
    example_options = ExampleOptions(
        request.name,
        request.title,
        request.neutral,
        request.segments,
        request.n_dimensions,
        request.n_components,
        request.n_factors,
        request.scheduler,
        request.credits,
    )
    if request.kind == "examples":
        return subject_from_examples(request.source, example_options, progress)
    if request.marker_map is None:
        raise FacePoserError(f"The markers in '{request.source}' need a map (--marker-map) that says where they are.")
    return subject_from_markers(request.source, request.marker_map, request.scan, example_options, progress)


def kind_of(source: Path) -> Kind:
    """Return what ``source`` most likely is: a rig, examples or markers.

    Raises:
        FacePoserError: If it is none of them.
    """
    suffix = source.suffix.lower()
    if source.is_dir():
        shapes = [path for path in source.iterdir() if _last_name(path.stem) is not None]
        return "rig" if len(shapes) >= _SHAPES_IN_RIG else "examples"
    if suffix in GLTF_SUFFIXES:
        return "rig"
    if suffix == ARRAY_SUFFIX:
        return "examples"
    if suffix in _MARKER_SUFFIXES:
        return "markers"
    raise FacePoserError(
        f"'{source}' is nothing to learn a character from; give a glTF file with shapes, a folder of meshes, or the "
        "motion of markers."
    )


def plain_name(path: Path) -> str:
    """Return a short name for a subject from the name of its source."""
    name = re.sub(r"[^a-z0-9]+", "-", (path.name if path.is_dir() else path.stem).lower()).strip("-")
    return name or "character"


def _last_name(stem: str) -> str | None:
    """Return the ARKit shape that a file is called after, whatever stands before it."""
    words = re.split(r"[-.\s]+", stem)
    return canonical_shape(stem) or canonical_shape(words[-1])
