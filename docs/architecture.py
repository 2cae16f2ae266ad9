"""Check how the modules import each other, and draw the rooms of scanweld.

``python docs/architecture.py`` writes ``docs/architecture.svg``. It exits with 1, and one line for
each, where modules or rooms import each other in a circle, or a room imports one that does not
stand below it. The sources are parsed and never imported.
"""

import ast
import html
import sys
from collections.abc import Collection, Mapping
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "architecture.svg"

LAYERS = (
    ("__main__",),
    ("app",),
    ("__init__",),
    ("pipeline",),
    ("confidence", "knowledge"),
    ("graph", "published", "reconstruction"),
    ("sensor",),
    ("pairs", "fusion", "evaluation", "video"),
    ("evidence", "heat", "refinement", "preparation", "cut", "io"),
    ("contours", "work"),
    ("geometry", "config"),
    ("errors", "choices", "compiled"),
)
"""The rooms, from the top to the bottom. A room imports from the layers below its own alone."""

Graph = Mapping[str, set[str]]


def module_graph(folder: Path, package: str, *, scripts: bool = False) -> dict[str, set[str]]:
    """Which modules of a folder import which others of it, wherever in the file they do so.

    Args:
        folder: The folder that holds the modules, in subfolders too.
        package: The name under which the folder is imported.
        scripts: Whether its files are run as scripts too, which import those beside them by
            their bare names.

    Returns:
        For each module its dotted name and those it imports. A package stands for its
        ``__init__``; that importing a module runs the ``__init__`` above it is not counted.
    """
    files = {module_name(path, folder, package): path for path in sorted(folder.rglob("*.py"))}
    graph: dict[str, set[str]] = {}
    for name, path in files.items():
        found = _imports(name, path, files.keys())
        if scripts:
            beside = name.rpartition(".")[0]
            found |= {f"{beside}.{source}" for source in found}
        graph[name] = {source for source in found if source in files and source != name}
    return graph


def module_name(path: Path, folder: Path, package: str) -> str:
    """The dotted name of a file below a folder that is imported as ``package``."""
    parts = path.relative_to(folder).with_suffix("").parts
    return ".".join((package, *(parts[:-1] if parts[-1] == "__init__" else parts)))


def _imports(name: str, path: Path, known: Collection[str]) -> set[str]:
    """All modules that a file imports; of ``from a import b`` it is a.b if that is a known one."""
    found: set[str] = set()
    above = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = above[: len(above) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                found.add(inner if inner in known else source)
    return found


def room_graph(modules: Graph, package: str = "scanweld") -> dict[str, set[str]]:
    """Which rooms import which others: a room is a subpackage, or a module beside them."""
    rooms: dict[str, set[str]] = {}
    for name, targets in modules.items():
        room = _room(name, package)
        rooms.setdefault(room, set()).update(_room(target, package) for target in targets)
    return {room: targets - {room} for room, targets in rooms.items()}


def _room(name: str, package: str) -> str:
    return "__init__" if name == package else name.split(".")[1]


def circles(graph: Graph) -> list[list[str]]:
    """A shortest circle through each group of nodes that reach one another, first node repeated."""
    found: list[list[str]] = []
    seen: set[str] = set()
    for node in sorted(graph):
        circle = [] if node in seen else _shortest_circle(graph, node)
        if circle:
            seen |= {other for other in reached(graph, node) if node in reached(graph, other)}
            found.append(circle)
    return found


def _shortest_circle(graph: Graph, start: str) -> list[str]:
    paths = [[start]]
    seen: set[str] = set()
    for path in paths:  # grows as it is read: breadth first
        for target in sorted(graph.get(path[-1], ())):
            if target == start:
                return [*path, start]
            if target not in seen:
                seen.add(target)
                paths.append([*path, target])
    return []


def reached(graph: Graph, start: str) -> set[str]:
    """All nodes that some path of at least one arrow leads to."""
    found: set[str] = set()
    open_nodes = [start]
    while open_nodes:
        new = graph.get(open_nodes.pop(), set()) - found
        found |= new
        open_nodes.extend(new)
    return found


def not_downward(rooms: Graph) -> list[tuple[str, str]]:
    """Arrows between rooms that do not lead from a layer to one below it."""
    level = _levels()
    return [
        (room, target)
        for room in sorted(rooms)
        for target in sorted(rooms[room])
        if room in level and target in level and level[room] >= level[target]
    ]


def _levels() -> dict[str, int]:
    return {room: level for level, layer in enumerate(LAYERS) for room in layer}


def complaints(modules: Graph, package: str = "scanweld") -> list[str]:
    """What is wrong with the imports of the package, one line each; empty if all is well."""
    rooms = room_graph(modules, package)
    placed = {room for layer in LAYERS for room in layer}
    return [
        *(f"circle of modules: {' -> '.join(circle)}" for circle in circles(modules)),
        *(f"circle of rooms: {' -> '.join(circle)}" for circle in circles(rooms)),
        *(f"arrow that leads to no lower layer: {a} -> {b}" for a, b in not_downward(rooms)),
        *(
            f"room in no layer of docs/architecture.py: {room}"
            for room in sorted(set(rooms) - placed)
        ),
        *(f"layers name a room that is not there: {room}" for room in sorted(placed - set(rooms))),
    ]


def without_shortcuts(graph: Graph) -> dict[str, list[str]]:
    """The graph less the arrows that a longer path stands for (its transitive reduction)."""
    return {
        node: sorted(
            target
            for target in targets
            if not any(target in reached(graph, other) for other in targets - {target})
        )
        for node, targets in graph.items()
    }


# The picture. An arrow over several layers passes through a narrow place in each layer between.

BOX, PLACE, GAP = 118, 14, 16  # widths of a room, of a passing arrow, and between two of either
HIGH, STEP, MARGIN = 34, 92, 24  # height of a room, from layer to layer, and around the picture
SWEEPS = 24


def picture(rooms: Graph) -> str:
    """The rooms in their layers, with the arrows that no longer path stands for, as SVG."""
    level = _levels()
    rows: list[list[str]] = [list(layer) for layer in LAYERS]
    chains: list[list[str]] = []
    for room, targets in sorted(without_shortcuts(rooms).items()):
        for target in targets:
            places = [f"{room}>{target}@{k}" for k in range(level[room] + 1, level[target])]
            for k, place in enumerate(places, start=level[room] + 1):
                rows[k].append(place)
            chains.append([room, *places, target])
    _untangle(rows, chains)
    return _svg(rows, chains, _straightened(rows, chains))


def _neighbours(chains: list[list[str]]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for chain in chains:
        for a, b in pairwise(chain):
            found.setdefault(a, []).append(b)
            found.setdefault(b, []).append(a)
    return found


def _untangle(rows: list[list[str]], chains: list[list[str]]) -> None:
    """Order each row by the mean place of its neighbours, again and again; keep the best order."""
    neighbours = _neighbours(chains)
    best, fewest = [list(row) for row in rows], _crossings(rows, chains)
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 else reversed(rows):
            at = {n: (k + 0.5) / len(other) for other in rows for k, n in enumerate(other)}
            row.sort(key=lambda n: _mean([at[m] for m in neighbours.get(n, [n])]))
        crossings = _crossings(rows, chains)
        if crossings < fewest:
            best, fewest = [list(row) for row in rows], crossings
    rows[:] = best


def _crossings(rows: list[list[str]], chains: list[list[str]]) -> int:
    at = {n: (k, place) for k, row in enumerate(rows) for place, n in enumerate(row)}
    lines = [(*at[a], at[b][1]) for chain in chains for a, b in pairwise(chain)]
    return sum(
        k == other_k and (a - other_a) * (b - other_b) < 0
        for n, (k, a, b) in enumerate(lines)
        for other_k, other_a, other_b in lines[:n]
    )


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _width(node: str) -> int:
    return PLACE if "@" in node else BOX


def _straightened(rows: list[list[str]], chains: list[list[str]]) -> dict[str, float]:
    """The x of each node's middle: near those of its neighbours, as far as the row has room."""
    neighbours = _neighbours(chains)
    x = {n: 0.0 for row in rows for n in row}
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 else reversed(rows):
            wished = [_mean([x[m] for m in neighbours.get(n, [n])]) for n in row]
            for node, place in zip(row, _apart(row, wished), strict=True):
                x[node] = place
    left = min(place - _width(node) / 2 for node, place in x.items())
    return {node: place - left + MARGIN for node, place in x.items()}


def _apart(row: list[str], wished: list[float]) -> list[float]:
    """Places in the given order and without overlap, as near to the wished ones as can be."""
    offsets = [0.0]
    for a, b in pairwise(row):
        offsets.append(offsets[-1] + (_width(a) + _width(b)) / 2 + GAP)
    blocks: list[list[float]] = []
    for wish, offset in zip(wished, offsets, strict=True):
        blocks.append([wish - offset])
        while len(blocks) > 1 and _mean(blocks[-2]) > _mean(blocks[-1]):
            last = blocks.pop()
            blocks[-1] = blocks[-1] + last
    shifts = [_mean(block) for block in blocks for _ in block]
    return [shift + offset for shift, offset in zip(shifts, offsets, strict=True)]


def _svg(rows: list[list[str]], chains: list[list[str]], x: dict[str, float]) -> str:
    y = {node: MARGIN + HIGH / 2 + STEP * k for k, row in enumerate(rows) for node in row}
    width = max(place + _width(node) / 2 for node, place in x.items()) + MARGIN
    height = 2 * MARGIN + HIGH + STEP * (len(rows) - 1)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}"'
        f' width="{width:.0f}" height="{height:.0f}" font-family="sans-serif" font-size="14">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7"'
        ' markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="#5b6b7a"/></marker></defs>',
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for chain in chains:
        title = html.escape(f"{chain[0]} imports {chain[-1]}")
        lines.append(
            f'<path d="{_curve(chain, x, y)}" fill="none" stroke="#5b6b7a" stroke-width="1.3"'
            f' marker-end="url(#tip)"><title>{title}</title></path>'
        )
    lines += [_box(node, x[node], y[node]) for row in rows for node in row if "@" not in node]
    return "\n".join([*lines, "</svg>", ""])


def _curve(chain: list[str], x: dict[str, float], y: dict[str, float]) -> str:
    """From the lower edge of a room to the upper edge of the other, upright in between."""
    stops = [(x[chain[0]], y[chain[0]] + HIGH / 2)]
    for place in chain[1:-1]:
        stops += [(x[place], y[place] - HIGH / 2), (x[place], y[place] + HIGH / 2)]
    stops.append((x[chain[-1]], y[chain[-1]] - HIGH / 2))
    path = f"M{stops[0][0]:.0f} {stops[0][1]:.0f}"
    for (x0, y0), (x1, y1) in pairwise(stops):
        middle = (y0 + y1) / 2
        path += f"C{x0:.0f} {middle:.0f} {x1:.0f} {middle:.0f} {x1:.0f} {y1:.0f}"
    return path


def _box(room: str, x: float, y: float) -> str:
    name = html.escape({"__init__": "scanweld", "__main__": "python -m"}.get(room, room))
    is_folder = (ROOT / "src" / "scanweld" / room).is_dir()
    fill, border = ("#e4eefb", "#2f6db5") if is_folder else ("#f4f4f4", "#8a8a8a")
    return (
        f'<rect x="{x - BOX / 2:.0f}" y="{y - HIGH / 2:.0f}" width="{BOX}" height="{HIGH}" rx="6"'
        f' fill="{fill}" stroke="{border}"/><text x="{x:.0f}" y="{y + 5:.0f}"'
        f' text-anchor="middle" fill="#1b2733">{name}</text>'
    )


def main() -> int:
    """Check the imports of the package and draw its rooms; 1 if something is wrong with them."""
    modules = module_graph(ROOT / "src" / "scanweld", "scanweld")
    wrong = complaints(modules)
    for line in wrong:
        print(line, file=sys.stderr)
    if wrong:
        return 1
    PICTURE.write_text(picture(room_graph(modules)), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
