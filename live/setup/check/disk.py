"""How long the disk lasts for the recording of a test, from the pictures of a check."""

from __future__ import annotations

import math

from acquire.burst import sum_kind
from acquire.hdf5 import free_bytes
from acquire.record_mode import RecordMode
from acquire.text import Message
from live.config.cameras import other_cameras
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST
from live.setup.check.check_line import CheckLine
from live.setup.check.sample import FrameStack

SHORTEST_S = 600.0
"""Of a test whose length is not given."""


def write_rate(stack: FrameStack, config: Config) -> float:
    """What the recording of these pictures writes, bytes/s: at the rate at which they came, in the recorder's form.

    The parts of further cameras are taken to be the same. 0 where nothing is recorded, or the pictures are not live.
    """
    camera, m = stack.camera, config.measure
    if not (config.record.enabled and camera.live):
        return 0.0
    span_s = float(stack.times[-1] - stack.times[0])
    fps = (len(stack) - 1) / span_s if span_s > 0 else camera.fps or 0.0
    mode, burst = RecordMode.parse(config.record.mode), m.burst or DEFAULT_BURST
    size = stack.frames.itemsize / mode.every
    if mode.kind == "bursts":
        size = (
            sum_kind(camera.bits, burst).itemsize + 1 / 8
        ) / burst  # the sum, and a bit for clipped pixels
    return camera.width * camera.height * size * fps * (1 + len(other_cameras(config)))


def disk_lines(rate: float, config: Config) -> list[CheckLine]:
    """The line of the disk for a recording of ``rate`` (``write_rate``); none where nothing is recorded."""
    if not rate:
        return []
    wanted_s, folder = config.output.seconds or SHORTEST_S, config.output.dir or "runs"
    try:
        free = free_bytes(folder)
    except OSError as error:
        words = Message("connect the disk, or choose another with --out")
        return [
            CheckLine(
                "disk",
                Message("{folder}: cannot be asked ({strerror})", folder, error),
                False,
                words,
            )
        ]
    minutes = math.floor(10 * free / rate / 60) / 10  # not more than there is
    return [
        CheckLine(
            "disk",
            Message(
                "room for {minutes:.4g} min at this rate ({rate:.3g} MB/s, {free:.3g} GB free)",
                minutes,
                rate / 1e6,
                free / 1000000000.0,
            ),
            free / rate >= wanted_s,
            Message(
                "too little for a test of {wanted_s:.3g} min: free some space, choose another disk with --out, or "
                "record less (--record bursts)",
                wanted_s / 60,
            ),
        )
    ]
