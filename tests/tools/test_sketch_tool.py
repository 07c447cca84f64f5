"""Sketches by pointer, with the real recogniser: drawn, named, renamed, redrawn, moved and taken back at each stage."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picture_view import PictureView
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import feature_curves
from faceposer.sketch.recognition import Candidate, Recognition
from faceposer.sketch.sketcher import Sketcher
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.tools.sketch_tool import UNNAMED, UNRECOGNISED, SketchTool
from tests.tools.context import HeadlessContext, Pixel, along, check_stages, shifted


@pytest.fixture
def context(man: FaceModel) -> HeadlessContext:
    context = HeadlessContext(man)
    context.toolbox.choose("sketch")
    return context


def tool_of(context: HeadlessContext) -> SketchTool:
    return context.toolbox.sketch_tool


def way_of(context: HeadlessContext, feature: str, dx: float = 0.0, dy: float = 0.0) -> list[Pixel]:
    """Return a way along ``feature`` of the present face, (dx, dy) pixels beside it."""
    session = context.session
    points = feature_curves(session.model.character)[feature][0].points
    pixels = context.camera.project(session.model.positions_at(points, session.coefficients)) + (dx, dy)
    return [(u, v) for u, v in pixels[::3].tolist()] + [(float(pixels[-1, 0]), float(pixels[-1, 1]))]


def features(context: HeadlessContext) -> list[str]:
    return [constraint.feature for constraint in context.constraints]


def scribble(context: HeadlessContext) -> list[Pixel]:
    """Return a zigzag over the nose and the cheeks."""
    u, v = context.feature("9.3")
    return [(u - 60 + 3 * i, v - 120 + 70 * (i % 2)) for i in range(40)]


def test_a_brow_is_recognised_and_followed(context: HeadlessContext) -> None:
    session, vertex = context.session, context.session.model.character.feature_points["4.3"]
    rest = context.vertices[vertex, 1]
    context.follow(way_of(context, "left brow", dy=-10.0))
    (sketch,) = context.constraints
    assert isinstance(sketch, SketchConstraint)
    assert sketch.feature == "left brow"
    assert {name for name, _ in sketch.matched} <= {"4.1", "4.3", "4.5"}
    assert sketch.camera == context.camera
    assert context.vertices[vertex, 1] > rest + 0.2
    assert session.residuals_px[0] < 2
    assert context.toolbox.selection == {0}
    assert session.undo_label == "Sketch the left brow"


@pytest.mark.parametrize("backwards", [False, True])
def test_every_stage_is_taken_back(context: HeadlessContext, backwards: bool) -> None:
    way = way_of(context, "right brow", dy=-8.0)[:: -1 if backwards else 1][::4]
    check_stages(context, along(way))
    assert features(context) == ["right brow"]
    assert tool_of(context).drawing is None


def test_the_unfinished_stroke_is_shown_and_previewed(
    context: HeadlessContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = tool_of(context)
    monkeypatch.setattr("faceposer.tools.sketch_tool._FRAME", 60.0)
    monkeypatch.setattr("faceposer.tools.sketch_tool._PREVIEW_SHARE", 1e9)
    way = way_of(context, "left brow", dy=-8.0)
    for event in along(way)[:-1]:
        context.send(*event)
    assert tool.drawing == way
    assert tool.preview is not None
    assert tool.preview.feature == "left brow"
    assert context.constraints == (), "nothing changes before the release"
    assert context.toolbox.cancel()
    assert tool.drawing is tool.preview is None


def test_a_scribble_changes_nothing_and_says_so(context: HeadlessContext) -> None:
    tool, document = tool_of(context), context.session.document
    context.follow(scribble(context))
    assert context.session.document is document
    assert not context.session.can_undo
    assert len(tool.unnamed) == 1
    assert UNRECOGNISED in context.toolbox.hint()
    assert context.toolbox.can_step_back
    context.undo()
    assert tool.unnamed == ()
    assert UNRECOGNISED not in context.toolbox.hint()
    context.follow(scribble(context))
    assert context.toolbox.cancel(), "Esc discards it, too"
    assert tool.unnamed == ()
    context.follow(scribble(context))
    context.click(scribble(context)[3], "right")
    assert tool.unnamed == ()
    assert context.session.document is document


def test_a_feature_without_matched_points_counts_as_none(
    context: HeadlessContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = tool_of(context)
    found = Recognition((Candidate("jaw line", 0.9, ()),), accepted=True)
    monkeypatch.setattr("faceposer.sketch.sketcher.Sketcher.recognise", lambda *_args, **_more: found)
    for event in along(way_of(context, "left brow"))[:-1]:
        context.send(*event)
        assert tool.preview is None
    context.send(*along(way_of(context, "left brow"))[-1])
    assert context.constraints == ()
    assert len(tool.unnamed) == 1
    assert tool.unnamed[0].candidates == ()


def test_an_unnamed_stroke_is_named(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(scribble(context))
    context.click(scribble(context)[3])
    assert tool.listing == UNNAMED, "without candidates, a click asks for the list"
    assert context.constraints == ()
    tool.name_stroke("jaw line", context)
    context.session.poll()
    assert features(context) == ["jaw line"]
    assert tool.unnamed == ()
    context.undo()
    assert context.constraints == ()


def test_a_click_names_an_unnamed_stroke_by_its_candidate(
    context: HeadlessContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = tool_of(context)
    way = way_of(context, "left brow", dy=-8.0)
    recognise = Sketcher.recognise

    def doubtful(*args: Any, **more: Any) -> Recognition:
        return replace(recognise(*args, **more), accepted=False)

    monkeypatch.setattr(Sketcher, "recognise", doubtful)
    context.follow(way)
    assert context.constraints == ()
    assert len(tool.unnamed) == 1
    assert tool.unnamed[0].candidates[0].feature == "left brow"
    context.click(way[len(way) // 2])
    assert features(context) == ["left brow"]
    assert tool.unnamed == ()
    assert tool.listing is None


def test_a_click_chooses_the_next_feature_as_one_step(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(way_of(context, "inner upper lip", dy=-2.0))
    order = [candidate.feature for candidate in tool.candidates_of(0, context)]
    assert len(order) > 1
    assert features(context) == order[:1]
    drawn = context.constraints[0].stroke
    names = []
    for _ in order:
        context.click(drawn[len(drawn) // 2])
        names += features(context)
    assert names == [*order[1:], order[0]], "each in turn, then the first again"
    assert context.constraints[0].stroke == drawn
    for expected in (order[0], *reversed(order), ""):
        assert "".join(features(context)) == expected
        context.undo()
    context.redo()
    assert features(context) == order[:1]
    tool.labels = {0: (5.0, 5.0, 50.0, 20.0)}
    context.click((10.0, 10.0))
    assert features(context) == order[1:2], "the label is clicked like the stroke"
    context.undo()
    tool.lists = {0: (40.0, 5.0, 50.0, 20.0)}
    context.click((45.0, 10.0))
    assert tool.listing == 0
    assert features(context) == order[:1]


def test_what_was_replaced_by_mistake_returns(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(way_of(context, "left brow", dy=-8.0))
    brow = context.constraints[0]
    context.follow(way_of(context, "left brow", dy=-4.0))
    assert len(context.constraints) == 1, "a feature is redrawn"
    assert context.constraints[0] != brow
    assert tool.choose_feature(0, "left upper lid", context)
    assert sorted(features(context)) == ["left brow", "left upper lid"]
    assert brow in context.constraints


def test_any_feature_can_be_chosen(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(way_of(context, "left brow", dy=-8.0))
    context.change(0, weight=3.0)
    assert tool.choose_feature(0, "right brow", context)
    assert features(context) == ["right brow"]
    assert context.constraints[0].weight == 3.0
    assert not tool.choose_feature(0, "right brow", context), "it is the present one"
    context.change(0, locked=True)
    assert not tool.choose_feature(0, "left brow", context)


def test_candidates_of_a_sketch_from_a_file_are_found_again(man: FaceModel, context: HeadlessContext) -> None:
    context.follow(way_of(context, "inner upper lip", dy=-2.0))
    opened = HeadlessContext(man, context.session.document)
    opened.toolbox.choose("sketch")
    drawn = opened.constraints[0].stroke
    opened.click(drawn[len(drawn) // 2])
    assert features(opened) != features(context)


def test_several_features_add_up_and_are_removed(context: HeadlessContext) -> None:
    names = ["left brow", "right brow", "outer lower lip"]
    for name in names:
        context.follow(way_of(context, name, dy=8.0 if "lip" in name else -8.0))
    assert features(context) == names
    context.click(context.constraints[1].stroke[20], "right")
    assert features(context) == ["left brow", "outer lower lip"]
    context.toolbox.select(0)
    assert context.toolbox.delete_selected()
    assert features(context) == ["outer lower lip"]
    context.change(0, locked=True)
    context.click(context.constraints[0].stroke[20], "right")
    assert features(context) == ["outer lower lip"]


def test_symmetry_draws_the_other_side(context: HeadlessContext) -> None:
    context.toolbox.tool_settings.symmetry.on = True
    check_stages(context, along(way_of(context, "left brow", dy=-8.0)[::4]))
    assert features(context) == ["left brow", "right brow"]
    ids = context.session.model.character.feature_points
    left, right = (context.vertices[ids[name], 1] for name in ("4.3", "4.4"))
    assert left == pytest.approx(right, abs=0.05)
    before = context.constraints
    way = [before[0].stroke[15], shifted(before[0].stroke[15], 0, -9)]
    context.follow(way, "shift")
    moved = context.constraints
    assert len(moved) == 2
    assert all(new.stroke[0][1] == pytest.approx(old.stroke[0][1] - 9) for old, new in zip(before, moved, strict=True))
    tool_of(context).choose_feature(0, "left upper lid", context)
    assert sorted(features(context)) == ["left upper lid", "right upper lid"]
    context.undo()
    context.click(context.constraints[0].stroke[15], "right")
    assert context.constraints == ()


def test_mirrored_strokes_move_both_sides_alike(context: HeadlessContext) -> None:
    context.toolbox.tool_settings.symmetry.on = True
    way = way_of(context, "left brow")
    # Low at the nose and high outside, as of anger.
    context.follow([shifted(p, 0, 16 - 24 * min(2 * i / len(way), 1)) for i, p in enumerate(way)])
    assert features(context) == ["left brow", "right brow"]
    left, right = context.session.residuals_px
    assert left == pytest.approx(right, abs=0.8)
    model = context.session.model
    weights = dict(zip(model.character.shape_names, model.weights_of(context.session.coefficients), strict=True))
    for shape in ("browOuterUp", "browDown", "browInnerUp", "noseSneer"):
        assert weights[shape + "Left"] == pytest.approx(weights[shape + "Right"], abs=0.06), shape


@pytest.mark.parametrize(("lid", "dy"), [("left lower lid", 9.0), ("left upper lid", -9.0), ("left upper lid", 8.0)])
def test_a_lid_turns_no_eye(context: HeadlessContext, lid: str, dy: float) -> None:
    way = way_of(context, lid)
    bent = [shifted(p, 0, dy * np.sin(np.pi * i / (len(way) - 1))) for i, p in enumerate(way)]
    right = [context.feature(name) for name in ("3.2", "3.4")]
    context.follow(bent)
    tool_of(context).choose_feature(0, lid, context)
    context.session.poll()
    assert features(context) == [lid]
    model, pose = context.session.model, context.session.coefficients
    weights = dict(zip(model.character.shape_names, model.weights_of(pose).tolist(), strict=True))
    assert max(abs(weight) for name, weight in weights.items() if name.startswith("eyeLook")) < 0.1
    moved = [context.feature(name)[1] - before[1] for name, before in zip(("3.2", "3.4"), right, strict=True)]
    assert np.abs(moved).max() < 0.35 * abs(dy), "the other eye stays"


def test_half_a_lip_is_completed_by_symmetry(context: HeadlessContext) -> None:
    context.toolbox.tool_settings.symmetry.on = True
    way = way_of(context, "outer lower lip", dy=8.0)
    middle = context.feature("8.2")[0]
    context.follow([place for place in way if place[0] >= middle - 1])
    assert features(context) == ["outer lower lip", "outer lower lip"]
    names = [{name for name, _ in constraint.matched} for constraint in context.constraints]
    assert "8.3" in names[0]
    assert "8.4" in names[1]
    context.undo()
    context.follow(way)
    assert features(context) == ["outer lower lip"], "a whole lip has no other side"


def test_a_sketch_is_moved_by_the_pointer(context: HeadlessContext) -> None:
    context.follow(way_of(context, "left brow", dy=-4.0))
    begun = context.constraints[0]
    way = [begun.stroke[20], shifted(begun.stroke[20], 2, -3), shifted(begun.stroke[20], 3, -8)]
    check_stages(context, along(way, "shift"))
    moved = context.constraints[0]
    np.testing.assert_allclose(np.subtract(moved.stroke, begun.stroke), np.tile((3, -8), (len(begun.stroke), 1)))
    assert [name for name, _ in moved.matched] == [name for name, _ in begun.matched]


def test_a_view_from_the_side(context: HeadlessContext) -> None:
    vertices = context.session.model.character.vertices
    context.view = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0), "three-quarter")
    context.follow(way_of(context, "left brow", dy=-8.0))
    assert features(context) == ["left brow"]
    assert context.session.residuals_px[0] < 3
    context.view = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0))
    stroke = context.constraints[0].stroke
    assert tool_of(context).sketch_at(stroke[20], context) is None, "strokes of other views are out of reach"
    # Their names are not, but only in its own view a sketch can be moved.
    before, tool_of(context).labels = context.constraints, {0: (5.0, 5.0, 60.0, 20.0)}
    context.drag((10.0, 10.0), (40.0, 40.0), "left", "shift")
    assert context.constraints == before
    context.click((10.0, 10.0), "right")
    assert context.constraints == ()


def test_over_a_photo_from_a_tilted_camera(context: HeadlessContext) -> None:
    angle = np.radians(12.0)
    roll = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    taken = Camera(roll @ np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 80.0]), 1900.0, (900, 700))
    context.view = PictureView.whole(taken, (0.0, 0.0, 0.0)).zoomed(1.3)  # type: ignore[assignment]
    context.follow(way_of(context, "left brow", dy=-8.0))
    assert features(context) == ["left brow"]
    (sketch,) = context.constraints
    assert sketch.camera.same_viewpoint(taken)
    assert context.session.residuals_px[0] < 3
    place = sketch.stroke[20]
    context.view = context.view.zoomed(1.5)
    seen = sketch.camera.transferred(place, context.camera)
    assert seen is not None
    assert tool_of(context).sketch_at(seen, context) == 0, "it follows the zoom of the photo"
    # Zoomed while it is drawn, a stroke stays where it is in the photo.
    way = way_of(context, "outer lower lip", dy=10.0)
    camera = context.camera
    context.send("press", way[0])
    for i, pixel in enumerate(way[1:]):
        if i == len(way) // 2:
            context.send("wheel", pixel, None, wheel=-1.0)
        context.send("move", camera.transferred(pixel, context.camera) or pixel)
    context.send("release", camera.transferred(way[-1], context.camera) or way[-1])
    assert features(context) == ["left brow", "outer lower lip"]
    assert context.constraints[1].camera == camera
    np.testing.assert_allclose(context.constraints[1].stroke[-1], way[-1], atol=1e-6)


def test_a_stroke_waits_for_the_recogniser(context: HeadlessContext) -> None:
    tool = tool_of(context)
    ready: list[bool] = []
    tool.preparing = lambda: not ready
    context.follow(way_of(context, "left brow", dy=-8.0))
    assert context.constraints == ()
    assert len(tool.waiting) == 1
    assert "Preparing" in context.toolbox.hint()
    assert not tool.advance(context)
    ready.append(True)
    assert tool.advance(context)
    context.session.poll()
    assert features(context) == ["left brow"]
    ready.clear()
    context.follow(way_of(context, "right brow", dy=-8.0))
    assert context.toolbox.cancel()
    ready.append(True)
    assert not tool.advance(context), "Esc discards what waits"


def test_where_a_press_draws(context: HeadlessContext) -> None:
    tool = tool_of(context)
    assert not tool.works_at((3.0, 3.0), context)
    below = shifted(context.feature("2.1"), 0, 12)
    assert tool.works_at(below, context)
    jaw = context.feature("2.13")
    assert tool.works_at(shifted(context.feature("11.1"), 0, -30), context), "hair is a part of the head"
    assert tool.works_at(shifted(context.feature("2.1"), 0, 90), context), "as is the neck"
    sides = [shifted(jaw, sign * dx, 0) for sign in (-1, 1) for dx in range(0, 300, 2)]
    picked = {place: context.pick(place) for place in sides}
    off = [place for place, point in picked.items() if point is None]
    on = {place for place, point in picked.items() if point is not None}
    assert on
    distances = {place: min(abs(place[0] - other[0]) for other in on) for place in off}
    near = [place for place, distance in distances.items() if distance < 10]
    far = [place for place, distance in distances.items() if distance > 85]
    assert near
    assert all(tool.works_at(place, context) for place in near[::2])
    assert not any(tool.works_at(place, context) for place in far[::10])
    view = context.view
    context.drag((3.0, 3.0), (60.0, 3.0))
    assert context.view != view, "elsewhere, the view turns"
    context.view = view
    context.click(below)
    assert context.constraints == ()
    assert tool.unnamed == (), "a click is no stroke"


def test_an_unnamed_stroke_is_shown_in_its_own_view(context: HeadlessContext) -> None:
    tool, view = tool_of(context), context.view
    context.follow(scribble(context))
    assert len(tool.unnamed) == 1
    assert not tool.follow(context)
    context.drag((3.0, 3.0), (60.0, 3.0))
    assert tool.follow(context)
    assert tool.unnamed == ()
    assert not context.toolbox.can_step_back, "undo does not discard what is not seen"
    context.view = view
    assert tool.follow(context)
    assert len(tool.unnamed) == 1, "it returns with its view"


def test_unnamed_strokes_stay_until_they_are_named_or_discarded(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(scribble(context))
    context.follow([shifted(place, 0, 40) for place in scribble(context)])
    assert "2 strokes" in tool.hint(context)
    context.follow(way_of(context, "left brow", dy=-8.0))
    assert features(context) == ["left brow"]
    assert len(tool.unnamed) == 2
    context.toolbox.choose("point")
    context.toolbox.choose("sketch")
    first, last = tool.unnamed
    context.undo()
    assert features(context) == [], "the last stroke is undone first"
    assert tool.unnamed == (first, last)
    context.undo()
    assert tool.unnamed == (first,)
    context.undo()
    assert tool.unnamed == ()
    context.follow(scribble(context))
    context.follow([shifted(place, 0, 40) for place in scribble(context)])
    context.click(scribble(context)[3], "right")
    assert len(tool.unnamed) == 1
    assert context.toolbox.cancel()
    assert tool.unnamed == ()


def test_a_name_is_taken_back_and_returned(context: HeadlessContext) -> None:
    tool = tool_of(context)
    context.follow(scribble(context))
    stroke = tool.unnamed[0].stroke
    tool.name_stroke("jaw line", context)
    assert tool.unnamed == ()
    for _ in range(2):
        context.undo()
        assert tool.follow(context)
        assert [unnamed.stroke for unnamed in tool.unnamed] == [stroke], "it is unnamed again"
        assert features(context) == []
        context.redo()
        assert tool.follow(context)
        assert tool.unnamed == ()
        assert features(context) == ["jaw line"]
    context.undo()
    tool.follow(context)
    context.follow(way_of(context, "left brow", dy=-8.0))
    tool.follow(context)
    assert features(context) == ["left brow"]
    assert len(tool.unnamed) == 1, "another step does not name it"
    context.undo()
    tool.follow(context)
    assert context.toolbox.can_step_back
    context.undo()
    assert tool.unnamed == ()


def test_undo_selects_what_was_removed(context: HeadlessContext) -> None:
    for name in ("left brow", "right brow"):
        context.follow(way_of(context, name, dy=-8.0))
    context.toolbox.select(0)
    assert context.toolbox.delete_selected()
    assert context.toolbox.selection == frozenset()
    context.undo()
    assert context.toolbox.selection == {0}
    context.toolbox.select(1)
    context.click(context.constraints[0].stroke[15], "right")
    context.undo()
    assert context.toolbox.selection == {1}


def test_hidden_and_locked_sketches(context: HeadlessContext) -> None:
    context.follow(way_of(context, "left brow", dy=-8.0))
    place = context.constraints[0].stroke[20]
    assert context.toolbox.sketch_tool.sketch_at(place, context) == 0
    context.unmarked = frozenset({0})
    assert context.toolbox.sketch_tool.sketch_at(place, context) is None
    context.unmarked = frozenset()
    context.change(0, locked=True)
    before = context.constraints
    context.click(place)
    context.follow([place, shifted(place, 0, -9)], "shift")
    assert context.constraints == before


def test_the_pressure_of_a_pen_is_harmless(context: HeadlessContext) -> None:
    from faceposer.tools.tool import PointerEvent

    for kind, at, *_ in along(way_of(context, "left brow", dy=-8.0)):
        context.toolbox.dispatch(PointerEvent(kind, at, "left", pressure=0.0))
    assert features(context) == ["left brow"]


def test_all_strokes_wait_in_order_whatever_tool_is_chosen(context: HeadlessContext) -> None:
    tool = tool_of(context)
    ready: list[bool] = []
    tool.preparing = lambda: not ready
    for feature in ("left brow", "right brow", "outer lower lip"):
        context.follow(way_of(context, feature, dy=-8.0 if "brow" in feature else 4.0))
    assert len(tool.waiting) == 3
    assert tool.step_back()
    assert len(tool.waiting) == 2, "undo removes the last one"
    context.toolbox.choose("point")
    assert len(tool.waiting) == 2, "another tool leaves them"
    ready.append(True)
    while tool.advance(context):
        context.session.poll()
    assert features(context) == ["left brow", "right brow"]


def test_a_sketch_too_many_is_said(context: HeadlessContext, monkeypatch: pytest.MonkeyPatch) -> None:
    context.follow(way_of(context, "left brow", dy=-8.0))
    before, depth = context.constraints, context.session.depth
    monkeypatch.setattr("faceposer.session.effort.MOST_DRAWN", 1)
    context.follow(way_of(context, "right brow", dy=-8.0))
    assert context.notices == [
        "The sketch is not kept: the session has too many strokes, or they cover too many pixels"
    ]
    assert (context.constraints, context.session.depth) == (before, depth)
    context.follow(way_of(context, "left brow", dy=-4.0))
    assert features(context) == ["left brow"], "one that replaces another has room"
    assert len(context.notices) == 1
