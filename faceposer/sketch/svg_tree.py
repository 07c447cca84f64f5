"""Elements of an SVG file, read without entities, external files or unlimited depth."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from faceposer.errors import FacePoserError, printable
from faceposer.files.reading import read_bytes

_MAX_BYTES = 32 * 2**20
_MOST_ELEMENTS, _DEEPEST = 50_000, 100
_SVG = "http://www.w3.org/2000/svg"
# Rules of style sheets for a class, which Illustrator and Affinity write.
_RULE = re.compile(r"([^{}]{1,2000})\{([^{}]{0,4000})\}")
_CLASS = re.compile(r"\.([\w-]{1,200})$")
#: Properties that children inherit.
INHERITED = ("fill", "stroke", "visibility")


@dataclass(eq=False)
class Element:
    """An element.

    Attributes:
        tag: Its name without the namespace of SVG; with it, as "URI name", in others.
        attributes: Its attributes, those of other namespaces as "URI name".
        children: Its child elements.
    """

    tag: str
    attributes: Mapping[str, str]
    children: list["Element"] = field(default_factory=list)


@dataclass(eq=False)
class SvgTree:
    """The elements of a file.

    Attributes:
        root: The outermost element.
        by_id: Elements by their id; the first of each.
        classes: Declarations of the style sheets by class.
    """

    root: Element
    by_id: dict[str, Element]
    classes: dict[str, dict[str, str]]

    def style(self, element: Element, inherited: Mapping[str, str]) -> dict[str, str]:
        """Return the properties of ``element``, some of them ``inherited``."""
        found = {name: inherited[name] for name in INHERITED if name in inherited}
        names = ("display", "opacity", *INHERITED)
        found |= {name: element.attributes[name].strip() for name in names if name in element.attributes}
        for name in element.attributes.get("class", "").split():
            found |= self.classes.get(name, {})
        return found | declarations(element.attributes.get("style", ""))


def declarations(text: str) -> dict[str, str]:
    """Return the properties that ``text``, such as "fill:none;stroke:#000", declares."""
    pairs = (part.partition(":") for part in text.split(";"))
    return {name.strip(): value.removesuffix("!important").strip() for name, colon, value in pairs if colon}


def read_svg_tree(path: Path) -> SvgTree:
    """Return the elements in the file ``path``.

    Raises:
        FacePoserError: If it cannot be read, is not an SVG, or is larger than any drawing.
    """
    where = f"the drawing '{path}'"
    try:
        content = read_bytes(path, _MAX_BYTES)
    except OSError as error:
        raise FacePoserError(f"Cannot read {where}: {error.strerror}.") from error
    if content[:2] == b"\x1f\x8b":
        raise FacePoserError(f"Cannot read {where}: it is compressed (SVGZ); save it as plain SVG.")
    builder = _Builder()
    try:
        builder.parse(content)
    except _RefusedError as error:
        raise FacePoserError(f"Cannot read {where}: {error}.") from error
    except (expat.ExpatError, ValueError, LookupError) as error:
        place = f" (line {error.lineno})" if isinstance(error, expat.ExpatError) else ""
        raise FacePoserError(f"Cannot read {where}: it is not well-formed XML{place}.") from error
    if builder.root is None or builder.root.tag != "svg":
        name = "" if builder.root is None else f", but <{printable(builder.root.tag[:40])}>"
        raise FacePoserError(f"Cannot read {where}: its outermost element is not <svg>{name}.")
    return SvgTree(builder.root, builder.by_id, _classes("".join(builder.sheets)))


class _RefusedError(Exception):
    pass


class _Builder:
    """Builds the tree while the file is parsed, so that limits hold before memory is taken."""

    def __init__(self) -> None:
        self.root: Element | None = None
        self.by_id: dict[str, Element] = {}
        self.sheets: list[str] = []
        self._open: list[Element] = []
        self._count = 0

    def parse(self, content: bytes) -> None:
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.EntityDeclHandler = self._entity
        parser.Parse(content, True)

    @staticmethod
    def _entity(*_: Any) -> None:
        raise _RefusedError("it declares XML entities, which are not read; save it as plain SVG")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > _MOST_ELEMENTS:
            raise _RefusedError(f"it has more than {_MOST_ELEMENTS} elements; delete what is not part of the face")
        if len(self._open) >= _DEEPEST:
            raise _RefusedError(f"its elements are nested deeper than {_DEEPEST}; ungroup them")
        uri, _, local = name.rpartition(" ")
        element = Element(local if uri in {"", _SVG} else name, attributes)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)
        if "id" in attributes:
            self.by_id.setdefault(attributes["id"], element)

    def _end(self, _name: str) -> None:
        self._open.pop()

    def _text(self, text: str) -> None:
        if self._open and self._open[-1].tag == "style":
            self.sheets.append(text)


def _classes(sheet: str) -> dict[str, dict[str, str]]:
    """Return the declarations of a style ``sheet`` by class; other selectors are left out."""
    found: dict[str, dict[str, str]] = {}
    for selectors, body in _RULE.findall(sheet[:1_000_000]):
        for selector in selectors.split(","):
            match = _CLASS.search(selector.strip())
            if match:
                found.setdefault(match[1], {}).update(declarations(body))
    return found
