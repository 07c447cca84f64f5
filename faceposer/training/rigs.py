"""A rig with ARKit's shapes becomes a character: exactly, in the rig's own weights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.polygon_mesh import MorphMesh
from faceposer.geometry.rig_io import read_rig
from faceposer.model.character import Character
from faceposer.model.face_model import build_face_model
from faceposer.model.shape_names import halves_of, match_arkit
from faceposer.progress import Progress
from faceposer.training.assemble import UprightMesh, assemble
from faceposer.training.eyes import add_gaze, misplaced_eyes
from faceposer.training.landmarks import find_landmarks
from faceposer.training.measures import curves_of
from faceposer.training.performances import LearnedStatistics, learn_from_captures
from faceposer.training.canonical_frame import opposite_name, frame_from_shapes

#: Fewer of ARKit's shapes than this are no rig for it.
_FEWEST_SHAPES = 5
_DRAWS = 256
_EXCHANGED = (
    "Its left shapes move what is on its right: the mesh is mirrored, or its names are those of who looks at it. "
    "Performances and gaze go to the other side."
)
# A shape of which more than this share is not reached is listed.
_WORTH_TELLING = 0.01


@dataclass(frozen=True)
class RigOptions:
    """What to make of a rig.

    Attributes:
        name: Short name of the character.
        title: Name to show.
        neutral: File of the neutral face in a folder, if its name does not tell.
        captures: Performances to learn from; without any, the shipped statistics apply.
        n_components: Number of factor analyzers, chosen by held-out takes if None.
        n_factors: Number of factors of each, likewise.
        credits: Where the character comes from, and its licence.
    """

    name: str
    title: str
    neutral: Path | None = None
    captures: tuple[Path, ...] = ()
    n_components: int | None = None
    n_factors: int | None = None
    credits: str = ""


def character_from_rig(path: Path, options: RigOptions, progress: Progress | None = None) -> Character:
    """Return the character in the rig ``path``, a glTF file or a folder of shapes.

    Raises:
        FacePoserError: If a file cannot be used, naming it, the place and the remedy.
    """
    progress = progress or Progress()
    progress.at("Reading the rig")
    return character_from_morphs(read_rig(path, options.neutral), str(path), options, progress)


def character_from_morphs(rig: MorphMesh, source: str, options: RigOptions, progress: Progress) -> Character:
    """Return the character of a rig that has been read from the file or folder ``source``.

    Raises:
        FacePoserError: If it has too few of ARKit's shapes, or they move too little.
    """
    match = match_arkit(rig.targets, f"The rig '{source}'")
    # A whole whose halves are there as well is their sum.
    found_names = {*match.shapes.values()}
    wholes = {name for name in found_names if halves_of(name) and found_names.issuperset(halves_of(name))}
    named = {ours: rig.targets[theirs] for theirs, ours in match.shapes.items() if ours not in wholes}
    moving = [name for name, offsets in named.items() if np.any(offsets)]
    if len(moving) < _FEWEST_SHAPES:
        examples = ", ".join(f"'{name}'" for name in list(rig.targets)[:3])
        raise FacePoserError(
            f"The rig '{source}' has {len(moving)} of ARKit's 52 shapes, which are too few (its shapes are called "
            f"{examples}); rename them as ARKit does, such as jawOpen, or learn from them with --examples."
        )
    progress.at("Finding the face", 0.2)
    found = frame_from_shapes(rig.mesh.vertices, named)
    if found is None:
        raise FacePoserError(
            f"The shapes of the rig '{source}' move too little of a face to tell where it looks; add shapes of brows, "
            "eyes and mouth, or learn from it with --examples."
        )
    upright, exchanged = found
    mesh = assemble(rig.mesh, upright, np.stack([*named.values()]), rig.textures)
    return _character(Path(source).name, named, match.missing, match.others, exchanged, mesh, options, progress)


def _character(
    source: str,
    named: dict[str, NDArray[np.float32]],
    missing: Sequence[str],
    others: Sequence[str],
    exchanged: bool,
    mesh: UprightMesh,
    options: RigOptions,
    progress: Progress,
) -> Character:
    names = tuple(named)
    shapes = mesh.displacements(np.stack([named[name] for name in names]))
    turned = add_gaze(mesh.vertices.astype(np.float64), mesh.parts, names, shapes)
    progress.at("Finding eyes, brows and mouth", 0.4)
    by_place = [opposite_name(name) if exchanged else name for name in names]
    marks = find_landmarks(mesh.vertices, mesh.parts, dict(zip(by_place, shapes, strict=True)))
    learned: LearnedStatistics | None = None
    if options.captures:
        learned = learn_from_captures(options.captures, options.n_components, options.n_factors, progress)
    progress.at("Putting it together", 0.9)
    character = Character(
        name=options.name,
        title=options.title,
        vertices=mesh.vertices,
        polygons=mesh.polygons,
        uv=mesh.uv,
        polygon_uvs=mesh.polygon_uvs,
        parts=mesh.parts,
        shape_names=names,
        shapes=shapes,
        regions=marks.regions,
        feature_points=marks.feature_points,
        feature_titles=marks.feature_titles,
        textures=mesh.textures,
        credits=options.credits,
        statistics=learned.statistics if learned else None,
        origin=mesh.origin,
    )
    summary: dict[str, object] = {
        "kind": "rig",
        "source": source,
        "vertices": len(mesh.origin.neutral),
        "parts": [part.name for part in mesh.parts],
        "shapes": len(names),
        "missing": list(missing),
        "empty": [name for name in names if not np.any(named[name])],
        "not_arkit": list(others),
        "eyes_turned": turned,
        "warnings": ([_EXCHANGED] if exchanged else [])
        + misplaced_eyes(mesh.vertices, mesh.parts)
        + (learned.choice.warnings if learned else []),
        "prior": learned.as_json() if learned else {"from": "the shipped statistics"},
        **_measures(character),
    }
    return replace(character, summary=summary)


def _measures(character: Character) -> dict[str, object]:
    """Return what the subspace keeps, and the curves of expressions drawn from the statistics."""
    model = build_face_model(character)
    left = {name: round(share, 4) for name, share in model.reconstruction_error().items()}
    worst = max(left, key=lambda name: left[name])
    variances = model.subspace.variances
    rng = np.random.default_rng(0)
    mixture = model.mixture
    chosen = rng.choice(mixture.n_components, _DRAWS, p=mixture.weights / mixture.weights.sum())
    draws = np.stack([rng.multivariate_normal(mixture.means[k], mixture.covariances[k]) for k in chosen])
    weights = np.clip(draws @ model.subspace.directions.T, 0.0, 1.0)
    curves = curves_of(weights @ model.gram @ weights.T, len(character.vertices), min(40, model.n_coefficients))
    return {
        "dimensions": model.n_coefficients,
        "kept_energy": round(float(1.0 - _lost(model.subspace.directions, model.gram, weights)), 5),
        "unreached": {name: share for name, share in left.items() if share > _WORTH_TELLING},
        "worst": {"shape": worst, "unreached": left[worst]},
        "variances": [round(float(v), 6) for v in variances[:5]],
        "curves": curves.as_json(),
    }


def _lost(directions: NDArray[np.float64], gram: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the share of the squared displacements of poses, (n, S) rig weights, that the subspace cannot make."""
    inner = weights @ gram @ directions
    fitted = np.einsum("nr,nr->", inner, np.linalg.solve(directions.T @ gram @ directions, inner.T).T)
    total = np.einsum("ns,ns->", weights @ gram, weights)
    return float(max(0.0, 1.0 - fitted / max(total, np.finfo(float).tiny)))
