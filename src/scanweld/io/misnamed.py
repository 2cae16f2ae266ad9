"""Files that are not what their names say: told by how they begin, with what to call them."""

from pathlib import Path

from scanweld.io.names import is_gzipped
from scanweld.io.scan_formats.registry import format_of, formats_by_suffix
from scanweld.io.text import is_number
from scanweld.io.text_encoding import UTF_16
from scanweld.io.unpack import GZIP

_OTHERS = (
    ((GZIP,), "is packed by gzip", "add .gz to its name"),
    ((b"pk\3\4",), "is a ZIP archive", "unpack it"),
    ((b"bzh", b"\xfd7zxz", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf", b"rar!"), "is packed", "unpack it"),
    ((b"version https://git-lfs",), "is a pointer of Git LFS", "fetch the file by git lfs pull"),
    ((b"<!doctype html", b"<html"), "is a web page", "download the file again"),
    ((b"\xff\xd8\xff", b"\x89png", b"%pdf"), "is a picture or a document", "leave it out"),
)
"""How files begin (in small letters) that are called wrong, what they are, and what to do."""


def what_it_is(path: Path, begin: bytes) -> str:
    """What a file is and what to do, if that is not what its name says; empty if it may be that.

    Args:
        path: The file.
        begin: Its first bytes.
    """
    own = format_of(path)
    if own is not None and begin.startswith(own.begins):
        return ""
    if is_gzipped(path) and begin.startswith(GZIP):
        return "is packed twice; unpack it once"
    if own is not formats_by_suffix()[".xyz"] and begin.startswith(UTF_16):
        return "is text in UTF-16; save it as UTF-8"
    for begins, what, remedy in _OTHERS:
        if begin.lstrip().lower().startswith(begins):
            return f"{what}; {remedy}"
    for suffix, form in formats_by_suffix().items():
        if form is not own and begin.startswith(form.begins):
            return f"is {suffix[1:].upper()} by its content; call it {suffix}"
    words = begin.partition(b"\n")[0].split()
    if len(words) >= 3 and all(map(is_number, words)) and own is not formats_by_suffix()[".xyz"]:
        return "begins with numbers as text; call it .xyz"
    return ""
