"""A map over the pictures of the test: ``png``, ``mp4`` (``.webm`` by the name of --out), ``gif``."""

from __future__ import annotations

import io
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded, load_cv2
from acquire.errors import ConfigError, DataError

# Codec of the encoders in OpenCV's wheel, and the programs that do not play it.
from acquire.text import Message
from live.config.new_files import new_file, new_folder
from live.results.export.job import ExportJob
from live.results.maps.painting import Levels, Painter, caption
from live.results.maps.scale import ColourScale
from live.results.response.evaluate import response_title
from live.results.stored_fields import Pictures

_CODECS = {
    ".mp4": ("mp4v", "MPEG-4 part 2: web browsers do not play it; give --to gif or --out NAME.webm for them"),
    ".webm": (
        "VP90",
        "VP9: old versions of QuickTime and PowerPoint do not play it; give --out NAME.mp4 for them",
    ),
}

MAX_GIF_BYTES = 8_000_000
_MIN_GIF_PX = 120  # smaller pictures show nothing


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
