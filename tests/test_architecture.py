"""The house keeps its shape: arrows run downward, nothing imports in a circle, calls stay short."""

import ast
from pathlib import Path

import pytest

from docs import architecture
from docs.architecture import LAYERS, circles, complaints, module_graph, not_downward, room_graph

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "scanweld"
MAX_PARAMETERS = 7
MAX_ROOT_MODULES = 8


def test_imports_lead_downward_and_in_no_circle():
    assert complaints(module_graph(SOURCE, "scanweld")) == []
    for folder in ("benchmarks", "examples"):
        assert circles(module_graph(ROOT / folder, folder, scripts=True)) == []


def test_few_modules_stand_in_the_root_and_functions_take_few_parameters():
    assert len(list(SOURCE.glob("*.py"))) <= MAX_ROOT_MODULES
    assert _long_calls(SOURCE) == []


def test_the_picture_is_that_of_the_imports_and_the_page_names_every_room():
    made = architecture.picture(room_graph(module_graph(SOURCE, "scanweld")))
    committed = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    assert committed == made, "run python docs/architecture.py"
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    folders = {path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists()}
    assert {room for room in folders if f"`{room}`" not in page} == set()


# What the checks themselves find.


def test_imports_are_found_in_every_form(tmp_path: Path):
    _write(tmp_path, "__init__.py", "from pkg.low import one as one")
    _write(tmp_path, "low/__init__.py", "from .one import f")
    _write(tmp_path, "low/one.py", "import os\nfrom . import two")
    _write(tmp_path, "low/two.py", "def f():\n    import pkg.high.top")
    _write(tmp_path, "high/top.py", "from ..low.one import f\nfrom pkg import low")
    assert module_graph(tmp_path, "pkg") == {
        "pkg": {"pkg.low.one"},
        "pkg.low": {"pkg.low.one"},
        "pkg.low.one": {"pkg.low.two"},
        "pkg.low.two": {"pkg.high.top"},
        "pkg.high.top": {"pkg.low.one", "pkg.low"},
    }


def test_circles_and_arrows_upward_and_sideways_are_told_once(tmp_path: Path):
    graph = {"a": {"b"}, "b": {"c", "d"}, "c": {"d"}, "d": {"b"}, "e": {"f"}, "f": {"e", "a"}}
    assert circles(graph) == [["b", "d", "b"], ["e", "f", "e"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
    rooms = {"geometry": {"io", "errors"}, "heat": {"evidence"}, "pairs": {"heat"}}
    assert not_downward(rooms) == [("geometry", "io"), ("heat", "evidence")]
    _write(tmp_path, "run.py", "from sets import a\nimport os")
    _write(tmp_path, "sets.py", "import pkg.run")
    scripts = module_graph(tmp_path, "pkg", scripts=True)
    assert scripts == {"pkg.run": {"pkg.sets"}, "pkg.sets": {"pkg.run"}}
    assert module_graph(tmp_path, "pkg")["pkg.run"] == set()


def test_rooms_without_a_layer_are_told():
    modules = {f"scanweld.{room}": set() for layer in LAYERS for room in layer}
    modules["scanweld"] = modules.pop("scanweld.__init__")
    assert complaints(modules) == []
    modules["scanweld.attic.box"] = modules.pop("scanweld.heat")
    assert complaints(modules) == [
        "room in no layer of docs/architecture.py: attic",
        "layers name a room that is not there: heat",
    ]


def test_complaints_end_the_command_and_leave_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    _write(tmp_path, "src/scanweld/geometry/a.py", "from scanweld.app import b")
    _write(tmp_path, "src/scanweld/app/b.py", "")
    monkeypatch.setattr(architecture, "ROOT", tmp_path)
    monkeypatch.setattr(architecture, "PICTURE", tmp_path / "picture.svg")
    assert architecture.main() == 1
    assert "arrow that leads to no lower layer: geometry -> app" in capsys.readouterr().err
    assert not (tmp_path / "picture.svg").exists()


def test_parameters_are_counted_without_self_and_kernels(tmp_path: Path):
    names = ", ".join("abcdefg")
    _write(
        tmp_path,
        "module.py",
        f"@njit(cache=True)\ndef kernel({names}, h): pass\n"
        f"def short({names}): pass\n"
        f"def long({names}, *, h): pass\n"
        f"class Thing:\n    def short(self, {names}): pass\n    def long(self, {names}, h): pass\n",
    )
    assert _long_calls(tmp_path) == ["module.py: long", "module.py: long"]


def _long_calls(folder: Path) -> list[str]:
    """Functions outside kernels with too many parameters, as ``file: function``."""
    return [
        f"{path.relative_to(folder).as_posix()}: {node.name}"
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and not _is_kernel(node)
        and _num_parameters(node) > MAX_PARAMETERS
    ]


def _is_kernel(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)


def _num_parameters(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    taken = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return sum(argument.arg not in ("self", "cls") for argument in taken)


def _write(folder: Path, name: str, text: str) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
