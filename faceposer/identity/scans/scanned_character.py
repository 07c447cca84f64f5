"""Characters of heads from scans."""

from faceposer.errors import counted
from faceposer.identity.character import character_of
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scans.head_from_scans import HeadFromScans
from faceposer.model.character import Character
from faceposer.model.character_names import joined_credits


def scanned_character(made: HeadFromScans, name: str, title: str, model: IdentityModel | None = None) -> Character:
    """Return the character of the head ``made`` from scans, with the credits of all that it was made of.

    Args:
        made: The head.
        name: Short name for commands and files.
        title: Display name.
        model: The model that was fitted; the shipped one if None.

    Raises:
        FacePoserError: If the skin is not of the size of a head.
    """
    names = ", ".join(one.scan.name for one in made.scans)
    source = f"Made from {counted(len(made.scans), 'scan')}: {names}."
    credits = joined_credits(source, (model or load_identity_model()).credits)
    return character_of(made.skin, name=name, title=title, textures=made.textures, credits=credits)
