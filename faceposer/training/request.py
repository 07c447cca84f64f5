"""What a user asks to be learned, however it was asked, and the way to the right kind of learning."""

from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.model.character import Character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions, character_from_examples
from faceposer.training.kinds import Kind, kind_of, plain_name
from faceposer.training.from_markers import character_from_markers
from faceposer.training.rigs import RigOptions, character_from_rig

__all__ = ["Kind", "TrainingRequest", "kind_of", "plain_name", "train"]


@dataclass(frozen=True)
class TrainingRequest:
    """Everything that training depends on.

    Attributes:
        kind: Of the source.
        source: A rig's file or folder; a folder or .npz of example meshes; a file of marker motion.
        name: Short name of the character.
        title: Name to show.
        captures: Performances, for a rig.
        neutral: The neutral mesh, where its name does not tell.
        marker_map: Where the markers are.
        scan: What the markers move: a mesh file, or a character.
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


def train(request: TrainingRequest, progress: Progress | None = None) -> Character:
    """Return the character that ``request`` describes.

    Raises:
        FacePoserError: If a file cannot be used, naming it, the place and the remedy.
        CancelledError: If the user stopped it.
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
        return character_from_rig(request.source, options, progress)
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
        return character_from_examples(request.source, example_options, progress)
    if request.marker_map is None:
        raise FacePoserError(f"The markers in '{request.source}' need a map (--marker-map) that says where they are.")
    return character_from_markers(request.source, request.marker_map, request.scan, example_options, progress)
