"""Hooks of MkDocs (mkdocs.yml): pages from files outside docs/, and links to files that are not pages.

The same links work on the code host, where a page is a file of the repository.
"""

import logging
import os
import re
from pathlib import Path
from urllib.parse import urlsplit

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
#: Files outside docs/ that are pages of the site, and the names of these pages.
PAGES = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "assets/README.md": "assets.md",
}
#: The page that replaces the README: the home page of the site has the same beginning.
HOME = {"README.md": "index.md"}

_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"^(```|    \S)")
_log = logging.getLogger("mkdocs.hooks.links")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from files outside docs/."""
    for source, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Redirect links of ``markdown`` to files outside docs/ to pages of the site or to the code host."""
    sources = {target: ROOT / source for source, target in PAGES.items()}
    source = sources.get(page.file.src_uri, DOCS / page.file.src_uri)

    def link(match: re.Match[str]) -> str:
        return _rewritten(match, source, page.file.src_uri, config.repo_url)

    fenced, lines = False, []
    for line in markdown.split("\n"):
        fenced ^= line.startswith("```")
        lines.append(line if fenced or _FENCE.match(line) else _LINK.sub(link, line))
    return "\n".join(lines)


def _rewritten(match: re.Match[str], source: Path, page: str, repository: str | None) -> str:
    text, target = match.groups()
    parts = urlsplit(target)
    if parts.scheme or parts.netloc or not parts.path:
        return match.group()
    path = Path(os.path.normpath(source.parent / parts.path))
    if not path.exists():
        _log.warning("'%s' links to '%s', which does not exist", source.relative_to(ROOT), target)
        return match.group()
    if path.is_relative_to(DOCS):
        to = path.relative_to(DOCS).as_posix()
    else:
        outside = path.relative_to(ROOT).as_posix()
        found = (PAGES | HOME).get(outside)
        if found is None:
            return f"[{text}]({repository.rstrip('/')}/blob/main/{outside})" if repository else text
        to = found
    start = os.path.relpath(to, Path(page).parent)
    return f"[{text}]({Path(start).as_posix()}{'#' + parts.fragment if parts.fragment else ''})"
