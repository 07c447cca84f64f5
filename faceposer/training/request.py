"""Training requests from any interface, and their dispatch by kind of source."""

from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.model.character import Character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions, character_from_examples
from faceposer.training.from_markers import character_from_markers
from faceposer.training.kinds import Kind, Sides, kind_of, plain_name
from faceposer.training.rigs import RigOptions, character_from_rig

__all__ = ["Kind", "TrainingRequest", "kind_of", "plain_name", "train"]


@dataclass(frozen=True)
class TrainingRequest:
    """All parameters of training.

    Attributes:
        kind: Kind of the source.
        source: A rig's file or folder; a folder or .npz of example meshes; a file of marker motion.
        name: Short name of the character.
        title: Displayed name.
        captures: Performances, for a rig.
        neutral: File of the neutral mesh, if its name does not identify it.
        marker_map: File with the places of the markers.
        scan: The face that the markers move: a mesh file, or a character.
        segments: See ``ExampleOptions``.
        n_dimensions: Total number of modes, chosen by their energy if None.
        n_components: Number of factor analyzers, chosen by cross-validation if None.
        n_factors: Number of factors of each, chosen by cross-validation if None.
        scheduler: Address of a Dask scheduler.
        credits: Source and licence of the character.
        align_shapes: False to read the shapes of a rig where and in the unit in which they are stored.
        weights_range: Full weight of an avatar's expressions, 1 or 100; None to infer it.
        sides: Reading of left and right in the names of a rig's shapes.
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
    align_shapes: bool = True
    weights_range: float | None = None
    sides: Sides = "auto"


def train(request: TrainingRequest, progress: Progress | None = None) -> Character:
    """Train the character that ``request`` describes.

    Raises:
        FacePoserError: If a file cannot be used.
        CancelledError: If the user cancels.
    """
    if not paths.exists(request.source):
        raise FacePoserError(f"'{request.source}' does not exist; check the path.")
    if request.kind == "rig":
        options = RigOptions(
            request.name,
            request.title,
            request.neutral,
            request.captures,
            request.n_components,
            request.n_factors,
            request.credits,
            request.align_shapes,
            request.weights_range,
            request.sides,
        )
        return character_from_rig(request.source, options, progress)
    if request.captures:
        raise FacePoserError("Performances (--capture) apply to rigs only; remove them for examples and markers.")
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
        raise FacePoserError(
            f"The markers in '{request.source}' need a map (--marker-map) of their places on the face."
        )
    return character_from_markers(request.source, request.marker_map, request.scan, example_options, progress)
