"""The two VTK formats of a run: one binary `.vtu` per output time and the `.pvd` that lists them.

`.vtu` is VTK's XML UnstructuredGrid with raw appended data: arrays are zlib streams behind a UInt64 header,
little endian. ParaView, VisIt, pyvista and meshio read it; so do the few lines of `read_vtu`.
Format: VTK User's Guide, "XML file formats".
"""

from __future__ import annotations

import re
import struct
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.errors import InputError, MpmError
from mpm.files import write_atomically, write_in_place
from mpm.labels import from_xml_attribute, xml_attribute
from mpm.output.deflate import fast

VTK_QUAD = 9
CLOSING = "</Collection>\n</VTKFile>\n"
PAGE = 4096  # bytes that a system writes at once, or more
MESH = ("Points", "connectivity", "offsets", "types")
VTK_TYPE = {"float32": "Float32", "float64": "Float64", "int32": "Int32", "uint8": "UInt8"}


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Contents of one `.vtu`: `points` (n, 3) [m], `quads` (cells, 4), `cell_data` by name, `time` [s]."""

    points: NDArray[np.float64]
    quads: NDArray[np.int32]
    cell_data: dict[str, NDArray[np.generic]]
    time: float

    @property
    def centres(self) -> NDArray[np.float64]:
        """Cell centres (cells, 2) [m]."""
        return self.points[self.quads, :2].mean(axis=1)


def grid_points(
    x: ArrayLike, y: ArrayLike, displacement: Sequence[float] = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Points of a rectangular grid, row by row from the bottom, shape ((rows + 1) (columns + 1), 3)."""
    xx, yy = np.meshgrid(np.asarray(x) + displacement[0], np.asarray(y) + displacement[1])
    return np.column_stack([xx.ravel(), yy.ravel(), np.zeros(xx.size)])


def grid_quads(columns: int, rows: int) -> NDArray[np.int32]:
    """Corners of the cells, row by row from the bottom, in VTK's order (counter-clockwise), shape (cells, 4)."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int32), columns)
    first = row * (columns + 1) + column
    return np.column_stack([first, first + 1, first + columns + 2, first + columns + 1]).astype(np.int32)


def encode_vtu(
    points: NDArray[np.float64],
    quads: NDArray[np.int32],
    cell_data: Mapping[str, ArrayLike],
    time: float,
    precision: str = "Float32",
    packer: Packer | None = None,
) -> bytes:
    """The bytes of a `.vtu` file; one `packer` for many times compresses what stays the same only once.

    `cell_data` holds arrays of shape (cells,), or (cells, 2) and (cells, 3) for vectors (padded to three components);
    integers are stored as Int32, real numbers in `precision` (Float32 or Float64), coordinates always as Float64.
    """
    packer = packer or Packer()
    blocks: list[bytes] = []
    offset = 0

    def array(name: str, values: NDArray[np.generic]) -> str:
        nonlocal offset
        whole = np.issubdtype(values.dtype, np.integer)
        block = packer.block(name, np.ascontiguousarray(values), lasting=whole)
        components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        kind = VTK_TYPE[values.dtype.name]
        line = f'<DataArray type="{kind}" Name={xml_attribute(name)}{components} format="appended" offset="{offset}"/>\n'
        blocks.append(block)
        offset += len(block)
        return line

    cells = len(quads)
    real = np.dtype(precision.lower())
    mesh = (
        "<Points>\n" + array("Points", points) + "</Points>\n<Cells>\n"
        + array("connectivity", quads.ravel())
        + array("offsets", np.arange(4, 4 * cells + 1, 4, dtype=np.int32))
        + array("types", np.full(cells, VTK_QUAD, dtype=np.uint8)) + "</Cells>\n"
    )  # fmt: skip
    fields = "".join(array(name, cell_array(name, values, cells, real)) for name, values in cell_data.items())
    head = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"'
        ' compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
        '<FieldData>\n<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">'
        f"{time!r}</DataArray>\n</FieldData>\n"
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{cells}">\n{mesh}'
        f"<CellData>\n{fields}</CellData>\n</Piece>\n</UnstructuredGrid>\n"
        '<AppendedData encoding="raw">\n_'
    )
    return head.encode() + b"".join(blocks) + b"\n</AppendedData>\n</VTKFile>\n"


def cell_array(name: str, values: ArrayLike, cells: int, real: np.dtype[np.generic]) -> NDArray[np.generic]:
    """Check the shape, choose the stored type, pad vectors to three components."""
    found = np.asarray(values)
    if found.shape[:1] != (cells,) or found.ndim > 2 or (found.ndim == 2 and found.shape[1] not in (2, 3)):
        raise MpmError(f"field {name}: shape {found.shape} where ({cells},) or ({cells}, 2) is needed")
    found = found.astype(np.int32 if np.issubdtype(found.dtype, np.integer) else real, copy=False)
    if found.ndim == 2 and found.shape[1] == 2:
        found = np.column_stack([found, np.zeros(cells, dtype=found.dtype)])
    return found


class Packer:
    """Compresses arrays and remembers the last block of each name: mesh and mean flow are the same from time to time."""

    def __init__(self) -> None:
        # array if nobody can change it, its bytes, which are compared in a thirtieth of the time that a digest takes, and block
        self._last: dict[str, tuple[NDArray[np.generic] | None, bytes, bytes]] = {}

    def block(self, name: str, values: NDArray[np.generic], lasting: bool = False) -> bytes:
        """vtkZLibDataCompressor's layout with a single block: [blocks, block size, last partial size, compressed size] + data.

        What is `lasting`, as the numbers of corners, is compressed once and copied into every file: by zlib, a third smaller.
        """
        last, before, block = self._last.get(name, (None, b"", b""))
        if last is not None and (last.nbytes, last.ctypes.data) == (values.nbytes, values.ctypes.data):
            return block
        raw = values.tobytes()
        if before != raw or not block:
            packed = zlib.compress(raw, 1) if lasting else fast.compress(raw, 1)
            block = struct.pack("<4Q", 1, len(raw), 0, len(packed)) + packed
        self._last[name] = values if fixed(values) else None, raw, block
        return block


def fixed(values: NDArray[np.generic]) -> bool:
    """Whether nobody can change an array: neither it nor what it is a view of is writeable."""
    part: Any = values
    while isinstance(part, np.ndarray):
        if part.flags.writeable:
            return False
        part = part.base
    return part is None


class Unpacker:
    """The inverse of a Packer: what is the same as in the file before is unpacked once, and its array, which nobody can change, shared."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[bytes, NDArray[np.generic]]] = {}  # packed bytes, and array

    def array(self, name: str, packed: bytes, dtype: str) -> NDArray[np.generic]:
        """Values (n,) from packed bytes. Raises `fast.error`, and ValueError for bytes that are no whole numbers."""
        if name not in self._last or self._last[name][0] != packed or self._last[name][1].dtype != dtype:
            self._last[name] = packed, np.frombuffer(fast.decompress(packed), dtype=dtype)
        return self._last[name][1]


def read_vtu(
    path: str | Path, unpacker: Unpacker | None = None, wanted: Collection[str] | None = None
) -> Snapshot:
    """Read a file written by `encode_vtu` (this reader knows no other variant of the format); one `unpacker` for many times.

    Of the cells' data all, or those that are `wanted` and there.
    """
    unpacker = unpacker or Unpacker()
    content = Path(path).read_bytes()
    head, _, appended = content.partition(b'<AppendedData encoding="raw">\n_')
    if not appended.endswith(b"</VTKFile>\n"):
        raise InputError(f"{path}: not a whole .vtu file written by mpm")
    arrays: dict[str, NDArray[np.generic]] = {}
    pattern = r'<DataArray type="(\w+)" Name="([^"]+)"(?: NumberOfComponents="(\d)")? format="appended" offset="(\d+)"/>'
    try:
        for kind, name, components, offset in re.findall(pattern, head.decode()):
            known = from_xml_attribute(name)
            if wanted is not None and known not in wanted and known not in MESH:
                continue
            start = int(offset)
            (_, _, _, size) = struct.unpack_from("<4Q", appended, start)
            values = unpacker.array(name, appended[start + 32 : start + 32 + size], kind.lower())
            arrays[known] = values.reshape(-1, int(components)) if components else values
        found = re.search(rb'Name="TimeValue"[^>]*>([^<]+)<', head)
        points, quads = arrays.pop("Points"), arrays.pop("connectivity").reshape(-1, 4)
        del arrays["offsets"], arrays["types"]
        time = float(found[1]) if found else float("nan")
    except (fast.error, struct.error, KeyError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not a whole .vtu file written by mpm ({error})") from error
    return Snapshot(points.astype(np.float64), quads.astype(np.int32), arrays, time)


def encode_pvd(steps: Sequence[tuple[float, str]]) -> str:
    """The text of a `.pvd`: time [s] and path, relative to the `.pvd`, of every step."""
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n<Collection>\n'
        + "".join(dataset(time, name) for time, name in steps)
        + CLOSING
    )


def dataset(time: float, name: str) -> str:
    """The line of one step in a `.pvd`."""
    return f'<DataSet timestep="{time!r}" group="" part="0" file={xml_attribute(name)}/>\n'


def add_to_pvd(path: Path, steps: Sequence[tuple[float, str]]) -> None:
    """List the last of `steps` in the `.pvd` that lists those before it, at a cost that does not grow with their number.

    The entry goes over the closing tags, which follow it. A kill can come between two pages of a write, so where that would cross the
    border of one the file is replaced as a whole: it is valid XML at any moment.
    """
    tail = (dataset(*steps[-1]) + CLOSING).encode()
    start = path.stat().st_size - len(CLOSING) if path.exists() and len(steps) > 1 else 0
    if start <= 0 or start // PAGE != (start + len(tail) - 1) // PAGE:
        write_atomically(path, encode_pvd(steps))
    else:
        write_in_place(path, tail, start)


def read_pvd(path: str | Path) -> list[tuple[float, Path]]:
    """Time [s] and path of every step that a `.pvd` lists, in its order; empty when there is no such file."""
    path = Path(path)
    if not path.exists():
        return []
    try:
        entries = ElementTree.parse(path).getroot().iter("DataSet")
        return [(float(entry.attrib["timestep"]), path.parent / entry.attrib["file"]) for entry in entries]
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not a readable .pvd file ({error})") from error
