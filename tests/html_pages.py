"""Report pages, taken apart for tests."""

from html.parser import HTMLParser

VOID = {"meta", "link", "img", "br", "input", "hr", "col"}


class Page(HTMLParser):
    """Elements with their attributes and text; refuses tags that are not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, str] = {}
        self.words: list[str] = []
        self._open: list[str] = []
        self._id = ""
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {key: value or "" for key, value in attrs}
        self.elements.append((tag, found))
        self._id = found.get("id", "")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {key: value or "" for key, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open and self._open.pop() == tag, f"</{tag}> at {self.getpos()}"

    def handle_data(self, data: str) -> None:
        if self._id:
            self.text[self._id] = self.text.get(self._id, "") + data
        if self._open and self._open[-1] not in ("script", "style"):
            self.words.append(data)

    def values(self) -> set[str]:
        """All exact numbers that stand beside those that are shown."""
        return {found["data-value"] for _, found in self.elements if "data-value" in found}
