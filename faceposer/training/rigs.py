"""Characters from rigs with ARKit's shapes, which keep the weights of the rig."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.names import displayable
from faceposer.geometry.polygon_mesh import MorphMesh
from faceposer.geometry.rig_io import read_rig
from faceposer.model.character import Character
from faceposer.model.face_model import build_face_model
from faceposer.model.name_families import family_hint
from faceposer.model.name_matching import NameMatch, match_with_ties, tie_error
from faceposer.model.shape_names import half_shapes_of
from faceposer.progress import Progress
from faceposer.training.assemble import CanonicalMesh, assemble
from faceposer.training.canonical_frame import frame_from_shapes
from faceposer.training.displacements import check_displacements
from faceposer.training.drawn_points import DrawnPoints, drawn_feature_points
from faceposer.training.eyes import add_gaze, misplaced_eyes
from faceposer.training.kinds import Sides
from faceposer.training.landmarks import find_landmarks
from faceposer.training.measures import curves_of
from faceposer.training.performances import LearnedStatistics, learn_from_captures
from faceposer.training.sides import sides_of

#: Least number of ARKit's shapes in a rig.
_FEWEST_SHAPES = 5
#: Number of feature points found by motion below which pictures of the face are drawn for the others.
_FEW_POINTS = 40
_DRAWS = 256
# Reconstruction error above which a shape is listed in the summary.
_LISTED_ERROR = 0.01


@dataclass(frozen=True)
class RigOptions:
    """Options for training from a rig.

    Attributes:
        name: Short name of the character.
        title: Displayed name.
        neutral: File of the neutral face in a folder, if its name does not identify it.
        captures: Performances to learn from; without any, the shipped statistics apply.
        n_components: Number of factor analyzers, chosen by cross-validation on takes if None.
        n_factors: Number of factors of each, chosen likewise if None.
        credits: Source and licence of the character.
        align_shapes: False to read shapes where and in the unit in which they are stored.
        weights_range: Full weight of an avatar's expressions, 1 or 100; None to infer it.
        sides: Reading of left and right in the names of the shapes.
    """

    name: str
    title: str
    neutral: Path | None = None
    captures: tuple[Path, ...] = ()
    n_components: int | None = None
    n_factors: int | None = None
    credits: str = ""
    align_shapes: bool = True
    weights_range: float | None = None
    sides: Sides = "auto"


def character_from_rig(path: Path, options: RigOptions, progress: Progress | None = None) -> Character:
    """Create a character from the rig ``path``, a glTF file or a folder of shapes.

    Raises:
        FacePoserError: If a file cannot be used.
    """
    progress = progress or Progress()
    progress.at("Reading the rig")
    rig = read_rig(path, options.neutral, options.align_shapes, options.weights_range)
    return character_from_morphs(rig, str(path), options, progress)


def character_from_morphs(rig: MorphMesh, source: str, options: RigOptions, progress: Progress) -> Character:
    """Create a character from a ``rig`` read from the file or folder ``source``.

    Raises:
        FacePoserError: If the rig has too few of ARKit's shapes, or they move too little.
    """
    targets, match, notes = _named_targets(rig, f"The rig '{source}'")
    # A shape that exists both whole and as two halves is the sum of its halves, and redundant.
    wholes = {name for name in targets if half_shapes_of(name) and set(targets).issuperset(half_shapes_of(name))}
    named = {name: offsets for name, offsets in targets.items() if name not in wholes}
    moving = [name for name, offsets in named.items() if np.any(offsets)]
    if len(moving) < _FEWEST_SHAPES:
        raise _too_few(source, rig, len(named), len(moving))
    progress.at("Aligning the face", 0.2)
    frame = frame_from_shapes(rig.mesh.vertices, rig.mesh.triangles(), named)
    if frame is None:
        raise FacePoserError(
            f"The shapes of the rig '{source}' move too little of the face to determine its orientation; add shapes of "
            "brows, eyes and mouth, or train from it with --examples."
        )
    if frame.negated and options.align_shapes:
        notes.append("The shapes move vertices in the opposite directions; their displacements were negated.")
        named = {name: -offsets for name, offsets in named.items()}
    sides = sides_of(rig.mesh.vertices, named, frame, options.sides)
    notes += sides.notes
    named, moved = sides.named, sides.moved
    check = check_displacements(moved, rig.mesh.vertices, rig.mesh.polygons, sides.upright, options.align_shapes)
    if check.refusal:
        raise FacePoserError(f"The rig '{source}' cannot be used: {check.refusal}.")
    notes += check.notes
    if check.factor != 1.0:
        named = {name: (check.factor * offsets).astype(np.float32) for name, offsets in named.items()}
    upright = sides.upright
    mesh = assemble(rig.mesh, upright, np.stack([*named.values()]), rig.textures)
    drawn = {*mesh.textures.values()}
    unused = [material for material, image in rig.textures.items() if image not in drawn]
    if unused:
        notes.append(
            f"{len(unused)} texture{'s are' if len(unused) > 1 else ' is'} not used, such as that of the material "
            f"'{unused[0][:60]}': its faces are in one part with those of another material."
        )
    missing = tuple(sides.renamed.get(name, name) for name in match.missing)
    facts = _Facts(displayable(Path(source).name), missing, match.others, tuple(sides.moved), (*rig.notes, *notes))
    return _character(facts, named, mesh, options, progress)


def _too_few(source: str, rig: MorphMesh, named: int, moving: int) -> FacePoserError:
    """Return the error for a rig of which ``named`` shapes are ARKit's and ``moving`` of these move vertices."""
    if named >= _FEWEST_SHAPES:
        many = "none of them moves a vertex" if not moving else f"only {moving} of them move vertices"
        return FacePoserError(
            f"The rig '{source}' has {named} of ARKit's 52 shapes, but {many}; export it with the displacements of its "
            "shapes (shape keys, blend shapes)."
        )
    examples = ", ".join(f"'{name[:60]}'" for name in list(rig.targets)[:3])
    hint = family_hint(rig.targets)
    if hint:
        remedy = f". {hint}"
    elif named == len(rig.targets):
        remedy = "; add shapes of brows, eyes and mouth, or train from it with --examples."
    else:
        remedy = "; rename them to ARKit's names, such as jawOpen, or train from them with --examples."
    return FacePoserError(
        f"The rig '{source}' has {moving} of ARKit's 52 shapes, which is too few (its shapes are called {examples})"
        f"{remedy}"
    )


@dataclass(frozen=True)
class _Facts:
    """Facts about a rig for the summary: names that it lacks or that are not ARKit's, and notes for the user.

    ``by_side`` has the names of the shapes by the side that they move, in the order of the shapes.
    """

    source: str
    missing: Sequence[str]
    others: Sequence[str]
    by_side: tuple[str, ...]
    notes: tuple[str, ...]


def _named_targets(rig: MorphMesh, where: str) -> tuple[dict[str, NDArray[np.float32]], NameMatch, list[str]]:
    """Return the offsets by ARKit's names, in the file's order, how the names were matched, and notes on it.

    Targets of one shape that move different vertices, as of a head and its lashes, are added.

    Raises:
        FacePoserError: If two different targets denote the same shape, or a target that is used is not usable.
    """
    match = match_with_ties(rig.targets)
    notes = [match.note] if match.note else []
    targets = {shape: rig.targets[name] for name, shape in match.shapes.items()}
    joined: list[str] = []
    for name, shape in match.alternates.items():
        offsets = rig.targets[name]
        moves = np.any(offsets, axis=1)
        if not moves.any() or np.array_equal(offsets, targets[shape]):
            continue
        if not np.any(targets[shape][moves]):
            targets[shape] = targets[shape] + offsets
            joined.append(name)
        elif name in match.ties.get(shape, ()):
            raise tie_error(where, shape, match.ties[shape])
    for name in (*match.shapes, *joined):
        if name in rig.unusable:
            raise FacePoserError(rig.unusable[name])
    if joined:
        notes.append(
            f"{len(joined)} target{'s' if len(joined) > 1 else ''} that move{'' if len(joined) > 1 else 's'} other "
            f"vertices under another name, such as '{joined[0][:60]}', were added to the shape of that name."
        )
    return targets, match, notes


def _character(
    facts: _Facts,
    named: dict[str, NDArray[np.float32]],
    mesh: CanonicalMesh,
    options: RigOptions,
    progress: Progress,
) -> Character:
    names = tuple(named)
    shapes = mesh.displacements(np.stack([named[name] for name in names]))
    turned = add_gaze(mesh.vertices.astype(np.float64), mesh.parts, names, shapes)
    progress.at("Finding eyes, brows and mouth", 0.4)
    landmarks = find_landmarks(mesh.vertices, mesh.parts, dict(zip(facts.by_side, shapes, strict=True)))
    drawn = drawn_feature_points(mesh) if len(landmarks.feature_points) < _FEW_POINTS else DrawnPoints({}, {})
    learned: LearnedStatistics | None = None
    if options.captures:
        learned = learn_from_captures(options.captures, options.n_components, options.n_factors, progress)
    progress.at("Assembling the character", 0.9)
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
        regions=landmarks.regions,
        feature_points=drawn.points | dict(landmarks.feature_points),
        feature_titles=drawn.titles | dict(landmarks.feature_titles),
        textures=mesh.textures,
        credits=options.credits,
        statistics=learned.statistics if learned else None,
        origin=mesh.origin,
    )
    summary: dict[str, object] = {
        "kind": "rig",
        "source": facts.source,
        "vertices": len(mesh.origin.neutral),
        "parts": [part.name for part in mesh.parts],
        "shapes": len(names),
        "missing": list(facts.missing),
        "empty": [name for name in names if not np.any(named[name])],
        "not_arkit": list(facts.others),
        "eyes_turned": turned,
        "points_from_pictures": len(character.feature_points) - len(landmarks.feature_points),
        "warnings": [*facts.notes] + misplaced_eyes(mesh.vertices, mesh.parts) + (learned.warnings if learned else []),
        "prior": learned.as_json() if learned else {"from": "the shipped statistics"},
        **_measures(character),
    }
    return replace(character, summary=summary)


def _measures(character: Character) -> dict[str, object]:
    """Return the energy that the subspace keeps, and the curves of expressions drawn from the statistics."""
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
        "unreached": {name: share for name, share in left.items() if share > _LISTED_ERROR},
        "worst": {"shape": worst, "unreached": left[worst]},
        "variances": [round(float(v), 6) for v in variances[:5]],
        "curves": curves.as_json(),
    }


def _lost(directions: NDArray[np.float64], gram: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the share of the squared displacements of poses, rig weights (n, S), that the subspace loses."""
    inner = weights @ gram @ directions
    fitted = np.einsum("nr,nr->", inner, np.linalg.solve(directions.T @ gram @ directions, inner.T).T)
    total = np.einsum("ns,ns->", weights @ gram, weights)
    return float(max(0.0, 1.0 - fitted / max(total, np.finfo(float).tiny)))
