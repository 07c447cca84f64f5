"""What the user enters to make a custom character."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from faceposer.errors import FacePoserError
from faceposer.files.names import save_path
from faceposer.session.character_library import CharacterLibrary

if TYPE_CHECKING:
    from faceposer.training.kinds import Kind
    from faceposer.training.request import TrainingRequest

Regions = Literal["face", "whole", "parts"]


@dataclass
class ImportForm:
    """What the user has entered; paths as they were typed, "" where nothing was.

    Attributes:
        source: What to learn from.
        kind: Of the source.
        captures: Performances, for a rig.
        neutral: The neutral mesh.
        marker_map: Where the markers are.
        scan: What the markers move: a character or a mesh.
        regions: Which regions of examples get modes of their own; "parts" are ``n_parts`` found by their motion.
        n_parts: From 2 to 12.
        dimensions: Number of modes, 0 to choose it by the data; likewise ``components`` and ``factors`` of the prior.
        title: Name to show.
        credits: Where the character comes from, and its licence.
        output: The character file to write.
        proposed: Title and output that follow from the source; what differs from them, the user has entered.
    """

    source: str = ""
    kind: "Kind" = "rig"
    captures: list[str] = field(default_factory=list)
    neutral: str = ""
    marker_map: str = ""
    scan: str = "man"
    regions: Regions = "face"
    n_parts: int = 6
    dimensions: int = 0
    components: int = 0
    factors: int = 0
    title: str = ""
    credits: str = ""
    output: str = ""
    proposed: tuple[str, str] = ("", "")

    @property
    def takes_neutral(self) -> bool:
        """Whether a neutral mesh can be told: a glTF file has its own, markers their first frame."""
        return self.kind == "examples" or (self.kind == "rig" and bool(self.source) and _path(self.source).is_dir())

    def follow_source(self, library: CharacterLibrary) -> None:
        """Guess the kind of the source, and propose title and output unless they are the user's own.

        Args:
            library: Where the output goes: never beside the source.
        """
        from faceposer.training.kinds import kind_of, plain_name

        path = _path(self.source)
        if not self.source.strip() or not path.exists():
            return
        try:
            self.kind = kind_of(path)
        except FacePoserError:
            # Whatever it is, learning says what is wrong with it.
            return
        name = plain_name(path)
        output = library.new_path(name)
        before, self.proposed = self.proposed, (name.replace("-", " ").capitalize(), str(output))
        if self.title in ("", before[0]):
            self.title = self.proposed[0]
        if self.output in ("", before[1]):
            self.output = self.proposed[1]

    def checked_output(self) -> Path:
        """Return the file to write.

        Raises:
            FacePoserError: If something is missing, or it could not be written.
        """
        if not self.source.strip():
            raise FacePoserError("Choose what to learn the character from.")
        if self.kind == "markers" and not self.marker_map.strip():
            raise FacePoserError("Choose the map that says where on the scan each marker is.")
        if not self.output.strip():
            raise FacePoserError("Say where to save the character.")
        path = _path(self.output)
        if path.is_dir():
            raise FacePoserError(f"'{path}' is a folder; give the name of a file.")
        path = save_path(path, ".npz")
        if not path.parent.is_dir():
            raise FacePoserError(f"There is no folder '{path.parent}'; make it first.")
        if path.exists() and path.samefile(_path(self.source)):
            raise FacePoserError(f"'{path.name}' is what is learned from; save the character under another name.")
        return path

    def request(self, output: Path) -> "TrainingRequest":
        """Return the form as the request that learning understands."""
        from faceposer.training.kinds import plain_name
        from faceposer.training.request import TrainingRequest

        name = plain_name(output)
        return TrainingRequest(
            kind=self.kind,
            source=_path(self.source),
            name=name,
            title=self.title.strip() or name.replace("-", " ").capitalize(),
            captures=tuple(_path(text) for text in self.captures) if self.kind == "rig" else (),
            neutral=_path(self.neutral) if self.neutral.strip() and self.takes_neutral else None,
            marker_map=_path(self.marker_map) if self.kind == "markers" else None,
            scan=self.scan.strip() or "man",
            segments=self.n_parts if self.regions == "parts" else self.regions,
            n_dimensions=(self.dimensions or None) if self.kind != "rig" else None,
            n_components=self.components or None,
            n_factors=self.factors or None,
            credits=self.credits.strip(),
        )


def _path(text: str) -> Path:
    """Return the path that was typed or pasted; some systems copy paths in quotation marks."""
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        text = text[1:-1]
    return Path(text).expanduser()
