"""Whole drawings: the face is found at any place, size and angle, and proportions are no expression."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.session.sketching import session_sketcher
from faceposer.sketch.drawing import RecognisedDrawing, recognise_drawing
from faceposer.sketch.sketcher import Sketcher
from faceposer.sketch.svg_file import SvgDrawing, SvgStroke, read_svg
from tests.sketch.drawings import drawn

DRAWINGS = Path(__file__).resolve().parents[2] / "docs" / "drawings"
SIDES = ("left", "right")
FACE = (
    *(f"{side} {part}" for side in SIDES for part in ("brow", "upper lid", "lower lid")),
    "outer upper lip",
    "mouth line",
    "outer lower lip",
)
EXPRESSIONS = (
    {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "browInnerUp": 0.4},
    {"browDownLeft": 0.9, "browDownRight": 0.9, "mouthFrownLeft": 0.6, "mouthFrownRight": 0.6},
)


def along(man: FaceModel, feature: str, pose: np.ndarray, camera: Camera) -> np.ndarray:
    return np.array(drawn(man, feature, pose, camera))


@pytest.fixture(scope="module")
def sketcher(man: FaceModel) -> Sketcher:
    return session_sketcher(man)


@pytest.fixture(scope="module")
def camera(man: FaceModel) -> Camera:
    return face_view(man.character).camera((960, 960))


def moved(points: np.ndarray, scale: float, degrees: float, shift: tuple[float, float]) -> np.ndarray:
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return scale * points @ turn + shift


def drawing_of(man: FaceModel, camera: Camera, pose: np.ndarray, seed: int = 0, **similarity: object) -> SvgDrawing:
    """Return a drawing of a pose with a hand's errors, an outline and hair, in a random order."""
    rng = np.random.default_rng(seed)
    lines = [along(man, name, pose, camera) + rng.normal(0.0, 3.0, 2) for name in FACE]
    angle = np.linspace(0.0, 2.0 * np.pi, 40)
    middle = np.concatenate(lines).mean(axis=0)
    lines.append(middle + np.stack([330.0 * np.cos(angle), 430.0 * np.sin(angle)], axis=1))
    lines.append(middle + np.stack([np.linspace(-280, 280, 30), -330.0 + 60.0 * np.sin(4.0 * angle[:30])], axis=1))
    order = rng.permutation(len(lines))
    names = [*FACE, "outline", "hair"]
    values = {"scale": 1.0, "degrees": 0.0, "shift": (0.0, 0.0)} | similarity
    return SvgDrawing(tuple(SvgStroke(moved(lines[i], **values), names[i]) for i in order))  # type: ignore[arg-type]


def features(found: RecognisedDrawing) -> dict[str, str | None]:
    return {s.name: None if s.candidate is None else s.candidate.feature for s in found.strokes}


@pytest.mark.parametrize("expression", EXPRESSIONS)
@pytest.mark.parametrize(("scale", "degrees", "shift"), [(0.2, 0.0, (900.0, -40.0)), (7.0, 9.0, (0.0, 3000.0))])
def test_features_are_found_at_any_place(
    expression: dict[str, float],
    scale: float,
    degrees: float,
    shift: tuple[float, float],
    man: FaceModel,
    camera: Camera,
    sketcher: Sketcher,
) -> None:
    pose = man.coefficients_of(expression)
    drawing = drawing_of(man, camera, pose, scale=scale, degrees=degrees, shift=shift)
    found = recognise_drawing(sketcher, drawing, camera, relative=False)
    right = features(found)
    assert right["outline"] is None
    assert right["hair"] is None
    assert sum(right[name] == name for name in FACE) >= len(FACE) - 1
    assert found.scale == pytest.approx(1.0 / scale, rel=0.12)
    assert np.degrees(found.rotation) == pytest.approx(-degrees, abs=3.0)


def test_proportions_are_no_expression_by_a_drawn_neutral(man: FaceModel, camera: Camera, sketcher: Sketcher) -> None:
    """Eyes half as large again, brows higher and a narrower mouth, in both faces of the drawing."""
    middles = {s: along(man, f"{s} upper lid", man.neutral(), camera).mean(axis=0) for s in SIDES}

    def caricature(stroke: SvgStroke, neutral: bool) -> SvgStroke:
        points = stroke.points
        side = next((s for s in SIDES if s in stroke.name), "")
        if "lid" in stroke.name:
            points = middles[side] + 1.4 * (points - middles[side])
        if "brow" in stroke.name:
            points = points - (0.0, 25.0)
        return SvgStroke(points, stroke.name, neutral)

    pose = man.coefficients_of(EXPRESSIONS[0])
    plain, rest = drawing_of(man, camera, pose), drawing_of(man, camera, man.neutral())
    both = [caricature(s, False) for s in plain.strokes] + [caricature(s, True) for s in rest.strokes]
    found = recognise_drawing(sketcher, SvgDrawing(tuple(both)), camera)
    assert found.relative == "drawn"
    true = {s.name: s.points for s in plain.strokes}
    off = recognise_drawing(sketcher, SvgDrawing(tuple(s for s in both if not s.neutral)), camera, relative=False)
    # A neutral face that is not used need not show one.
    line = SvgDrawing(tuple(both[:1]))
    unused = recognise_drawing(sketcher, SvgDrawing(tuple(s for s in both if not s.neutral)), camera, False, line)
    assert unused.relative == "off"
    assert [s.candidate for s in unused.strokes] == [s.candidate for s in off.strokes]

    def error(result: RecognisedDrawing) -> float:
        gaps = [
            np.abs(np.ptp(s.stroke.pixels, axis=0) - np.ptp(true[s.name], axis=0)).mean()
            + np.abs(s.stroke.pixels.mean(axis=0) - true[s.name].mean(axis=0)).mean()
            for s in result.strokes
            if s.candidate is not None and ("lid" in s.name or "brow" in s.name)
        ]
        return float(np.mean(gaps))

    assert error(found) < 0.5 * error(off)


def test_a_jaw_acts_only_if_the_neutral_face_has_one(man: FaceModel, camera: Camera, sketcher: Sketcher) -> None:
    jaw = SvgStroke(along(man, "jaw line", man.neutral(), camera) + (0.0, 20.0), "jaw", feature="jaw line")
    faces = [(drawing_of(man, camera, man.coefficients_of(EXPRESSIONS[0])), False)]
    faces.append((drawing_of(man, camera, man.neutral()), True))
    strokes = [SvgStroke(s.points, s.name, neutral) for face, neutral in faces for s in face.strokes]
    for neutral_jaw in (False, True):
        also = [replace(jaw, neutral=True)] if neutral_jaw else []
        found = recognise_drawing(sketcher, SvgDrawing((*strokes, jaw, *also)), camera)
        (stroke,) = [s for s in found.strokes if s.name == "jaw"]
        assert (stroke.candidate is not None) == neutral_jaw
        assert stroke.only_aligns != neutral_jaw


def test_assumed_neutral_keeps_large_eyes_from_surprise(man: FaceModel, camera: Camera, sketcher: Sketcher) -> None:
    rest = drawing_of(man, camera, man.neutral())
    middles = {s: along(man, f"{s} upper lid", man.neutral(), camera).mean(axis=0) for s in SIDES}
    large = []
    for stroke in rest.strokes:
        side = next((s for s in SIDES if s in stroke.name and "lid" in stroke.name), None)
        points = stroke.points if side is None else middles[side] + (1.35, 1.8) * (stroke.points - middles[side])
        large.append(SvgStroke(points, stroke.name))
    found = recognise_drawing(sketcher, SvgDrawing(tuple(large)), camera)
    by_name = {s.name: s.stroke.pixels for s in found.strokes}
    for side in SIDES:
        lids = np.concatenate([by_name[f"{side} upper lid"], by_name[f"{side} lower lid"]])
        true = np.concatenate([along(man, f"{side} {lid} lid", man.neutral(), camera) for lid in ("upper", "lower")])
        assert np.ptp(lids[:, 0]) == pytest.approx(np.ptp(true[:, 0]), rel=0.1)
        assert np.ptp(lids[:, 1]) == pytest.approx(np.ptp(true[:, 1]), rel=0.25)


EYES_AS_LIDS = {"left brow", "right brow", "left upper lid", "right upper lid", "left lower lid", "right lower lid"}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("joy", EYES_AS_LIDS | {"mouth outline"}),
        ("sadness", EYES_AS_LIDS | {"mouth line"}),
        ("anger", EYES_AS_LIDS | {"mouth outline", "mouth line"}),
        ("surprise", {"left brow", "right brow", "left eye outline", "right eye outline", "mouth outline"}),
        ("disgust", EYES_AS_LIDS | {"mouth outline"}),
        ("smirk", EYES_AS_LIDS | {"mouth line"}),
    ],
)
def test_drawings_of_the_gallery(name: str, expected: set[str], camera: Camera, sketcher: Sketcher) -> None:
    found = recognise_drawing(sketcher, read_svg(DRAWINGS / f"{name}.svg"), camera)
    assert {s.candidate.feature for s in found.strokes if s.candidate is not None} == expected
    for stroke in found.strokes:
        if stroke.candidate is not None and "brow" in stroke.candidate.feature:
            # Left is the character's, which is at the right of the image.
            middle = stroke.stroke.pixels[:, 0].mean()
            assert (middle > 480.0) == stroke.candidate.feature.startswith("left")


def test_pieces_of_a_feature_add_up(man: FaceModel, camera: Camera, sketcher: Sketcher) -> None:
    whole = drawing_of(man, camera, man.neutral())
    strokes = [s for s in whole.strokes if s.name != "mouth line"]
    line = next(s.points for s in whole.strokes if s.name == "mouth line")
    cut = int(0.62 * len(line))
    strokes += [SvgStroke(line[:cut], "long piece"), SvgStroke(line[cut:], "short piece")]
    found = recognise_drawing(sketcher, SvgDrawing(tuple(strokes)), camera, relative=False)
    by_name = {s.name: s for s in found.strokes}
    pieces = [by_name["long piece"], by_name["short piece"]]
    (kept,) = [p for p in pieces if p.candidate is not None]
    assert kept.candidate is not None
    assert kept.candidate.feature == "mouth line"
    assert float(np.ptp(kept.stroke.pixels[:, 0])) == pytest.approx(float(np.ptp(line[:, 0])), rel=0.1)


def test_what_shows_no_face_is_refused(camera: Camera, sketcher: Sketcher) -> None:
    rng = np.random.default_rng(0)
    spiral = SvgStroke(np.cumsum(rng.normal(size=(40, 2)), axis=0))
    with pytest.raises(FacePoserError, match="No face was found in the drawing"):
        recognise_drawing(sketcher, SvgDrawing((spiral,)), camera)
    with pytest.raises(FacePoserError, match="layer 'neutral'"):
        recognise_drawing(sketcher, SvgDrawing((SvgStroke(spiral.points, neutral=True),)), camera)
