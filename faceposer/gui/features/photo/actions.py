"""Actions of photos in menus and on keys."""

from functools import partial

from faceposer.gui.actions import Action
from faceposer.gui.features.photo.photos import Photos


def photo_actions(photos: Photos) -> tuple[Action, ...]:
    """Return the actions of ``photos``."""

    def free() -> bool:
        return not photos.context.busy

    def has_photo() -> bool:
        return free() and photos.photo is not None

    def can_put_back() -> bool:
        return has_photo() and not photos.put_back_problem

    return (
        Action("photo-open", "Open photo...", "File", photos.ask, (), free, help="Pose the face from a photo"),
        Action(
            "photo-pin",
            "Pin the photo",
            "Tools",
            photos.start_pinning,
            ("O",),
            has_photo,
            lambda: photos.context.toolbox.chosen is photos.tool,
            separated=True,
            help="Mark features of the face on the photo to find its camera",
        ),
        Action(
            "photo-skip",
            "Skip this pin",
            "Tools",
            photos.skip,
            ("Tab",),
            lambda: has_photo() and photos.context.toolbox.chosen is photos.tool,
            help="Skip a feature that is hidden in the photo",
        ),
        Action(
            "photo-pose",
            "Pose from the pins",
            "Tools",
            photos.pose_from_pins,
            (),
            lambda: has_photo() and photos.has_enough_pins,
            help="Pose the face with points and distances made from the pins",
        ),
        Action(
            "photo-expression",
            "Take the expression",
            "Tools",
            photos.take_expression,
            (),
            lambda: has_photo() and not photos.expression.running and photos.takes_expressions,
            help="Find the face in the photo and pose the character after it, without pins",
        ),
        Action(
            "photo-look",
            "Look through the photo",
            "View",
            photos.look_through,
            (),
            lambda: has_photo() and not photos.aligned,
            separated=True,
            help="Return the view to the camera of the photo",
        ),
        Action(
            "photo-shown",
            "Show the photo",
            "View",
            photos.toggle,
            ("Shift+O",),
            has_photo,
            lambda: photos.photo is not None and photos.photo.visible,
            help="Show or hide the photo",
        ),
        Action(
            "photo-put-back",
            "Put the face back",
            "View",
            photos.put_back,
            (),
            can_put_back,
            lambda: photos.putting_back.on,
            help="Show the photo with the face as it is now, in the photo's light",
        ),
        Action(
            "photo-wipe",
            "Wipe between photo and face",
            "View",
            photos.toggle_wipe,
            ("Shift+W",),
            has_photo,
            lambda: photos.wipe.on,
            help="Divide the view by a line that can be dragged: the photo on its left, the face on its right",
        ),
        *(
            Action(
                f"photo-wipe-{side}",
                f"Move the wipe {side}",
                "View",
                partial(photos.wipe.move, step),
                (f"Ctrl+{side.capitalize()}",),
                lambda: photos.wipe.shown,
                repeats=True,
                help=f"Move the line between photo and face to the {side}",
                listed=False,
            )
            for side, step in (("left", -1), ("right", 1))
        ),
    )
