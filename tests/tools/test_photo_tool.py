"""Setting pins on a photo by gestures."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.geometry.picture_view import PictureView
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import first_camera
from faceposer.photo.photo import Photo
from faceposer.photo.places import GUIDED
from faceposer.session.document import Document
from tests.tools.context import HeadlessContext, Pixel, along, check_stages, straight

TAKEN = Camera(np.diag([1.0, -1.0, -1.0]), np.array([4.0, -6.0, 100.0]), 1500.0, (1000, 600))


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    photo = Photo("a.jpg", (1000, 600))
    camera = first_camera(photo, model)
    context = HeadlessContext(model, Document("man", photos=(replace(photo, camera=camera),)))
    context.view = PictureView.whole(camera, (0.0, 0.0, 0.0)).zoomed(1.5).panned(20.0, -10.0, context.size)  # type: ignore[assignment]
    context.toolbox.photo_tool.active = 0
    context.toolbox.choose("photo")
    context.toolbox.photo_tool.place = "3.7"
    return context


def in_view(context: HeadlessContext, name: str) -> Pixel:
    """Where the view shows what the photo has of the feature point ``name``."""
    vertex = context.session.model.character.feature_points[name]
    u, v = TAKEN.project(context.session.model.character.vertices[[vertex]])[0]
    view = context.view
    scale = view.scale(context.size)  # type: ignore[attr-defined]
    return (400.0 + (u - view.middle[0]) * scale, 400.0 + (v - view.middle[1]) * scale)  # type: ignore[attr-defined]


def pins(context: HeadlessContext) -> dict[object, Pixel]:
    return {pin.place: pin.pixel for pin in context.session.document.photos[0].pins}


def test_one_is_led_from_pin_to_pin_and_the_view_takes_up_the_camera(context: HeadlessContext) -> None:
    tool = context.toolbox.photo_tool
    for i, name in enumerate(GUIDED[:9]):
        assert tool.place == name
        context.click(in_view(context, name))
        assert len(pins(context)) == i + 1
    assert tool.place == GUIDED[9]
    found = context.session.document.photos[0].camera
    assert found is not None
    np.testing.assert_allclose(found.rotation, TAKEN.rotation, atol=0.03)
    vertex = context.session.model.character.feature_points["9.3"]
    seen = context.camera.project(context.session.model.character.vertices[[vertex]])[0]
    np.testing.assert_allclose(seen, in_view(context, "9.3"), atol=3.0)
    assert tool.pixels(context)[GUIDED.index("9.3")] == pytest.approx(in_view(context, "9.3"))
    context.undo()
    assert len(pins(context)) == 8


def test_every_stage_can_be_taken_back(context: HeadlessContext) -> None:
    check_stages(context, along(straight((300.0, 300.0), (340.0, 320.0), 4)))
    (pixel,) = pins(context).values()
    x, y = context.toolbox.photo_tool.pixels(context)[0]
    assert (x, y) == pytest.approx((340.0, 320.0))
    check_stages(context, along(straight((x + 2.0, y), (x + 42.0, y + 10.0), 4)))
    assert context.toolbox.photo_tool.pixels(context)[0] == pytest.approx((x + 40.0, y + 10.0))
    assert pins(context)["3.7"] != pixel


def test_pins_are_removed_and_places_skipped_or_chosen_on_the_face(context: HeadlessContext) -> None:
    tool = context.toolbox.photo_tool
    tool.skip(context)
    assert tool.place == "3.12"
    context.click((300.0, 300.0))
    context.click(tool.pixels(context)[0], "right")
    assert pins(context) == {}
    where = context.feature("5.1")
    context.send("press", where, "left", "shift")
    assert not context.toolbox.active
    assert tool.place not in GUIDED
    context.click((500.0, 420.0))
    assert list(pins(context)) != ["3.7"]
    assert tool.place == "3.7"
    assert tool.discard()
    before = context.session.document
    context.click((200.0, 200.0))
    assert context.session.document is before, "no place is chosen, and no pin lies there"


def test_a_photo_that_is_not_looked_through_gets_no_pins(context: HeadlessContext) -> None:
    view = context.view
    context.view = replace(view, locked=False).orbited(20.0, 0.0, context.size)  # type: ignore[attr-defined]
    context.click((300.0, 300.0))
    assert pins(context) == {}
    assert "Look through" in context.toolbox.photo_tool.hint(context)
