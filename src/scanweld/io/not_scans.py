"""Files that lie among scans and are none, and what to export instead."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import some_of
from scanweld.io.names import natural_key, printable, suffix_of


@dataclass(frozen=True, kw_only=True, slots=True)
class Foreign:
    """A kind of file that holds scans or objects, but not in a way that scanweld reads.

    Attributes:
        suffixes: In lower case.
        title: What it is.
        remedy: What to do, in the imperative.
    """

    suffixes: tuple[str, ...]
    title: str
    remedy: str


def _foreign(suffixes: str, title: str, remedy: str) -> Foreign:
    return Foreign(suffixes=tuple(suffixes.split()), title=title, remedy=remedy)


FOREIGN = (
    _foreign(".fls .fws .lsproj", "FARO SCENE", "export PTX or E57 from SCENE"),
    _foreign(".zfs .zfprj", "Zoller + Froehlich", "export PTX or E57 from LaserControl"),
    _foreign(".rcp .rcs", "Autodesk ReCap", "export E57 or PTS from ReCap"),
    _foreign(".imp .lgs .lgsx .ptg", "Leica", "export PTX or E57 from Cyclone or REGISTER 360"),
    _foreign(".rxp .rdbx .rdb", "RIEGL", "export E57 or LAS from RiSCAN PRO"),
    _foreign(".tzf .tzs", "Trimble", "export E57 from RealWorks"),
    _foreign(".cl3 .clr", "Topcon", "export PTX or E57 from ScanMaster or MAGNET"),
    _foreign(".pod", "Bentley Pointools", "export PTS or XYZ"),
    _foreign(".g3d", "GOM / ZEISS", "export PLY or STL, one file for each measurement"),
    _foreign(".sproj", "Artec Studio", "export PLY or OBJ, one file for each scan"),
    _foreign(".bin", "CloudCompare, or unknown", "save each cloud as PLY"),
    _foreign(".bag .db3 .mcap", "a recording of ROS or RealSense", "export depth images or PLY"),
    _foreign(".mkv", "a recording of Azure Kinect, or a film", "export depth images or PLY"),
    _foreign(".oni .svo .svo2", "a recording of OpenNI or ZED", "export depth images or PLY"),
    _foreign(".r3d", "a recording of Record3D", "export PLY from the app, one file for each frame"),
    _foreign(".3mf .fbx .dae .usdz .usd", "an object for printing or film", "export PLY or OBJ"),
    _foreign(".gltf", "glTF in several files", "export PLY, OBJ or GLB"),
    _foreign(".blend .max .3ds .ma .mb .c4d", "a scene of a 3D program", "export PLY or OBJ"),
    _foreign(".step .stp .iges .igs .sldprt .x_t", "CAD", "export STL or OBJ for simulate"),
    _foreign(".dxf .dwg .wrl .x3d", "a drawing or a scene", "export PLY or OBJ"),
    _foreign(".vtp .vtu .vts .vti .vtr", "XML of VTK", "save it as legacy VTK or PLY"),
    _foreign(".splat .ksplat .spz .drc", "packed splats or meshes", "export PLY"),
    _foreign(".zip .7z .rar .tar .tgz .bz2 .xz .zst", "an archive", "unpack it"),
)
"""One line for each kind of file; docs/formats.md has the same table."""


def foreign_kind(path: Path) -> Foreign | None:
    """What kind of file it is, if that is known to be none that can be read."""
    suffix = suffix_of(path)
    return next((kind for kind in FOREIGN if suffix in kind.suffixes), None)


def why_unread(path: Path, known: Iterable[str]) -> str:
    """Why a file that was named cannot be read, and what to do.

    Args:
        path: The file.
        known: Suffixes of what can be.
    """
    kind = foreign_kind(path)
    if kind is None:
        return f"{path}: unknown format; scanweld reads {', '.join(known)}"
    return f"{path}: is a format that scanweld does not read ({kind.title}); {kind.remedy}"


def inventory(paths: Sequence[Path], only_named: frozenset[str]) -> str:
    """What lies in a folder besides scans, in words; empty if that is nothing but hidden files.

    Args:
        paths: What is no scan.
        only_named: Suffixes of files that are taken for scans when they are named.
    """
    groups: dict[str, list[Path]] = {}
    for path in sorted(paths, key=lambda path: natural_key(path.name)):
        if not path.name.startswith("."):
            suffix = suffix_of(path) or path.name
            kind = "folders" if path.is_dir() and foreign_kind(path) is None else suffix
            groups.setdefault(kind, []).append(path)
    # What might have been meant comes first.
    told = sorted(groups, key=lambda kind: foreign_kind(groups[kind][0]) is None)
    words = [_words(kind, groups[kind], only_named) for kind in told]
    return some_of(words)


def _words(kind: str, paths: Sequence[Path], only_named: frozenset[str]) -> str:
    one = len(paths) == 1
    files = printable(paths[0].name) if one else f"{len(paths)} {kind}"
    if kind == "folders":
        return f"{files}/ (name it, too)" if one else f"{files} (name them, too)"
    if kind in only_named:
        return f"{files} ({'name it if that is a scan' if one else 'name them if those are scans'})"
    foreign = foreign_kind(paths[0])
    return files if foreign is None else f"{files} ({foreign.title}: {foreign.remedy})"
