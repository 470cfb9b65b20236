"""Maps over the pictures of a test, as pictures of numbers, and as grids with fields.

``png``, ``mp4`` (``.webm`` by the name of --out), ``gif``: a map over the pictures of the test.

``tiff``: one map at all instants as a stack of 32-bit floats, with the units that ImageJ reads. tifffile writes the
TIFF of ImageJ: units and notes in its description, and time and force as the label of each slice in private tags. For
other readers the pages are plain; a ZOI without a value is NaN.

``vtk``: a ``.vti`` an instant and a ``.pvd`` with their times, for ParaView and other readers of VTK. XML image data
with appended raw data (VTK File Formats, https://docs.vtk.org/en/latest/vtk_file_formats/): the points are the centres
of the ZOIs. Values are arrays of the points; ``displacement`` is the vector to warp by; time and force are in the field
data. VTK's y axis points up: without ``--y-up`` a map is upside down.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded, load_cv2
from acquire.errors import ConfigError, DataError
from acquire.text import Message
from live.config.new_files import new_file, new_folder
from live.results.export.job import ExportJob
from live.results.maps.painting import Levels, Painter, caption
from live.results.maps.scale import ColourScale
from live.results.place_response import response_title
from live.results.stored_fields import Pictures

# Codec of the encoders in OpenCV's wheel, and the programs that do not play it.
_CODECS = {
    ".mp4": ("mp4v", "MPEG-4 part 2: web browsers do not play it; give --to gif or --out NAME.webm for them"),
    ".webm": (
        "VP90",
        "VP9: old versions of QuickTime and PowerPoint do not play it; give --out NAME.mp4 for them",
    ),
}

MAX_GIF_BYTES = 8_000_000
_MIN_GIF_PX = 120  # smaller pictures show nothing


_MAX_BYTES = 2**32 - 2**20

_TYPES = {"f4": "Float32", "f8": "Float64", "u1": "UInt8", "i8": "Int64"}
_ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
_HEAD = '<?xml version="1.0"?>\n<VTKFile type="{}" version="1.0" byte_order="{}" header_type="UInt64">\n'


def write_png(job: ExportJob, path: Path) -> None:
    """A folder with one picture an instant."""
    with new_folder(path) as folder:
        for k, image in _frames(job):
            (folder / f"{job.fields[0]}_{k:05d}.png").write_bytes(encoded(".png", image))


def write_mp4(job: ExportJob, path: Path) -> None:
    """A film, ``fps`` instants a second.

    Raises
    ------
    ConfigError
        Another suffix than .mp4 and .webm.
    DataError
        No such encoder in this OpenCV.
    """
    if path.suffix not in _CODECS:
        raise ConfigError("{path}: a film is .mp4 or .webm; choose another --out", path)
    code, remark = _CODECS[path.suffix]
    cv2 = load_cv2()
    with new_file(path) as part:
        writer = None
        try:
            for _, image in _frames(job):
                if writer is None:
                    size = (image.shape[1], image.shape[0])
                    four = cv2.VideoWriter_fourcc(*code)
                    writer = cv2.VideoWriter(str(part), cv2.CAP_FFMPEG, four, job.options.fps, size)
                    if not writer.isOpened():
                        raise DataError(
                            "{path}: this OpenCV has no encoder for {code}; give --to gif or --to png",
                            path,
                            code,
                        )
                writer.write(image)
        finally:
            if writer is not None:
                writer.release()
        if not part.exists():
            raise DataError("{path}: the encoder wrote nothing; is the disk full?", path)
    job.screen.print(remark)


def write_gif(job: ExportJob, path: Path) -> None:
    """A film that every program shows; 256 colours, at most 640 px and 8 MB: smaller pictures where it would be larger.

    Raises
    ------
    ConfigError
        Pillow is not installed.
    """
    try:
        from PIL import Image as Pillow
    except ImportError:
        raise ConfigError(
            "--to gif needs Pillow: pip install 'phasedic[export]'; --to mp4 does without"
        ) from None
    with new_file(path) as part:
        images = [Pillow.fromarray(image[..., ::-1].copy()) for _, image in _frames(job, 640)]
        content = _gif(images, 1000 / job.options.fps)
        while len(content) > MAX_GIF_BYTES and min(images[0].size) > _MIN_GIF_PX:
            share = max(0.5, 0.95 * (MAX_GIF_BYTES / len(content)) ** 0.5)
            images = [image.resize([round(share * side) for side in image.size]) for image in images]
            content = _gif(images, 1000 / job.options.fps)
        part.write_bytes(content)


def _gif(images: Sequence[Any], duration_ms: float) -> bytes:
    """The film of these pictures, each for ``duration_ms``."""
    first, *rest = (image.quantize() for image in images)
    file = io.BytesIO()
    first.save(file, "GIF", save_all=True, append_images=rest, duration=round(duration_ms), loop=0)
    return file.getvalue()


def _frames(job: ExportJob, longest: int = 1280) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """(k, BGR image) of each instant."""
    (name,) = job.fields
    pictures = job.run.pictures if job.options.picture else None
    if pictures is None and job.options.picture:
        job.screen.print(Message("the pictures are not here any more; maps are painted on plain grey"))
    scale = None
    if name != "status":
        display = job.display
        scale = ColourScale.of_run(
            job.strain, name, job.rows, job.options.limit, display.unit(name), display.factor(name)
        )
    painter = Painter(job.strain, name, scale, job.run.picture_size, longest)
    levels: Levels | None = None
    with closing(_images(job, pictures)) as images:
        for k, row in job.steps():
            picture = next(images)
            if picture is not None and levels is None:
                levels = Levels.of(picture)
            image = painter.over(painter.picture(picture, levels), row)
            title = response_title(job.strain, name) or caption(job.strain, row)
            yield k, painter.framed(image, [title], row)


def _images(job: ExportJob, pictures: Pictures | None) -> Generator[Any]:
    if pictures is not None:
        yield from pictures.each(job.rows)
    while True:
        yield None


def write_tiff(job: ExportJob, path: Path) -> None:
    """The stack of ``job.fields[0]``.

    Raises
    ------
    ConfigError
        tifffile is not installed, or more than the 4 GB that ImageJ's format can address.
    """
    try:
        import tifffile
    except ImportError:
        raise ConfigError("--to tiff needs tifffile: pip install 'phasedic[export]'") from None
    (name,) = job.fields
    height, width = job.strain.grid.shape
    n = len(job.rows)
    if n * (4 * height * width + 256) > _MAX_BYTES:
        raise ConfigError(
            "--to tiff: {n} maps of {width} x {height} are more than 4 GB; give --from and --until",
            n,
            width,
            height,
        )
    per_unit = 1 / job.display.step(job.strain.grid)  # pixels of the map, which are ZOIs
    with new_file(path) as part, part.open("xb") as file:
        tifffile.imwrite(
            file,
            _maps(job, name),
            shape=(n, height, width),
            dtype=np.float32,
            imagej=True,
            resolution=(per_unit, per_unit),
            metadata=_metadata(job, name),
        )


def _maps(job: ExportJob, name: str) -> Iterator[NDArray[np.float32]]:
    for _, row in job.steps():
        yield np.asarray(job.map(name, row), np.float32)


def _metadata(job: ExportJob, name: str) -> dict[str, Any]:
    """The keys that ImageJ reads, then the notes."""
    unit = job.display.unit("x").replace("px", "pixel")
    times = job.strain.time_s[list(job.rows)]
    interval = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    step = job.display.step(job.strain.grid)
    notes = [*job.notes(), job.display.definition(name)]
    return {
        "axes": "TYX", "unit": unit, "finterval": f"{interval:.9g}", "loop": False,
        "xorigin": f"{-job.display.x(job.strain.grid)[0] / step:.9g}",
        "yorigin": f"{-job.display.y(job.strain.grid)[0] / step:.9g}",
        "vunit": job.display.unit(name) or "1", "Labels": _labels(job),
        **{f"note{k}": _plain(note) for k, note in enumerate(notes)},
    }  # fmt: skip


def _plain(text: str) -> str:
    """One line of ASCII, which the description of a TIFF must be."""
    return " ".join(text.split()).encode("ascii", "replace").decode()


def _labels(job: ExportJob) -> list[str]:
    forces = job.strain.values["force_N"]
    return [
        f"{job.strain.time_s[row]:.4f} s" + (f", {forces[row]:.2f} N" if np.isfinite(forces[row]) else "")
        for row in job.rows
    ]


def write_vtk(job: ExportJob, path: Path) -> None:
    """A folder with ``strain.pvd`` and ``strain_00000.vti`` and so on."""
    with new_folder(path) as folder:
        lines = []
        for k, row in job.steps():
            name = f"strain_{k:05d}.vti"
            (folder / name).write_bytes(image(job, row))
            time = float(job.strain.time_s[row])
            lines.append(f'<DataSet timestep="{time:.10g}" part="0" file={quoteattr(name)}/>\n')
        head = _HEAD.format("Collection", _ORDER) + _comment(job)
        (folder / "strain.pvd").write_text(
            f"{head}<Collection>\n{''.join(lines)}</Collection>\n</VTKFile>\n", encoding="utf-8"
        )


def image(job: ExportJob, row: int) -> bytes:
    """The file of one instant."""
    grid, display = job.strain.grid, job.display
    # VTK counts rows upwards: with y up, the last row of ZOIs comes first.
    y = np.sort(display.y(grid))
    appended = _Appended()
    extent = f"0 {grid.shape[1] - 1} 0 {grid.shape[0] - 1} 0 0"
    step = f"{display.step(grid):.10g}"
    origin = f"{display.x(grid)[0]:.10g} {y[0]:.10g} 0"
    values = job.strain.values
    known = {"TimeValue": values["time_s"][row], display.column("force_N"): values["force_N"][row]}
    facts = "".join(appended.add(name, np.array([value]), facts=True) for name, value in known.items())
    points = "".join(appended.add(name, data) for name, data in _points(job, row).items())
    text = (
        f"{_HEAD.format('ImageData', _ORDER)}{_comment(job)}"
        f'<ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="{step} {step} 1">\n'
        f"<FieldData>\n{facts}</FieldData>\n"
        f'<Piece Extent="{extent}">\n<PointData>\n{points}</PointData>\n<CellData/>\n</Piece>\n</ImageData>\n'
        '<AppendedData encoding="raw">\n_'
    )
    return text.encode() + appended.data() + b"\n</AppendedData>\n</VTKFile>\n"


def _points(job: ExportJob, row: int) -> Mapping[str, NDArray[Any]]:
    flip = slice(None, None, -1 if job.display.y_up else 1)
    found = {job.display.column(name): job.map(name, row)[flip].ravel() for name in job.fields}
    u, v = (job.map(name, row)[flip].ravel() for name in ("u", "v"))
    found[f"displacement_{job.display.unit('u')}"] = np.stack([u, v, np.zeros_like(u)], axis=1)
    return found


class _Appended:
    """The raw data at the end of a file, and the offsets into it."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, name: str, values: NDArray[Any], *, facts: bool = False) -> str:
        """Append an array, (N,) or (N, components); returns the element that names it."""
        data = np.ascontiguousarray(values)
        kind = _TYPES[data.dtype.str[1:]]
        size = f' NumberOfTuples="{len(data)}"' if facts else ""
        parts = f' NumberOfComponents="{data.shape[1]}"' if data.ndim == 2 else ""
        element = (
            f'<DataArray type="{kind}" Name={quoteattr(name)}{parts}{size} format="appended"'
            f' offset="{self._length}"/>\n'
        )
        for part in (np.uint64(data.nbytes).tobytes(), data.tobytes()):
            self._parts.append(part)
            self._length += len(part)
        return element

    def data(self) -> bytes:
        """The raw data."""
        return b"".join(self._parts)


def _comment(job: ExportJob) -> str:
    lines = [*job.notes(), *(job.display.definition(name) for name in job.fields)]
    return "<!--\n" + escape("\n".join(lines)).replace("--", "- -") + "\n-->\n"
