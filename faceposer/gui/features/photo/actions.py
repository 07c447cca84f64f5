"""What menus and keys do with photos."""

from typing import TYPE_CHECKING

from faceposer.gui.actions import Action

if TYPE_CHECKING:
    from faceposer.gui.features.photo.feature import PhotoFeature


def photo_actions(photos: "PhotoFeature") -> tuple[Action, ...]:
    """Return the menu entries of ``photos``."""

    def free() -> bool:
        return not photos.context.busy

    def shown() -> bool:
        return free() and photos.photo is not None

    return (
        Action("photo-open", "Open photo...", "File", photos.ask, (), free, help="Pose the face after a photo"),
        Action(
            "photo-pin",
            "Pin the photo",
            "Tools",
            photos.pin,
            ("O",),
            shown,
            lambda: photos.context.toolbox.chosen is photos.tool,
            separated=True,
            help="Show where the photo has the features of the face, so that its camera is found",
        ),
        Action(
            "photo-skip",
            "Skip this pin",
            "Tools",
            photos.skip,
            ("Tab",),
            lambda: shown() and photos.context.toolbox.chosen is photos.tool,
            help="Go on to the next place: not all can be seen in every photo",
        ),
        Action(
            "photo-pose",
            "Pose from the pins",
            "Tools",
            photos.pose,
            (),
            lambda: shown() and photos.enough,
            help="Let the face take the expression that the pins tell, by points and distances",
        ),
        Action(
            "photo-look",
            "Look through the photo",
            "View",
            photos.look,
            (),
            lambda: shown() and not photos.aligned,
            separated=True,
            help="Return to the camera that took the photo",
        ),
        Action(
            "photo-shown",
            "Show the photo",
            "View",
            photos.toggle,
            ("Shift+O",),
            shown,
            lambda: photos.photo is not None and photos.photo.visible,
            help="Show the photo or only the face",
        ),
    )
