"""Links, anchors, paths and names on the pages exist, and the page of the architecture lists every module."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from faceposer.animation import trajectory_io
from faceposer.evaluation import study
from faceposer.interchange import weights_json
from faceposer.model import character_file
from faceposer.photo import pins_file
from faceposer.poses import pose_file
from faceposer.session import autosave, document, key_folder
from faceposer.sketch import strokes_file
from faceposer.transfer import pairs

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "assets" / "README.md"])
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
#: Names of file formats, which look like modules.
FORMATS = {
    *(module.FORMAT for module in (autosave, document, key_folder, pairs, pins_file, pose_file, study, character_file)),
    *(module.FORMAT for module in (strokes_file, trajectory_io, weights_json)),
    "faceposer.marker-map",
}

_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_PATH = re.compile(r"`((?:[\w-]+/)+[\w-]+\.(?:py|yml|toml|sh|mjs|md))`")
_DOTTED = re.compile(r"(?<![\w./-])faceposer(?:\.\w[\w-]*)+")
_FILE = re.compile(r"[\w]+\.py|[\w]+/")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def prose(name: str) -> Iterator[str]:
    """Yield the lines of a page outside its blocks of code."""
    fenced = False
    for line in text_of(name).splitlines():
        fenced ^= line.startswith("```")
        if not fenced and not line.startswith("    "):
            yield line


def anchors(name: str) -> set[str]:
    """Return the anchors of the headings of a page, as the code host makes them."""
    found = set()
    for line in prose(name):
        if line.startswith("#"):
            title = line.lstrip("#").strip().lower()
            found.add(re.sub(r"[^\w\- ]", "", title).replace(" ", "-"))
    return found


def leads_somewhere(target: str, name: str) -> bool:
    """Whether a link of page ``name`` leads to a file of the repository and, with an anchor, to a heading of it."""
    path, _, anchor = target.partition("#")
    file = ((ROOT / name).parent / path if path else ROOT / name).resolve()
    if not file.is_relative_to(ROOT) or not file.exists():
        return False
    return not anchor or anchor in anchors(file.relative_to(ROOT).as_posix())


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name: str) -> None:
    targets = {target for line in prose(name) for target in _LINK.findall(line)}
    inside = {target for target in targets if not re.match(r"\w+:", target)}
    assert sorted(target for target in inside if not leads_somewhere(target, name)) == []


@pytest.mark.parametrize("name", NAMES)
def test_files_that_are_named_exist(name: str) -> None:
    """A page names a file from the root, or inside the package from there."""
    text = text_of(name)
    named = set(_PATH.findall(text))
    assert sorted(path for path in named if not any((ROOT / f / path).exists() for f in ("", "faceposer"))) == []


@pytest.mark.parametrize("name", [name for name in NAMES if name != "CHANGELOG.md"])
def test_names_of_the_package_exist(name: str) -> None:
    wrong = []
    for dotted in set(_DOTTED.findall(text_of(name))) - FORMATS:
        parts = dotted.split(".")
        found = None
        for end in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:end]))
            except ImportError:
                continue
            break
        for part in parts[end:]:
            found = getattr(found, part, None)
        if found is None:
            wrong.append(dotted)
    assert wrong == []


def tree() -> Iterator[str]:
    """Yield the files of the package that the page of the architecture lists, from the root."""
    block = text_of("docs/architecture.md").split("## Folders", 1)[1].split("```")[1]
    folders: list[str] = []
    for line in block.strip("\n").splitlines():
        depth = (len(line) - len(line.lstrip())) // 2
        words = re.split(r" {2,}", line.strip())[0].split()
        if depth > 8 or not all(_FILE.fullmatch(word) for word in words):
            continue
        folders = folders[:depth]
        yield from ("".join(folders) + word for word in words if word.endswith(".py"))
        if words[0].endswith("/"):
            folders.append(words[0])


def test_the_architecture_lists_every_module_and_no_other() -> None:
    listed = list(tree())
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "faceposer").rglob("*.py")}
    modules = {path for path in modules if not path.endswith("__init__.py")}
    assert len(listed) == len(set(listed))
    assert sorted(modules - set(listed)) == []
    assert sorted(set(listed) - modules) == []


def test_the_site_has_every_page() -> None:
    """As MkDocs checks, too, where it is installed."""
    listed = set(re.findall(r": ([\w/-]+\.md)$", text_of("mkdocs.yml"), re.MULTILINE))
    pages = {page.relative_to(ROOT / "docs").as_posix() for page in (ROOT / "docs").rglob("*.md")}
    assert pages <= listed
    hooks = text_of("scripts/docs_hooks.py")
    assert all(f'"{page}"' in hooks for page in listed - pages), "pages that lie outside docs/"


def test_the_readme_begins_with_the_commands_and_a_small_animation() -> None:
    """Both are on the first screen, and the animation loads quickly."""
    first_screen = text_of("README.md").splitlines()[:12]
    assert any("scripts/run" in line for line in first_screen)
    assert any("scripts/test" in line for line in first_screen)
    (image,) = [found[1] for line in first_screen if (found := _LINK.search(line))]
    with Image.open(ROOT / image) as animation:
        assert getattr(animation, "n_frames", 1) > 50
    assert (ROOT / image).stat().st_size < 2_000_000
