"""The sections of the configuration: each key with its check, its default, its meaning and its option."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from live.config.values import (
    AUTO,
    BOX,
    FLAG,
    GIVEN,
    LISTEN_ADDRESS,
    NAMES,
    RECORD_MODE,
    REGION,
    STRAINS,
    TEXT,
    Option,
    choice,
    integer,
    key,
    length,
    number,
)

DEFAULT_BURST, DEFAULT_REFERENCE_BURST = 4, 32
"""Frames of a live camera; of files, 1."""


# One key of the file per line: check, default, meaning, and its option on the command line.
# fmt: off

@dataclass(frozen=True, slots=True)
class CameraConfig:
    """[camera]"""

    address: str = key(TEXT, "", "address of the camera: /dev/video0?format=Y12&fps=30, sim:, files:...",
        Option("camera", "ADDRESS"))
    crop: tuple[int, int, int, int] | None = key(BOX, None,
        "x, y, width, height of the part that is used; coordinates count from it", Option("crop", "X,Y,W,H"))
    dark: str | None = key(TEXT, None, "dark frame (TIFF) that is taken off every burst", Option("dark", "FILE"))
    flat: str | None = key(TEXT, None, "flat frame (TIFF) that every burst is divided by", Option("flat", "FILE"))


@dataclass(frozen=True, slots=True)
class LoadConfig:
    """[load]"""

    address: str = key(TEXT, "none:", "address of the load cell: /dev/ttyUSB0?protocol=ascii, sim:, none:",
        Option("load", "ADDRESS"))
    max_gap_s: float = key(number(0.001, 3600), 0.5, "samples further apart than this leave a gap, s")
    lag_s: float = key(number(-10, 10), 0.0,
        "the load is stamped this much later than the frames it belongs to, s; as the summary tells it",
        Option("lag", "S"))


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """[measure]"""

    roi: tuple[int, int, int, int] | str | None = key(REGION, None,
        "x, y, width, height of the measured region, px; auto: the specimen that is found (the default);"
        " all: all but a rim",
        Option("roi", "X,Y,W,H|auto|all"))
    zoi: int = key(length(integer(8, 1024), whole=True), 64, "side of a ZOI, px", Option("zoi", "PX"))
    step: int = key(length(integer(1, 1024), whole=True), 16, "distance of neighbouring ZOIs, px",
        Option("step", "PX"))
    burst: int | None = key(integer(1, 10000), None, "frames averaged for one measurement (live 4, else 1)",
        Option("burst", "N"))
    reference_burst: int | None = key(integer(1, 10000), None, "frames averaged for the reference (live 32, else 1)",
        Option("reference-burst", "N"))
    mask: str | None = key(TEXT, None, "image; ZOIs where it is black are not measured", Option("mask", "FILE"))
    gauges: str = key(choice(GIVEN, AUTO), GIVEN,
        "gauges: as given, or auto: axial, transverse and area on the specimen", Option("gauges"))
    window: str = key(choice("gaussian", "uniform", "tukey", "bi-triangular"), "gaussian",
        "least-squares weight of a ZOI", Option("window", "NAME"))
    estimator: str = key(choice("spectral", "phase"), "spectral", "spectral, or phase alone",
        Option("estimator", "NAME"))
    order: int = key(integer(1, 2), 1, "order of the shape of a ZOI: 1 is affine", Option("order", "N"))
    strain: str = key(choice("engineering", "small", "green", "hencky"), "engineering",
        "measure of strain: engineering (elongation over length, as an extensometer reads it), small, green or hencky",
        Option("strain", "MEASURE"))
    bending_px: float = key(number(0, math.inf), 0.05,
        "a ZOI in which the displacement jumps or bends by more is UNEVEN; inf never", Option("bending", "PX"))
    noise_GL: float | None = key(number(0, 65535), None,
        "noise of one frame in grey levels; without, as the reference burst tells it", Option("noise", "GL"))
    renew_at: float = key(number(0, 1), 0.2,
        "share of ZOIs lost from one burst to the next that renews the reference; 1 never")
    reference_shift_px: float = key(number(0, 10), 0.05, "motion during the reference burst that is accepted, px")


@dataclass(frozen=True, slots=True)
class ScaleConfig:
    """[scale]"""

    mm_per_px: float | None = key(number(1e-6, 1e3), None,
        "length of a pixel on the specimen; lengths may then be given in mm", Option("scale", "MM_PER_PX"))
    sigma_mm_per_px: float | None = key(number(0, 1e3), None, "its standard uncertainty")
    date: str | None = key(TEXT, None, "when it was taken")
    method: str | None = key(TEXT, None, "how it was taken")
    stand_off_mm: float | None = key(number(1, 1e6), None, "distance from the camera to the specimen")

    @property
    def px_per_mm(self) -> float | None:
        """None where it is not known."""
        return None if self.mm_per_px is None else 1 / self.mm_per_px


@dataclass(frozen=True, slots=True)
class RecordConfig:
    """[record]"""

    enabled: bool = key(FLAG, True, "record the session", Option("no-record", off=True))
    mode: str = key(RECORD_MODE, "all", "all frames, only bursts (sums), or every=K frames", Option("record", "MODE"))
    armed: bool = key(FLAG, False, "measure, and record nothing until start is ordered", Option("armed", on=True))
    keep_s: float = key(number(0, 60), 2.0, "what came in this time before recording began is recorded too, s")
    start_above_N: float | None = key(number(1e-6, 1e9), None,
        "armed: a force of this magnitude begins recording too, N", Option("start-above", "N"))
    rotate_MB: float | None = key(number(10, 1e9), None, "begin another file after this much; the set is one session")
    buffer_MB: float = key(number(1, 1e6), 512.0, "frames waiting for the disk, at most")
    when_full: str = key(choice("gap", "stop"), "gap", "a full buffer or disk leaves a counted gap, or ends the run")


@dataclass(frozen=True, slots=True)
class OperateConfig:
    """[operate]"""

    orders: str | None = key(LISTEN_ADDRESS, None,
        "take orders as lines over TCP at this port (of 127.0.0.1 unless an address is given)",
        Option("orders", "[HOST:]PORT"))
    token_file: str | None = key(TEXT, None,
        "file with the word that clients of a port say first; needed beyond 127.0.0.1", Option("token-file", "FILE"))


@dataclass(frozen=True, slots=True)
class StrainOutConfig:
    """[strain_out]"""

    tcp: str | None = key(LISTEN_ADDRESS, None,
        "tell every measurement as a line to TCP clients of this port (of 127.0.0.1 unless an address is given)",
        Option("strain-out", "[HOST:]PORT"))
    udp: str | None = key(LISTEN_ADDRESS, None, "send it by UDP to this HOST:PORT")
    serial: str | None = key(TEXT, None, "write it to this port: /dev/ttyUSB1?baud=115200")
    format: str = key(choice("json", "csv"), "json", "of a line; csv begins with the names", Option("strain-format"))
    channels: tuple[str, ...] | None = key(NAMES, None,
        "what is told (docs/guide.md); without, the axial strain, load, gauges and what belongs to them",
        Option("strain-channels", "NAME,NAME"))


@dataclass(frozen=True, slots=True)
class AlarmConfig:
    """[[alarm]]: any number of them; exactly one of above and below."""

    channel: str = key(TEXT, "", "what is looked at: a channel (docs/guide.md)")
    above: float | None = key(number(), None, "the alarm is on above this")
    below: float | None = key(number(), None, "the alarm is on below this")
    hysteresis: float = key(number(0), 0.0, "it goes when the channel is back by this much")
    name: str = key(TEXT, "", "its name in messages")
    end: bool = key(FLAG, False, "it ends the run")
    line: str = key(TEXT, "", "sent as a line on all strain outputs when it comes")


@dataclass(frozen=True, slots=True)
class ViewConfig:
    """[view]"""

    enabled: bool = key(FLAG, True,
        "serve the rerun view (its port on 127.0.0.1 asks for no token: all users of this machine can look)",
        Option("no-view", off=True))
    rrd: bool = key(FLAG, True, "write view.rrd", Option("no-rrd", off=True))
    port: int = key(integer(1024, 65535), 9876, "port of the view on 127.0.0.1; the next free one is taken")
    spawn: bool = key(FLAG, True, "open the viewer when there is a display")
    strain_range: float | None = key(number(1e-7, 10), None,
        "fixed symmetric range of the strain maps; follows the data without")
    scale: str = key(choice("symmetric", "automatic"), "symmetric",
        "colours about zero, or over the values there are")
    light: bool = key(FLAG, False, "for slow links: a small picture and the maps once a second",
        Option("light", on=True))


@dataclass(frozen=True, slots=True)
class SpecimenConfig:
    """[specimen]"""

    width_mm: float | None = key(number(1e-3, 1e5), None, "width of the section")
    thickness_mm: float | None = key(number(1e-4, 1e5), None, "thickness of the section")
    diameter_mm: float | None = key(number(1e-3, 1e5), None, "diameter of a round section")
    area_mm2: float | None = key(number(1e-6, 1e9), None,
        "area of any section; goes before width, thickness and diameter")
    gauge_length_mm: float | None = key(number(1e-3, 1e6), None, "gauge length, told beside the extensions")
    axis: str = key(choice(AUTO, "x", "y"), AUTO,
        "direction of the load in the image; auto: of the largest strain, y until that tells", Option("axis"))
    standard: str = key(choice("iso6892", "iso527", "astm-d3039", "free"), "iso6892",
        "standard of the evaluation; free: modulus_between alone", Option("standard"))
    modulus_between: tuple[float, float] = key(STRAINS, (0.0005, 0.0025),
        "strains between which a free evaluation takes the modulus")
    zero: str = key(choice("raw", "toe", "preload"), "raw",
        "strain counts as measured, from the foot of the elastic line, or from the preload", Option("zero"))
    preload_MPa: float = key(number(1e-3, 1e5), 1.0, "stress from which strain counts with zero = preload")

    @property
    def first_axis(self) -> Literal["x", "y"]:
        """The direction of the load as far as it is known before the test."""
        return "x" if self.axis == "x" else "y"

    @property
    def area_m2(self) -> float | None:
        """Section, m^2; None where it is not known."""
        if self.area_mm2 is not None:
            return self.area_mm2 * 1e-6
        if self.width_mm is not None and self.thickness_mm is not None:
            return self.width_mm * self.thickness_mm * 1e-6
        return None if self.diameter_mm is None else math.pi / 4 * self.diameter_mm**2 * 1e-6


@dataclass(frozen=True, slots=True)
class OutputConfig:
    """[output]"""

    dir: str | None = key(TEXT, None, "where the files go; default: a new folder in runs/ named by the UTC time",
        Option("out", "DIR"))
    seconds: float | None = key(number(0.01, 1e7), None, "end after this time", Option("seconds", "S"))
    report: bool = key(FLAG, False, "write report.html at the end", Option("report", on=True))
