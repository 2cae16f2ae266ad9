"""Options that take two names and can be repeated, which typer does not know."""

from collections.abc import Sequence

from scanweld.errors import KnowledgeError

OPTIONS = ("--together", "--apart")
_SEPARATOR = "\n"


def with_pairs_joined(arguments: Sequence[str]) -> list[str]:
    """The arguments, the two names after such an option joined to one."""
    joined, left = list[str](), list(arguments)
    while left:
        word = left.pop(0)
        joined.append(word)
        if word == "--":
            return joined + left
        names = left[:2]
        if word in OPTIONS and len(names) == 2 and not any(n.startswith("-") for n in names):
            joined.append(_SEPARATOR.join(names))
            del left[:2]
    return joined


def named_pairs(option: str, joined: Sequence[str] | None) -> tuple[tuple[str, str], ...]:
    """The pairs of names of an option.

    Raises:
        KnowledgeError: If one name was given instead of two.
    """
    pairs = []
    for names in joined or ():
        first, separator, second = names.partition(_SEPARATOR)
        if not separator:
            raise KnowledgeError(f"{option} takes the names of two scans, not just {first}")
        pairs.append((first, second))
    return tuple(pairs)
