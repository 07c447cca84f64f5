"""Summaries of characters and their training as text, JSON and plots."""

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError, counted, printable
from faceposer.files import paths
from faceposer.files.atomic import atomic_file, check_new_folder, check_output
from faceposer.files.writing import with_null, write_json
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.face_model import FaceModel
from faceposer.model.name_matching import match_with_ties
from faceposer.model.shape_names import whole_shape_of

_TEXT, _PLOT = "summary.json", "summary.png"
_MANY = 6
_LONGEST_LINE = 4000
# Reconstruction error above which a shape is reported.
_NOTABLE_ERROR = 0.15


def description_of(character: Character) -> dict[str, Any]:
    """Return the JSON description of a character: names, sizes and the summary of its training."""
    return {
        "name": character.name,
        "title": character.title,
        "credits": character.credits,
        "vertices": len(character.vertices),
        "polygons": len(character.polygons),
        "parts": [{"name": part.name, "material": part.material} for part in character.parts],
        "shapes": list(character.shape_names),
        "regions": sorted(character.regions),
        "feature_points": len(character.feature_points),
        "textures": sorted(character.textures),
        "statistics": "own" if character.statistics is not None else "shipped",
        "file_vertices": len(character.origin.neutral) if character.origin else len(character.vertices),
        "summary": with_null(dict(character.summary)),
    }


def text_of_summary(character: Character) -> str:
    """Return a summary of a character in a few lines of text."""
    about = description_of(character)
    lines = [
        f"{character.title} ('{character.name}'): {counted(about['file_vertices'], 'vertex', 'vertices')}, "
        f"{counted(len(character.polygons), 'face')}, "
        f"parts: {', '.join(part.name for part in character.parts)}",
    ]
    try:
        lines += _lines_of(character.summary, character)
    except (LookupError, TypeError, ValueError, AttributeError):
        # The summary in a file may have been changed by others; nothing but this text depends on it.
        lines.append("The record of its training is damaged.")
    if character.credits:
        lines.append(character.credits)
    return "\n".join(printable(line, _LONGEST_LINE) for line in lines)


def _lines_of(summary: Mapping[str, Any], character: Character) -> list[str]:
    """Return the lines about the training."""
    lines = []
    if summary.get("kind") == "rig":
        lines.append(f"{arkit_shapes_of(summary)}, {counted(summary['dimensions'], 'dimension')}")
        for key, words in (
            ("missing", "missing"),
            ("empty", "empty (without motion)"),
            ("not_arkit", "ignored (not ARKit's)"),
            ("eyes_turned", "eyes without shapes, for which gaze was added"),
        ):
            if summary.get(key):
                lines.append(f"{words}: {_listed(summary[key])}")
        if summary["worst"]["shape"]:
            share = 100 * summary["worst"]["unreached"]
            lines.append(
                f"kept energy {_percent(summary['kept_energy'])}; worst shape {summary['worst']['shape']}, "
                f"{share:.1f} % of it lost"
            )
    elif summary:
        lines.append(
            f"{counted(summary['examples'], 'example')}, {counted(summary['dimensions'], 'mode')}; "
            f"neutral: {summary['neutral']}"
        )
        worst = summary["worst"]
        lines.append(
            f"kept energy {_percent(summary['kept_energy'])}; worst region {worst['region']}, "
            f"{_percent(worst['kept_energy'])}"
        )
        if "markers" in summary:
            marked = summary["markers"]
            lines.append(
                f"{counted(marked['frames'], 'frame')} of markers, {marked['frames_left_out']} left out, "
                f"{counted(marked['gaps_filled'], 'gap')} filled"
            )
    else:
        lines.append(f"{counted(len(character.shape_names), 'shape')}")
    if summary.get("points_from_pictures"):
        lines.append(f"{counted(summary['points_from_pictures'], 'feature point')} found in pictures of the face")
    lines += _prior_lines(summary.get("prior", {}))
    curves = summary.get("curves", {})
    if curves.get("generalization_cm"):
        lines.append(
            f"held-out expressions are met to {10 * curves['generalization_cm'][-1]:.2f} mm "
            f"(neutral: {10 * curves['neutral_cm']:.2f} mm) with "
            f"{counted(curves['components'][-1], 'component')}"
        )
    return lines + [f"Note: {warning}" for warning in summary.get("warnings", [])]


def arkit_shapes_of(summary: Mapping[str, Any]) -> str:
    """Describe the number of ARKit's shapes in a rig from its summary.

    A shape that a rig splits into two halves counts once.
    """
    missing = set(summary["missing"])
    empty = {*map(whole_shape_of, summary["empty"])} - missing
    present = len(ARKIT_SHAPES) - len(missing)
    text = f"{present} of ARKit's {len(ARKIT_SHAPES)} shapes"
    if empty:
        text += f", {len(empty)} of them empty"
    if summary["shapes"] != present:
        text += f", as {summary['shapes']} sliders, some for one side"
    return text


def _prior_lines(prior: dict[str, Any]) -> list[str]:
    if "components" not in prior:
        return [f"prior: {prior['from']}"] if prior else []
    lines = [
        f"prior: {counted(prior['components'], 'factor analyzer')} of "
        f"{counted(prior['factors'], 'factor')}"
        f"{', set by the user' if prior['fixed_by_user'] else ', chosen by cross-validation'} (log-likelihood "
        f"{prior['held_out_log_likelihood']:.1f}; one Gaussian {prior['one_gaussian']:.1f})"
    ]
    if prior.get("takes"):
        lines.append(
            "learned from "
            + ", ".join(f"{take['file']} ({counted(take['frames'], 'frame')})" for take in prior["takes"])
        )
    if prior.get("missing_channels"):
        lines.append(f"no channel in the performances: {_listed(prior['missing_channels'])}")
    return lines


def findings_of(character: Character, model: FaceModel) -> list[str]:
    """Return the shortcomings of a valid character, one sentence each."""
    found = []
    if character.summary.get("kind") not in ("examples", "markers"):
        missing = match_with_ties(character.shape_names).missing
        if missing:
            found.append(f"It lacks {_listed(missing)}: the face cannot make these expressions.")
    empty = [name for name, shape in zip(character.shape_names, character.shapes, strict=True) if not shape.any()]
    if empty:
        found.append(f"Shapes without motion: {_listed(empty)}.")
    hard = [
        f"{name} ({100 * share:.0f} %)"
        for name, share in model.reconstruction_error().items()
        if share > _NOTABLE_ERROR
    ]
    if hard:
        found.append(f"Shapes that the subspace makes only in part (share lost): {_listed(hard)}.")
    if not character.feature_points:
        found.append("It has no feature points: places have no names, and there are no buttons for mouth and eyes.")
    warnings = character.summary.get("warnings", [])
    found += map(str, warnings if isinstance(warnings, list) else [])
    return [printable(finding, _LONGEST_LINE) for finding in found]


def check_summary(folder: Path, has_plots: bool) -> None:
    """Check that ``write_summary`` could write into ``folder``, before any work is done for it.

    Args:
        folder: The folder, which need not exist.
        has_plots: True if the training yields curves to plot.

    Raises:
        FacePoserError: If it could not.
    """
    check_new_folder(folder)
    if paths.is_dir(folder):
        check_output(folder / _TEXT, ".json")
        check_output(folder / _PLOT, ".png")
    if has_plots and importlib.util.find_spec("matplotlib") is None:
        raise FacePoserError(
            "The plot of the summary needs matplotlib, which is not installed: pip install 'faceposer[plots]', or "
            "leave out the summary."
        )


def write_summary(folder: Path, character: Character) -> None:
    """Write ``summary.json`` and ``summary.png`` into ``folder``, which is created if it does not exist.

    Raises:
        FacePoserError: If they cannot be written, or matplotlib is not installed for the plot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(f"The summary cannot be written to '{folder}': {error.strerror}.") from error
    write_json(folder / _TEXT, description_of(character), "summary", ascii_only=False)
    _plot(folder / _PLOT, character)


def _plot(path: Path, character: Character) -> None:
    curves = character.summary.get("curves")
    if not curves:
        return
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise FacePoserError(
            "The plot of the summary needs matplotlib (summary.json and the character are written); install it with: "
            "pip install 'faceposer[plots]'"
        ) from None
    figure = Figure(figsize=(12, 3.6), layout="constrained")
    panels = figure.subplots(1, 3)
    components = curves["components"]
    for axes, key, title, unit in (
        (panels[0], "compactness", "Compactness", "share of the energy"),
        (panels[1], "generalization_cm", "Generalization", "cm, held-out examples"),
        (panels[2], "specificity_cm", "Specificity", "cm to the nearest example"),
    ):
        if curves[key]:
            axes.plot(components, curves[key], marker=".", color="#c8703a")
        axes.set_title(title)
        axes.set_xlabel("components")
        axes.set_ylabel(unit)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    figure.suptitle(character.title)
    with atomic_file(path, "plot") as temporary:
        figure.savefig(temporary, dpi=110, format="png")


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %"


def _listed(names: list[str] | tuple[str, ...]) -> str:
    rest = len(names) - _MANY
    return ", ".join(names[:_MANY]) + (f" and {rest} more" if rest > 0 else "")
