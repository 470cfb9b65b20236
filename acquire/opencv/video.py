"""Video files as a camera: ``video:test.mp4?gray=luma``. Frames come as fast as they are fetched.

Times are those of the container; what compression did to the picture cannot be undone. A codec that makes a picture of
earlier ones holds back what moves a little (``controls["inter_frame"]``).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address, expanded
from acquire.camera import CameraBase
from acquire.cv2_loader import load_cv2
from acquire.errors import DataError
from acquire.events import EventSink, device_event
from acquire.files.headers import quantisation
from acquire.files.picture import GRAYS, WEBCAM_WARNING, check_regular, is_utf8, to_gray
from acquire.frame import QUANTISATION, CameraInfo, Frame, frozen
from acquire.opencv.fields import rows_apart
from acquire.settings import choice, number, read_settings, setting, whole
from acquire.text import Message

INTRA = {
    "", "mjpg", "jpeg", "mjpa", "mjpb", "avrn", "mjp2", "mj2c", "ffv1", "ffvh", "hfyu", "lags", "magy", "ulrg", "ulra",
    "uly0", "uly2", "uly4", "mpng", "png", "dib", "raw", "rgba", "bgra", "i420", "iyuv", "yv12", "yuy2", "uyvy", "y800",
    "grey", "gray", "y16", "v210", "apcn", "apch", "apcs", "apco", "ap4h", "ap4x", "avdn", "avdh", "cfhd", "dvsd",
}  # fmt: skip
"""Codecs, by their code in small letters, each of whose pictures stands alone; H.264, VP9 and all others do not."""
FILM_WARNING = Message("compressed film: strain may be 10 % low; record MJPG, FFV1 or pictures")
_AS_JPEG = ("mjpg", "jpeg", "mjpa", "avrn")
# Of 255, between the planes of a picture in the mean; a codec shifts those of a grey one less.
_COLOURED = 8.0
_HEAD = 1 << 20  # bytes, with the tables of the first picture
_COUNTED = ((0, b"RIFF"), (4, b"ftyp"))  # containers with the number of frames; others have but a duration
_ROWS_EVERY, _ROWS_APART_PX = 4, 0.05  # pictures of which one is looked at; motion that is torn
_MOST_COUNTED = 50_000_000  # bytes that are read through to count frames


@dataclass(frozen=True, slots=True)
class VideoSettings:
    """Settings of ``video:test.mp4``."""

    gray: str | None = setting(choice(*GRAYS), None, "what is grey in a colour picture")
    fps: float | None = setting(
        number(1e-6, 1e6), None, "of the camera, where the film is played slower", "1/s"
    )
    first: int = setting(whole(1), 1, "number of the first picture; those before it are left out")


class VideoFile(CameraBase):
    """A video file as a camera that waits for its reader; see ``acquire.camera.Camera``.

    Raises
    ------
    DataError
        Missing, no regular file, not a video, or with a name that OpenCV cannot take.
    """

    def __init__(self, address: str, path: Path, settings: VideoSettings, on_event: EventSink) -> None:
        super().__init__()
        cv2 = load_cv2()

        if not path.exists():
            raise DataError("{address}: there is no file {path}", address, path)
        check_regular(path)
        if not is_utf8(path):
            raise DataError("{path}: OpenCV opens a video by its name, which must be UTF-8; rename it", path)
        with path.open("rb") as file:
            self._head = file.read(_HEAD)
        self._address, self._path, self._settings, self._on_event = address, path, settings, on_event
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise DataError(
                "{path}: not a video that can be read, or cut off; try to play or convert it", path
            )
        self._promised, self._torn = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0
        self._fps = settings.fps or self._capture.get(cv2.CAP_PROP_FPS) or 25.0
        code = _fourcc(int(self._capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF)
        inter_frame = code.lower() not in INTRA
        table = quantisation(self._head) if code.lower() in _AS_JPEG else None
        count = self._count()
        if count is not None and count < settings.first:
            raise DataError(
                "{path}: has {count} pictures, none with number {first}", path, count, settings.first
            )
        frames = None if count is None else count - settings.first + 1
        steps: dict[str, Any] = {QUANTISATION: table} if table else {}
        self.info = CameraInfo(
            address=address,
            name=path.name,
            width=int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            height=int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
            bits=8,
            live=False,
            clock="nominal",
            fps=self._fps,
            pixel_format=code,
            controls={"gray": settings.gray or "luma", "frames": frames, "inter_frame": inter_frame} | steps,
            warnings=tuple(
                [FILM_WARNING] * inter_frame
                + [WEBCAM_WARNING] * (not self._is_grey(cv2))
                + [*self._depth(cv2)]
            ),
        )

    def __iter__(self) -> Iterator[Frame]:
        cv2 = load_cv2()

        index, t, longest, place = 0, 0.0, 1.0, 0.0
        before = sum(self._capture.grab() for _ in range(self._settings.first - 1))
        while not self.stopped.is_set():
            well, picture = self._capture.read()
            if not well:
                self._report_if_short(before + index, int(place + longest))
                return
            former, place = place, self._capture.get(getattr(cv2, "CAP_PROP_PTS", -1))
            longest = max(longest, place - former) if index else longest
            stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
            if self._settings.fps:
                t = index / self._fps
            else:
                t = stamp if stamp > t or index == 0 else t + 1 / self._fps
            image = self._grey(picture, index)
            if index % _ROWS_EVERY == 1:
                self._look_at_rows(image, index)
            yield Frame(frozen(image), index, t, "nominal", 0, 8, stamp)
            index += 1

    def _is_grey(self, cv2: Any) -> bool:
        """Whether the film itself is grey, by the code of FFmpeg for its samples: Y800, and Y1 with more bits."""
        code = _fourcc(int(self._capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) & 0xFFFFFFFF)
        return code.startswith(("Y8", "Y1")) or code.endswith("1Y")

    def _depth(self, cv2: Any) -> Iterator[str]:
        """What OpenCV leaves of samples with more than 8 bits, by the code of FFmpeg for their format."""
        code = int(self._capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) & 0xFFFFFFFF
        # The bits are the last byte of the code, or the first: by the order of the bytes of a sample.
        ends = () if _fourcc(code)[:3] in ("RGB", "BGR") else (code & 0xFF, code >> 24)
        for bits in (one for one in ends if 8 < one <= 16):
            yield Message(
                "film of {bits} bits, read as 8: noise and strain are coarser; give it as pictures", bits
            )

    def _grey(self, picture: NDArray[Any], index: int) -> NDArray[Any]:
        image = to_gray(picture, self._settings.gray or "luma", str(self._path))
        if index == 0 and self._settings.gray is None and picture.ndim == 3:
            spread = float(np.ptp(picture[:, :, :3], axis=2).mean())
            if spread > _COLOURED:
                text = Message(
                    "{path}: red, green and blue differ by {spread:.0f} of 255; grey is their luma; gray=g takes one",
                    self._path,
                    spread,
                )
                device_event(self._on_event, self._address, text)
        if image.shape != (self.info.height, self.info.width):
            raise DataError("{path}: frame {index} is of another size than the first", self._path, index)
        return image

    def _look_at_rows(self, image: NDArray[Any], index: int) -> None:
        """A warning, once, where odd and even rows are apart in two of the pictures that are looked at."""
        if (apart := rows_apart(image)) <= _ROWS_APART_PX:
            return
        self._torn += 1
        if self._torn == 2:
            text = Message(
                "{path}: interlaced: odd and even rows are {apart:.2f} px apart in picture {number}; what moves is "
                "torn, take one field alone",
                self._path,
                apart,
                index + self._settings.first,
            )
            device_event(self._on_event, self._address, text)

    def _count(self) -> int | None:
        """Frames of the file; None where only their number times their duration is known, and it is large."""
        if any(self._head[at:].startswith(word) for at, word in _COUNTED):
            return self._promised
        if self._path.stat().st_size > _MOST_COUNTED:
            return None
        cv2 = load_cv2()
        capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        return next(k for k in itertools.count() if not capture.grab())

    def _report_if_short(self, count: int, reached: int) -> None:
        """A warning where the film ends before its duration: ``reached`` of the frames that this would have."""
        if max(count, reached) < self._promised:
            text = Message(
                "{path}: ends after {count} of {promised} frames; it may be cut off",
                self._path,
                count,
                self._promised,
            )
            device_event(self._on_event, self._address, text, missing=self._promised - count)

    def _release(self) -> None:
        self._capture.release()


def _fourcc(code: int) -> str:
    return code.to_bytes(4, "little", signed=False).decode("latin-1").strip("\0 ")


def open_video(address: Address, on_event: EventSink) -> VideoFile:
    """Open ``video:test.mp4``; ``VideoSettings`` are its settings.

    Raises
    ------
    ConfigError, DataError
        See ``acquire.camera.open_camera``.
    """
    settings = read_settings(VideoSettings, address)
    return VideoFile(address.text, expanded(address.target), settings, on_event)
