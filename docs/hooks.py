"""Hooks of mkdocs: the README is the home page, and links to sources become plain code.

In the repository a page links to ``../src/scanweld/config.py``, and readers can follow that there.
The site has no sources, so that the same link would lead nowhere.
"""

import re
from pathlib import Path, PurePosixPath
from posixpath import normpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s#]+)(#[^)\s]*)?\)")
PICTURE = re.compile(r"(!\[[^\]]*\]\()docs/")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Make the README the home page; pictures and pages below ``docs/`` stand beside it."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    files.append(File.generated(config, "index.md", content=_as_home_page(text)))
    return files


def _as_home_page(readme: str) -> str:
    def moved(link: re.Match[str]) -> str:
        text, target, heading = link[1], link[2], link[3] or ""
        inside = target.removeprefix("docs/")
        return f"[{text}]({inside if inside != target else f'../{target}'}{heading})"

    return PICTURE.sub(r"\1", LINK.sub(moved, readme))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace links to files of the repository that are not on the site."""
    folder = PurePosixPath("docs") / PurePosixPath(page.file.src_uri).parent

    def shown(link: re.Match[str]) -> str:
        text, target = link[1], link[2]
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        path = normpath(str(folder / target))
        if path == "README.md":
            return f"[{text}]({'../' * (len(folder.parts) - 1)}index.md{link[3] or ''})"
        inside = path.removeprefix("docs/")
        if inside != path and files.get_file_from_path(inside):
            return link[0]
        if not (ROOT / path).exists():
            return link[0]  # mkdocs says that it leads nowhere
        return _as_code(text, path)

    return LINK.sub(shown, markdown)


def _as_code(text: str, path: str) -> str:
    """The text of the link, with the path behind it where the text does not name it."""
    bare = text.strip("`")
    if bare == path or path.endswith(f"/{bare}"):
        return f"`{path}`"
    return f"{text} (`{path}`)"
