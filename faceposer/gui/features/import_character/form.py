"""Entries of the form that imports a custom character."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import check_output
from faceposer.files.names import save_path
from faceposer.session.character_library import CharacterLibrary

if TYPE_CHECKING:
    from faceposer.training.kinds import Kind, Sides
    from faceposer.training.request import TrainingRequest

Regions = Literal["face", "whole", "parts"]


@dataclass
class ImportForm:
    """Entries of the user; paths as they were typed, "" if empty.

    Attributes:
        source: File or folder to learn the character from.
        kind: Kind of the source.
        captures: Recorded performances to learn the prior of a rig from.
        neutral: Neutral mesh.
        marker_map: File that maps each marker to a place on the scan.
        scan: Character or mesh that the markers deform.
        regions: Regions of the examples that have separate modes; "parts" are ``n_parts`` regions found from motion.
        n_parts: Number of regions found from motion, 2 to 12.
        dimensions: Number of modes, or 0 to choose it from the data.
        components: Number of factor analyzers of the prior, or 0 to choose it from the data.
        factors: Number of factors of each analyzer, or 0 to choose it from the data.
        sides: Reading of left and right in the names of a rig's shapes.
        align_shapes: False to read the shapes of a rig as they are stored.
        weights_range: Full weight of an avatar's expressions, 1 or 100; 0 to infer it.
        title: Title of the character.
        credits: Origin and licence of the character.
        output: Character file to write.
        proposed: Title and output proposed for the source; entries that differ were made by the user.
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
    sides: "Sides" = "auto"
    align_shapes: bool = True
    weights_range: int = 0
    title: str = ""
    credits: str = ""
    output: str = ""
    proposed: tuple[str, str] = ("", "")

    @property
    def accepts_neutral(self) -> bool:
        """True if a neutral mesh can be given; a glTF file contains one, and markers use their first frame."""
        return self.kind == "examples" or (
            self.kind == "rig" and bool(self.source) and paths.is_dir(_path(self.source))
        )

    def follow_source(self, library: CharacterLibrary) -> None:
        """Detect the kind of the source, and propose title and output unless the user has entered them.

        Args:
            library: Library that proposes the output file, which is never next to the source.
        """
        from faceposer.training.kinds import kind_of, plain_name

        path = _path(self.source)
        if not self.source.strip() or not paths.exists(path):
            return
        try:
            self.kind = kind_of(path)
        except FacePoserError:
            # The import itself reports the error.
            return
        name = plain_name(path)
        output = library.new_path(name)
        before, self.proposed = self.proposed, (name.replace("-", " ").capitalize(), str(output))
        if self.title in ("", before[0]):
            self.title = self.proposed[0]
        if self.output in ("", before[1]):
            self.output = self.proposed[1]

    @property
    def missing(self) -> str:
        """The entry that is missing, as one sentence, or ""."""
        if not self.source.strip():
            return "Choose a source for the character."
        if self.kind == "markers" and not self.marker_map.strip():
            return "Choose the file that maps the markers to the scan."
        if not self.output.strip():
            return "Enter a file name for the character."
        return ""

    def checked_output(self) -> Path:
        """Return the character file to write.

        Raises:
            FacePoserError: If an entry is missing, or the file cannot be written.
        """
        if self.missing:
            raise FacePoserError(self.missing)
        path = _path(self.output)
        if paths.is_dir(path):
            raise FacePoserError(f"'{path}' is a folder; enter a file name.")
        path = save_path(path, ".npz")
        if not paths.is_dir(path.parent):
            raise FacePoserError(f"The folder '{path.parent}' does not exist; create it first.")
        check_output(path, ".npz")
        if paths.same_file(path, _path(self.source)):
            raise FacePoserError(f"'{path.name}' is the source; save the character under another name.")
        return path

    def request(self, output: Path) -> "TrainingRequest":
        """Return the training request for the entries."""
        from faceposer.training.kinds import plain_name
        from faceposer.training.request import TrainingRequest

        name = plain_name(output)
        return TrainingRequest(
            kind=self.kind,
            source=_path(self.source),
            name=name,
            title=self.title.strip() or name.replace("-", " ").capitalize(),
            captures=tuple(_path(text) for text in self.captures) if self.kind == "rig" else (),
            neutral=_path(self.neutral) if self.neutral.strip() and self.accepts_neutral else None,
            marker_map=_path(self.marker_map) if self.kind == "markers" else None,
            scan=self.scan.strip() or "man",
            segments=self.n_parts if self.regions == "parts" else self.regions,
            n_dimensions=(self.dimensions or None) if self.kind != "rig" else None,
            n_components=self.components or None,
            n_factors=self.factors or None,
            credits=self.credits.strip(),
            align_shapes=self.align_shapes,
            weights_range=float(self.weights_range) or None,
            sides=self.sides,
        )


def _path(text: str) -> Path:
    """Return the path in ``text``, without the quotation marks that some systems add when a path is copied."""
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        text = text[1:-1]
    return paths.expand_user(text)
