"""A reader of VTK's XML image data with appended raw data, strictly by the specification.

https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

TYPES = {"Float32": "f4", "Float64": "f8", "UInt8": "u1", "Int64": "i8"}


@dataclass(frozen=True, slots=True, eq=False)
class Vti:
    """The content of a file."""

    extent: list[int]
    origin: list[float]
    spacing: list[float]
    points: dict[str, np.ndarray]
    facts: dict[str, np.ndarray]


def read(path: Path) -> Vti:
    head, rest = path.read_bytes().split(b'<AppendedData encoding="raw">\n_', 1)
    raw, tail = rest[: rest.rindex(b"\n</AppendedData>")], rest[rest.rindex(b"\n</AppendedData>") :]
    root = ElementTree.fromstring(head + b"<AppendedData>" + tail)
    assert root.attrib["type"] == "ImageData"
    assert root.attrib["header_type"] == "UInt64"
    order = {"LittleEndian": "<", "BigEndian": ">"}[root.attrib["byte_order"]]
    image = root.find("ImageData")
    assert image is not None
    (piece,) = image.findall("Piece")
    extent = [int(word) for word in image.attrib["WholeExtent"].split()]
    assert piece.attrib["Extent"] == image.attrib["WholeExtent"]
    n = int(np.prod([extent[i + 1] - extent[i] + 1 for i in (0, 2, 4)]))
    used: list[tuple[int, int]] = []

    def array(element: ElementTree.Element, tuples: int) -> np.ndarray:
        assert element.attrib["format"] == "appended"
        offset, width = int(element.attrib["offset"]), int(element.attrib.get("NumberOfComponents", "1"))
        size = int(np.frombuffer(raw, f"{order}u8", 1, offset)[0])
        kind = np.dtype(order + TYPES[element.attrib["type"]])
        assert size == tuples * width * kind.itemsize
        used.append((offset, offset + 8 + size))
        values = np.frombuffer(raw, kind, tuples * width, offset + 8)
        return values if width == 1 else values.reshape(tuples, width)

    points = {e.attrib["Name"]: array(e, n) for e in piece.findall("PointData/DataArray")}
    facts = {
        e.attrib["Name"]: array(e, int(e.attrib["NumberOfTuples"]))
        for e in image.findall("FieldData/DataArray")
    }
    used.sort()
    assert [start for start, _ in used] == [0, *(end for _, end in used[:-1])], "gaps or overlaps"
    assert used[-1][1] == len(raw)
    numbers = {k: [float(w) for w in image.attrib[k].split()] for k in ("Origin", "Spacing")}
    assert re.match(rb'<\?xml version="1.0"\?>', head)
    return Vti(extent, numbers["Origin"], numbers["Spacing"], points, facts)
