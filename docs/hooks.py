"""Hooks of mkdocs: pages of the repository's root, links to sources, and formulas.

In the repository a page links to ``../src/scanweld/config.py``, and readers can follow that there.
The site has no sources, so that the same link would lead nowhere. There it is plain code. Formulas
become MathML, which browsers show without any script.
"""

import html
import logging
import re
from pathlib import Path, PurePosixPath
from posixpath import normpath

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

logger = logging.getLogger("mkdocs.hooks")  # a warning there makes a strict build fail

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s#]+)(#[^)\s]*)?\)")
PICTURE = re.compile(r"(!\[[^\]]*\]\()docs/")
FORMULA = re.compile(
    r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>',
    re.DOTALL,
)
ROOT_PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
"""Pages in the root of the repository, and what they are called on the site."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root; pictures and pages below ``docs/`` stand beside them."""
    for name, place in ROOT_PAGES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, place, content=_as_site_page(text)))
    return files


def _as_site_page(text: str) -> str:
    def moved(link: re.Match[str]) -> str:
        title, target, heading = link[1], link[2], link[3] or ""
        inside = target.removeprefix("docs/")
        if "://" in target:
            return link[0]
        return f"[{title}]({inside if inside != target else f'../{target}'}{heading})"

    return PICTURE.sub(r"\1", LINK.sub(moved, text))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace links to files of the repository that are not on the site."""
    folder = PurePosixPath("docs") / PurePosixPath(page.file.src_uri).parent

    def shown(link: re.Match[str]) -> str:
        text, target = link[1], link[2]
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        path = normpath(str(folder / target))
        if path in ROOT_PAGES:
            up = "../" * (len(folder.parts) - 1)
            return f"[{text}]({up}{ROOT_PAGES[path]}{link[3] or ''})"
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


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn the formulas of a page from LaTeX to MathML."""

    def shown(formula: re.Match[str]) -> str:
        display = "block" if formula[2] == "[" else "inline"
        latex = html.unescape(formula[3]).replace(r"\arg\min", r"\mathrm{arg}\min")
        mathml = convert(latex, display=display)
        if "\\" in mathml:
            logger.warning("%s: a formula cannot be shown: %s", page.file.src_uri, latex)
        return mathml

    return FORMULA.sub(shown, content)
