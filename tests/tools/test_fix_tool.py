"""Fixed vertices by pointer: painted, encircled, erased, held by region, and taken back at each stage."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.tools.fix_tool import fixed_region_index, toggle_fixed_region
from tests.tools.context import HeadlessContext, Pixel, along, check_stages, shifted, straight

NOSE, LEFT, RIGHT = "9.3", "8.3", "8.4"


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("fix")
    return context


def mouth(context: HeadlessContext) -> list[Pixel]:
    return straight(context.feature(RIGHT), context.feature(LEFT), 4)


def around(centre: Pixel, radius: float) -> list[Pixel]:
    return [shifted(centre, radius * np.cos(a), radius * np.sin(a)) for a in np.linspace(0, 6, 10)]


def held(context: HeadlessContext) -> set[int]:
    found = [c for c in context.constraints if isinstance(c, FixedConstraint)]
    return {int(-1 - face) for c in found for face in c.points.faces}


def test_painted_vertices_stay_where_they_are(context: HeadlessContext) -> None:
    check_stages(context, along(mouth(context)))
    (fixed,) = context.constraints
    character = context.session.model.character
    vertices = -1 - fixed.points.faces
    np.testing.assert_allclose(fixed.positions, character.vertices[vertices], atol=1e-9)
    pixels = context.camera.project(fixed.positions)
    assert np.hypot(*(pixels - mouth(context)[0]).T).min() < 18
    assert pixels[:, 1].min() > context.feature(NOSE)[1]
    context.toolbox.choose("point")
    begin = context.feature("2.1")
    context.drag(begin, shifted(begin, 0, 15))
    with_hold = np.abs(context.vertices - character.vertices)[vertices].max()
    context.change(0, enabled=False)
    assert np.abs(context.vertices - character.vertices)[vertices].max() > 2 * with_hold


def test_only_what_is_seen_is_held(context: HeadlessContext) -> None:
    options = context.toolbox.tool_settings.options
    options.fix_mode = "lasso"
    context.follow([(0, 0), (799, 0), (799, 799), (0, 799)])
    (fixed,) = context.constraints
    character = context.session.model.character
    assert character.vertices[-1 - fixed.points.faces][:, 2].min() > character.vertices[:, 2].min() + 2


def test_painting_on_lets_the_selected_area_grow(context: HeadlessContext) -> None:
    context.click(context.feature(NOSE))
    few = held(context)
    check_stages(context, along(mouth(context)))
    assert len(context.constraints) == 1
    assert held(context) > few
    context.toolbox.cancel()
    context.click(context.feature(NOSE))
    assert len(context.constraints) == 2, "with nothing selected a new area begins"


def test_a_lasso_holds_what_it_encloses(context: HeadlessContext) -> None:
    context.toolbox.tool_settings.options.fix_mode = "lasso"
    nose = context.feature(NOSE)
    way = around(nose, 40)
    context.send("press", way[0])
    context.send("move", way[1])
    assert context.toolbox.fix_tool.lasso == way[:2]
    context.toolbox.cancel()
    assert context.toolbox.fix_tool.lasso == []
    for event in along(way)[:-1]:
        context.send(*event)
    context.toolbox.cancel()
    assert context.constraints == ()
    assert not context.session.can_undo
    context.follow(way)
    (fixed,) = context.constraints
    distances = np.hypot(*(context.camera.project(fixed.positions) - nose).T)
    assert distances.max() < 41
    count = len(held(context))
    context.follow(around(nose, 20), "ctrl")
    assert 0 < len(held(context)) < count
    context.undo()
    assert len(held(context)) == count
    context.undo()
    assert context.constraints == ()


def test_ctrl_lets_go(context: HeadlessContext) -> None:
    context.follow(mouth(context))
    whole = held(context)
    corner = mouth(context)[0]
    check_stages(context, [("press", corner, "left", "ctrl"), ("release", corner, "left", "ctrl")])
    assert held(context) < whole
    assert len(context.constraints[0].positions) == len(held(context))
    context.toolbox.tool_settings.options.fix_brush = 160.0
    context.follow(mouth(context), "ctrl")
    assert context.constraints == (), "an area that holds nothing is gone"


def test_a_locked_area_neither_grows_nor_shrinks(context: HeadlessContext) -> None:
    context.follow(mouth(context))
    context.change(0, locked=True)
    kept = context.constraints
    context.follow(mouth(context), "ctrl")
    assert context.constraints == kept
    context.follow(straight(context.feature(NOSE), shifted(context.feature(NOSE), 5, 0)))
    assert context.constraints[0] == kept[0]
    assert len(context.constraints) == 2
    context.toolbox.select(0)
    assert not context.toolbox.delete_selected()


def test_the_brush_reaches_as_far_as_it_is_wide(context: HeadlessContext) -> None:
    counts = []
    for width in (20.0, 60.0, 120.0):
        context.toolbox.tool_settings.options.fix_brush = width
        context.click(context.feature(NOSE))
        counts.append(len(held(context)))
        context.undo()
    assert 0 < counts[0] < counts[1] < counts[2]


def test_a_region_is_held_and_let_go_by_a_click(context: HeadlessContext) -> None:
    names = ("mouth", "lip_upper", "lip_lower")
    tool_settings = context.toolbox.tool_settings
    assert fixed_region_index(names, context) is None
    toggle_fixed_region(names, context, tool_settings)
    assert fixed_region_index(names, context) == 0
    assert context.toolbox.selection == {0}
    regions = context.session.model.character.regions
    assert held(context) == {int(v) for name in names if name in regions for v in regions[name]}
    toggle_fixed_region(names, context, tool_settings)
    assert context.constraints == ()
    context.undo()
    assert fixed_region_index(names, context) == 0
    context.undo()
    assert not context.session.can_undo
    context.redo()
    context.change(0, locked=True)
    toggle_fixed_region(names, context, tool_settings)
    assert fixed_region_index(names, context) == 0, "a locked region stays"
    toggle_fixed_region(("no such region",), context, tool_settings)
    assert len(context.constraints) == 1


def test_beside_the_face_the_brush_orbits(context: HeadlessContext) -> None:
    view = context.view
    context.drag((5, 5), (40, 5))
    assert context.view != view
    assert context.constraints == ()
