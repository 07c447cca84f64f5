"""Characters from example meshes of one topology, controlled by the principal modes of their regions."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.names import displayable
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.mesh_sequence import MeshSequence, open_sequence
from faceposer.geometry.mtl_io import read_obj_textures
from faceposer.geometry.shape_alignment import implausible, lay_on, search_tree
from faceposer.model.character import Character
from faceposer.progress import Progress
from faceposer.training.assemble import CanonicalMesh, assemble
from faceposer.training.canonical_frame import frame_from_motion
from faceposer.training.drawn_points import DrawnPoints, drawn_feature_points
from faceposer.training.eyes import misplaced_eyes
from faceposer.training.frames import (
    AlignedReader,
    FrameStore,
    implausible_frame,
    sample_of,
    spool_frames,
    steady_vertices,
)
from faceposer.training.measures import Curves, curves_of
from faceposer.training.mode_statistics import statistics_of_modes
from faceposer.training.modes import Modes, learn_modes, local_metric
from faceposer.training.segments import Segments, face_segments, find_segments, whole_face

if TYPE_CHECKING:
    # Imported late to shorten the start of the window.
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# Number of clusters, before splitting by sides, for a face too unlike the built-in man to use his regions.
_CLUSTERS = 4
# Margin of a mode's limits beyond the extremes of the examples, as a share of their range.
_MARGIN = 0.1
_MOST_CURVE = 40
# With fewer examples, the generalization to others cannot be judged.
_FEW = 12
# Ratio to the size of the neutral from which a mesh is in another unit.
_OTHER_SIZE = 1.25
# Largest acceptable distance of held-out examples, as a share of their distance from neutral.
_POOR = 0.5
# Factors between common units, and the relative deviation that expressions cause.
_COMMON_UNITS = (0.001, 0.01, 0.0254, 0.1, 0.3048, 1.0 / 2.54, 2.54, 10.0, 25.4, 30.48, 100.0, 1000.0)
_NEAR_UNIT = 0.03


@dataclass(frozen=True)
class ExampleOptions:
    """Options for training from examples.

    Attributes:
        name: Short name of the character.
        title: Displayed name.
        neutral: File of the neutral mesh, if its name does not identify it.
        segments: Regions with separate modes: "face" for brows, eyes, ears and mouth, "whole" for a single region, or
            the number of regions to find by clustering the motion.
        n_dimensions: Total number of modes, chosen by their energy if None.
        n_components: Number of factor analyzers, chosen by cross-validation if None.
        n_factors: Number of factors of each, chosen by cross-validation if None.
        scheduler: Address of a Dask scheduler, for more frames than one machine can hold.
        credits: Source and licence of the character.
    """

    name: str
    title: str
    neutral: Path | None = None
    segments: str | int = "face"
    n_dimensions: int | None = None
    n_components: int | None = None
    n_factors: int | None = None
    scheduler: str | None = None
    credits: str = ""


def character_from_examples(path: Path, options: ExampleOptions, progress: Progress | None = None) -> Character:
    """Train a character from the example meshes in ``path``, a folder or a .npz file.

    Raises:
        FacePoserError: If a file cannot be used.
    """
    progress = progress or Progress()
    progress.at("Opening the files")
    return character_from_sequence(open_sequence(path, options.neutral), path.name, options, progress)


def character_from_sequence(
    sequence: MeshSequence, source: str, options: ExampleOptions, progress: Progress, mesh: CanonicalMesh | None = None
) -> Character:
    """Train a character from the example meshes of ``sequence``.

    Args:
        sequence: The examples.
        source: Name of their source, for the summary.
        options: Options for training.
        progress: Progress to update.
        mesh: The neutral mesh in canonical form, with its parts; determined from the motion if None.

    Raises:
        FacePoserError: If the examples cannot be used.
    """
    if len(sequence) < 2:
        raise FacePoserError(f"'{source}' has a single mesh; give at least two, one of them neutral.")
    neutral = sequence.neutral.vertices
    sample, steady, sizes = _aligned_sample(sequence, source, progress)
    motion = np.einsum("fmd,fmd->m", sample, sample, dtype=np.float64) / len(sample)
    size = float(np.ptp(neutral, axis=0).max())
    if not motion.max() > (1e-5 * size) ** 2:
        raise FacePoserError(f"The meshes of '{source}' are all the same; add examples of different expressions.")
    textures: dict[str, bytes] = {}
    notes = _size_notes(sizes)
    drawn = DrawnPoints({}, {})
    if mesh is None:
        found = frame_from_motion(neutral, sequence.neutral.triangles(), motion)
        if found is None:
            raise FacePoserError(
                f"The meshes of '{source}' are too unlike a face to determine their orientation; give meshes of a face."
            )
        upright, resembles_man = found
        if sequence.neutral_path is not None:
            textures, problems = read_obj_textures(sequence.neutral_path, sequence.neutral)
            notes += problems
        mesh = replace(assemble(sequence.neutral, upright, sample, textures), resembles_man=resembles_man)
        progress.at("Finding eyes, brows and mouth")
        drawn = drawn_feature_points(mesh)

    progress.at("Finding the regions")
    triangles = _triangles(mesh)
    vertices = mesh.vertices.astype(np.float64)
    own_sample = mesh.displacements(sample)
    segments = _segments(options.segments, mesh, triangles, own_sample)
    metric = local_metric(vertices, triangles, motion[mesh.file_ids])
    with _store(AlignedReader(sequence, steady, bool(len(sizes))), options.scheduler, progress) as store:
        modes = learn_modes(store, sample, segments, metric, mesh.file_ids, options.n_dimensions)
    progress.at("Choosing the size of the prior")
    statistics, choice = statistics_of_modes(modes, options.n_components, options.n_factors, progress)
    lower, upper = np.minimum(modes.weights.min(axis=0), 0.0), np.maximum(modes.weights.max(axis=0), 0.0)
    room = _MARGIN * (upper - lower)
    shapes = mesh.displacements(modes.fields)
    progress.at("Evaluating the model")
    flat = own_sample.reshape(len(own_sample), -1)
    curves = curves_of((flat @ flat.T).astype(np.float64), len(mesh.vertices), _MOST_CURVE)
    summary: dict[str, Any] = {
        "kind": "examples",
        "source": displayable(source),
        "neutral": displayable(sequence.neutral_name).removeprefix("the neutral "),
        "examples": len(sequence),
        "vertices": len(neutral),
        "parts": [part.name for part in mesh.parts],
        "dimensions": len(modes.names),
        **_kept_energy(shapes, own_sample, modes, segments),
        "settled": modes.converged,
        "points_from_pictures": len(drawn.points),
        "prior": {"from": "examples", **choice.as_json()},
        "curves": curves.as_json(),
        "warnings": [
            *notes,
            *_warnings(len(sequence), curves, modes),
            *misplaced_eyes(mesh.vertices, mesh.parts),
            *choice.warnings,
        ],
    }
    return Character(
        name=options.name,
        title=options.title,
        vertices=mesh.vertices,
        polygons=mesh.polygons,
        uv=mesh.uv,
        polygon_uvs=mesh.polygon_uvs,
        parts=mesh.parts,
        shape_names=modes.names,
        shapes=shapes,
        regions={
            name: np.flatnonzero(mask > 0.5).astype(np.int32)
            for name, mask in zip(segments.names, segments.masks, strict=True)
        },
        feature_points=drawn.points,
        feature_titles=drawn.titles,
        textures=mesh.textures,
        credits=options.credits,
        shape_limits=np.stack([lower - room, upper + room], axis=1).astype(np.float32),
        statistics=statistics,
        origin=mesh.origin,
        summary=summary,
    )


def _aligned_sample(sequence: MeshSequence, source: str, progress: Progress) -> tuple[Floats, NDArray[np.intp], Array]:
    """Return displacements of sample frames, the ids of the steady vertices, and the sizes of frames in other units.

    Raises:
        FacePoserError: If a frame cannot be aligned with the neutral, or cannot be an expression of it.
    """
    neutral = sequence.neutral.vertices
    numbers, sample = sample_of(sequence, progress)
    flat = next((i for i, frame in enumerate(sample) if not determines_rotation(frame)), None)
    if flat is not None:
        raise FacePoserError(f"The vertices of {sequence.name_of(numbers[flat])} are all on one line; export it again.")
    sizes = _relative_sizes(sample, neutral)
    other_size = np.abs(np.log(sizes)) > np.log(_OTHER_SIZE)
    scaled = bool(other_size.any())
    if scaled:
        # The steady vertices are found among frames of one size.
        sample /= sizes[:, None, None].astype(np.float32)
    try:
        steady = steady_vertices(sample, neutral)
        tree = search_tree(neutral)
        for number, frame in zip(numbers, sample, strict=True):
            laid = rigid_alignment(frame[steady], neutral[steady], scale=scaled).apply(frame)
            _refuse_implausible(sequence, number, laid, tree)
            frame[:] = laid - neutral
    except ValueError as error:
        raise FacePoserError(f"The meshes of '{source}' cannot be aligned: {error}.") from error
    return sample, steady, sizes[other_size]


def _relative_sizes(sample: Floats, neutral: Array) -> Array:
    """Return the size of each centred frame relative to the neutral, shape (n,); 1 for a collapsed frame."""
    extent = np.linalg.norm(neutral - neutral.mean(axis=0))
    sizes = np.array([np.linalg.norm(frame.astype(np.float64)) for frame in sample]) / max(float(extent), 1e-300)
    return np.where(sizes > 0.0, sizes, 1.0)


def _size_notes(sizes: Array) -> tuple[str, ...]:
    """Return a note about frames of other ``sizes`` than the neutral."""
    if not len(sizes):
        return ()
    usual = _plain_factor(float(np.median(sizes)))
    plural = len(sizes) > 1
    return (
        f"{len(sizes)} mesh{'es have' if plural else ' has'} {usual:.3g} times the size of the neutral mesh and "
        f"{'were' if plural else 'was'} scaled to it.",
    )


def _plain_factor(size: float) -> float:
    """Return the factor between common units that ``size``, which expressions change a little, is close to."""
    return next((unit for unit in _COMMON_UNITS if abs(size / unit - 1.0) < _NEAR_UNIT), size)


def _refuse_implausible(sequence: MeshSequence, number: int, vertices: Array, tree: "cKDTree") -> None:
    """Raise a FacePoserError if the aligned ``vertices`` of a frame cannot be an expression.

    ``tree`` is the search tree of the neutral.
    """
    neutral = sequence.neutral.vertices
    reason = implausible(vertices, neutral, tree)
    if not reason:
        return
    flipped = lay_on(vertices * (-1.0, 1.0, 1.0), neutral).vertices
    raise implausible_frame(sequence, number, reason if implausible(flipped, neutral, tree) else "it is mirrored")


@contextmanager
def _store(reader: AlignedReader, scheduler: str | None, progress: Progress) -> Iterator[FrameStore]:
    if scheduler is None:
        with spool_frames(reader, progress) as frames:
            yield frames
    else:
        from faceposer.training.cluster import cluster_frames

        with cluster_frames(reader, scheduler, progress) as distributed:
            yield distributed


def _segments(option: str | int, mesh: CanonicalMesh, triangles: NDArray[np.int32], sample: Floats) -> Segments:
    vertices = mesh.vertices.astype(np.float64)
    if option == "whole":
        return whole_face(len(vertices))
    if isinstance(option, int):
        return find_segments(vertices, triangles, sample, option)
    if mesh.regions is None and not mesh.resembles_man:
        return find_segments(vertices, triangles, sample, _CLUSTERS)
    return face_segments(vertices, triangles, sample, mesh.regions)


def _triangles(mesh: CanonicalMesh) -> NDArray[np.int32]:
    corners = mesh.polygons
    quads = corners[corners[:, 3] >= 0]
    return np.concatenate([corners[:, :3], quads[:, [0, 2, 3]]])


def _kept_energy(shapes: Floats, sample: Floats, modes: Modes, segments: Segments) -> dict[str, Any]:
    """Return the share of the sample's squared displacement that the modes explain, in total and by region."""
    flat = shapes.reshape(len(shapes), -1)
    solve = np.linalg.pinv(flat.astype(np.float64) @ flat.T.astype(np.float64), rcond=1e-10, hermitian=True)
    left, total = np.zeros(shapes.shape[1]), np.zeros(shapes.shape[1])
    for frame in sample:
        fitted = (flat.T @ (solve @ (flat @ frame.ravel())).astype(np.float32)).reshape(-1, 3)
        left += ((frame - fitted) ** 2).sum(axis=1)
        total += (frame**2).sum(axis=1)
    tiny = np.finfo(float).tiny
    shares = {
        name: round(1.0 - float(mask @ left) / max(float(mask @ total), tiny), 5)
        for name, mask in zip(segments.names, segments.masks.astype(np.float64), strict=True)
    }
    worst = min(shares, key=lambda name: shares[name])
    return {
        "kept_energy": round(1.0 - float(left.sum()) / max(float(total.sum()), tiny), 5),
        "kept_by_region": shares,
        "kept_in_metric": {name: round(share, 5) for name, share in modes.kept.items()},
        "worst": {"region": worst, "kept_energy": shares[worst]},
    }


def _warnings(count: int, curves: Curves, modes: Modes) -> list[str]:
    """Return warnings about the amount of data."""
    found = []
    if count < _FEW:
        found.append(
            f"{counted(count, 'example')} are too few to judge the model: it can make little more than blends of them."
        )
    if curves.generalization and curves.generalization[-1] > _POOR * curves.neutral:
        share = 100.0 * curves.generalization[-1] / max(curves.neutral, 1e-12)
        found.append(
            f"Held-out examples are missed by {share:.0f} % of their distance from the neutral face: there are too few "
            "examples, or they have too little in common."
        )
    if not modes.converged:
        found.append("The principal components had not converged after the last pass over the frames.")
    return found
