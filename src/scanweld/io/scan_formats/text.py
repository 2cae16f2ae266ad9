"""Points as text, a line each, with intensity, normals or colours in further columns."""

from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.xyz import read_xyz

FORMAT = ScanFormat(
    suffixes=(".xyz", ".pts", ".asc", ".txt", ".csv"),
    read=read_xyz,
    keeps=(Keeps.NORMALS, Keeps.COLORS),
    only_named=(".txt", ".csv"),
)
