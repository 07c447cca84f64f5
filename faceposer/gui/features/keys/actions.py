"""Actions of key poses: the switch of the strip, and commands that the strip and the command palette offer."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from faceposer.gui.actions import Action

if TYPE_CHECKING:
    from faceposer.gui.features.keys.commands import KeyCommands

_MENU = "Animate"


def build_keys_actions(keys: "KeyCommands") -> list[Action]:
    """Return the actions of ``keys``."""

    def free() -> bool:
        return not keys.context.busy and not keys.work.busy

    def usable() -> bool:
        return free() and keys.opened.transferable is not None

    def command(name: str, label: str, run: Callable[[], object], enabled: Callable[[], bool], help_: str) -> Action:
        return Action(f"keys-{name}", label, _MENU, run, (), enabled, help=help_, listed=False)

    return [
        Action(
            "key-poses",
            "Key poses",
            _MENU,
            keys.toggle,
            checked=lambda: keys.shown,
            separated=True,
            help="Show key poses below the view: what expressions look like on another character",
        ),
        command("new", "New key poses...", keys.ask_for_new, free, "Create a folder of key poses"),
        command("open", "Open key poses...", keys.ask_for_folder, free, "Open a folder of key poses"),
        command(
            "add",
            "Add key pose...",
            keys.ask_to_add,
            lambda: free() and keys.poses_side("source"),
            "Add this pose of the source as a key pose; the target's pose is proposed",
        ),
        command("compose", "Compose key poses", keys.compose, usable, "Combine emotional with verbal key poses"),
        command(
            "importance-source",
            "Importance on source",
            lambda: keys.show_importance("source"),
            usable,
            "Show how important each place of the source's face is for speech",
        ),
        command(
            "importance-target",
            "Importance on target",
            lambda: keys.show_importance("target"),
            usable,
            "Show how important each place of the target's face is for speech",
        ),
        command(
            "save",
            "Save key pose",
            keys.editing.save,
            lambda: free() and keys.editing.edited is not None,
            "Save the key pose that is edited, which changes the clone",
        ),
        command(
            "back",
            "Back from key pose",
            keys.editing.back,
            lambda: free() and keys.editing.before is not None,
            "Return to the session before the first key pose, as it was",
        ),
    ]
