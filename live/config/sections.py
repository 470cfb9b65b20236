"""The sections of the configuration: the check, default, help text and option of each key."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from acquire.text import Message
from live.config.listen_address import SOCKET
from live.config.values import (
    ADDRESSES,
    AUTO,
    BOX,
    CAMERA_ADDRESS,
    COVARIANCE,
    FLAG,
    GIVEN,
    LISTEN_ADDRESS,
    LOAD_ADDRESS,
    NAMES,
    ORDERS,
    POINT,
    RECORD_MODE,
    RECTANGLE,
    REGION,
    SIGN,
    SIZE,
    STRAINS,
    TEXT,
    Option,
    choice,
    integer,
    key,
    length,
    number,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DEFAULT_BURST, DEFAULT_REFERENCE_BURST = 4, 32
"""Frames of a live camera; of files, 1."""


# One key of the file per line: check, default, help text, and option of the command line.
# fmt: off

@dataclass(frozen=True, slots=True)
class CameraConfig:
    """[camera]"""

    address: str = key(CAMERA_ADDRESS, "", "address of the camera: /dev/video0?format=Y12&fps=30, sim:, files:...",
        Option("camera", "ADDRESS"))
    back: str | None = key(TEXT, None,
        "camera behind the specimen: its rig file, whose sections camera, measure, scale, gauges and plate are those of"
        " the back; or its address, with the settings of the front",
        Option("back", "FILE.toml|ADDRESS"))
    beside: tuple[str, ...] = key(ADDRESSES, (),
        "camera of another field of the specimen, as back: measured together, without a mean; up to seven",
        Option("beside", "FILE.toml|ADDRESS", many=True))
    crop: tuple[int, int, int, int] | None = key(BOX, None,
        "x, y, width, height of the part of the picture to use, px; its corner is the origin of all coordinates",
        Option("crop", "X,Y,W,H", expert=True))
    readout_ms: float | None = key(number(0, 10_000), None,
        "time of a rolling shutter from the first line of the picture to the last, ms: the strain that motion shows"
        " by it is removed")
    sigma_readout_ms: float | None = key(number(0, 10_000), None, "standard uncertainty of readout_ms")
    dark: str | None = key(TEXT, None,
        "dark frame (TIFF), subtracted from every burst", Option("dark", "FILE", expert=True))
    flat: str | None = key(TEXT, None,
        "flat frame (TIFF); every burst is divided by it", Option("flat", "FILE", expert=True))


@dataclass(frozen=True, slots=True)
class LoadConfig:
    """[load]"""

    address: str = key(LOAD_ADDRESS, "none:", "address of the load cell: /dev/ttyUSB0?protocol=ascii, sim:, none:",
        Option("load", "ADDRESS"))
    max_gap_s: float = key(number(0.001, 3600), 0.5, "longest time between samples that is no gap, s")
    lag_s: float = key(number(-10, 10), 0.0,
        "delay of the load stamps behind the frames, s; the summary shows the measured value",
        Option("lag", "S", expert=True))
    zero_N: float = key(number(-1e9, 1e9), 0.0,
        "force from which forces count, N; the page sets it for one test, where the operator tares before it")
    unit: str | None = key(TEXT, None,
        "unit of the force in a file, N, kN, kgf, lbf; N,ms: that of its times too (default: as the file says)",
        Option("load-unit", "UNIT"))
    column: str | None = key(TEXT, None,
        "column of the force in a file, by heading or number from 1; FORCE,TIME: that of times or names too",
        Option("load-column", "NAME"))
    decimal: str | None = key(choice("point", "comma"), None,
        "decimal mark of a file, where it can be read in two ways", Option("load-decimal"))
    sign: int = key(SIGN, 1, "-1: the force of a file or recording is negative in tension", Option("load-sign", "SIGN"))


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """[measure]"""

    roi: tuple[int, int, int, int] | str | None = key(REGION, None,
        "region to measure: x, y, width, height in px; auto (default): the specimen, found in a first picture;"
        " all: the whole picture except a rim",
        Option("roi", "X,Y,W,H|auto|all"))
    zoi: int = key(length(integer(8, 1024), whole=True), 64, "side of a ZOI, px", Option("zoi", "PX"))
    step: int = key(length(integer(1, 1024), whole=True), 16, "distance between neighbouring ZOIs, px",
        Option("step", "PX"))
    burst: int | None = key(integer(1, 10000), None,
        "frames averaged for one measurement (default: 4 live, 1 for files)",
        Option("burst", "N"))
    reference_burst: int | None = key(integer(1, 10000), None,
        "frames averaged for the reference (default: 32 live, 1 for files)",
        Option("reference-burst", "N", expert=True))
    mask: str | None = key(TEXT, None,
        "mask image; ZOIs on its black parts are not measured", Option("mask", "FILE"))
    gauges: str = key(choice(GIVEN, AUTO), GIVEN,
        "virtual gauges: given: those of the configuration; auto: also extension, width and area of the specimen",
        Option("gauges"))
    window: str = key(choice("gaussian", "uniform", "tukey", "bi-triangular"), "gaussian",
        "weight of the pixels of a ZOI in the least-squares fit: gaussian, uniform, tukey, bi-triangular",
        Option("window", "NAME", expert=True))
    estimator: str = key(choice("spectral", "phase"), "spectral", "estimator: spectral, or phase",
        Option("estimator", "NAME", expert=True))
    order: int = key(integer(1, 2), 1,
        "order of the shape function of a ZOI: 1 (affine) or 2 (quadratic)", Option("order", "N", expert=True))
    strain: str = key(choice("engineering", "small", "green", "hencky"), "engineering",
        "strain measure: engineering (elongation over length, as from an extensometer), small, green or hencky",
        Option("strain", "MEASURE"))
    bending_px: float = key(number(0, math.inf), 0.05,
        "a ZOI in which the displacement jumps or bends by more than this is UNEVEN, px; inf: never",
        Option("bending", "PX", expert=True))
    noise_GL: float | None = key(number(0, 65535), None,
        "noise of one frame, grey levels (default: measured from the reference burst)",
        Option("noise", "GL", expert=True))
    renew_at: float = key(number(0, 1), 0.2,
        "share of ZOIs lost from one burst to the next above which the reference is renewed; 1: never")
    reference_shift_px: float = key(number(0, 10), 0.05,
        "largest motion accepted during the reference burst, px")


@dataclass(frozen=True, slots=True)
class ScaleConfig:
    """[scale]"""

    mm_per_px: float | None = key(number(1e-6, 1e3), None,
        "size of a pixel on the specimen, mm; lengths can then be given in mm", Option("scale", "MM_PER_PX"))
    sigma_mm_per_px: float | None = key(number(0, 1e3), None, "standard uncertainty of mm_per_px")
    date: str | None = key(TEXT, None, "time of the scale measurement")
    method: str | None = key(TEXT, None, "method of the scale measurement")
    stand_off_mm: float | None = key(number(1, 1e6), None, "distance from the camera to the specimen, mm")

    @property
    def px_per_mm(self) -> float | None:
        """None if the scale is not known."""
        return None if self.mm_per_px is None else 1 / self.mm_per_px


@dataclass(frozen=True, slots=True)
class PlateConfig:
    """[plate.NAME]: a plate that moves with the specimen and is not loaded (docs/optics.md)."""

    box: tuple[float, float, float, float] | None = key(RECTANGLE, None,
        "x, y, width, height of the pattern on the plate, px")


@dataclass(frozen=True, slots=True)
class LensConfig:
    """[lens], or lens = "lens.toml": what phasedic lens found (docs/optics.md)."""

    focal_px: float | None = key(number(1, 1e9), None, "focal length, px; without it nothing is corrected")
    centre: tuple[float, float] | None = key(POINT, None, "x, y of the optical axis, px")
    k1: float = key(number(-1e6, 1e6), 0.0, "radial term of r^2, with r over the focal length; signs as in OpenCV")
    k2: float = key(number(-1e6, 1e6), 0.0, "of r^4")
    p1: float = key(number(-1e6, 1e6), 0.0, "tangential term along y")
    p2: float = key(number(-1e6, 1e6), 0.0, "along x")
    k3: float = key(number(-1e6, 1e6), 0.0, "radial term of r^6")
    covariance: tuple[tuple[float, ...], ...] | None = key(COVARIANCE, None,
        "8 rows: covariance of focal_px, centre (x, y), k1, k2, p1, p2, k3 (default: zero, which no lens has)")
    picture: tuple[int, int] | None = key(SIZE, None, "width, height of the pictures it holds for, px")
    box: tuple[float, float, float, float] | None = key(RECTANGLE, None,
        "x, y, width, height of the part of the picture that was calibrated, px")
    rms_px: float | None = key(number(0, 1e3), None, "what the fit leaves, rms, px")
    date: str | None = key(TEXT, None, "time of the calibration")
    method: str | None = key(TEXT, None, "method of the calibration")


@dataclass(frozen=True, slots=True)
class RecordConfig:
    """[record]"""

    enabled: bool = key(FLAG, True, "record the session", Option("no-record", off=True))
    mode: str = key(RECORD_MODE, "all",
        "frames to record: all, bursts (sums only), every=K (one in K), or cycles=K (bursts at valley and peak of the"
        " first K cycles, then of every 10th, 100th)", Option("record", "MODE", expert=True))
    armed: bool = key(FLAG, False,
        "measure at once, but record only after the start command", Option("armed", on=True))
    keep_s: float = key(number(0, 60), 2.0,
        "pre-trigger: frames of this time before the start are recorded too, s")
    start_above_N: float | None = key(number(1e-6, 1e9), None,
        "with armed: a force of this magnitude also starts the recording, N", Option("start-above", "N", expert=True))
    rotate_MB: float | None = key(number(10, 1e9), None,
        "size after which another file is begun, MB; all files together are one session")
    buffer_MB: float = key(number(1, 1e6), 512.0, "memory for frames that wait for the disk, MB")
    when_full: str = key(choice("gap", "stop"), "gap",
        "what a full buffer or disk does: gap (frames are left out and counted) or stop (the run ends)")


@dataclass(frozen=True, slots=True)
class OperateConfig:
    """[operate]"""

    orders: str | None = key(ORDERS, None,
        "take commands of other programs, one per line: on a unix socket of your own in the run's folder, or on a TCP"
        " port (on 127.0.0.1 unless HOST is given) with --token-file",
        Option("orders", "[HOST:]PORT", alone=SOCKET))
    token_file: str | None = key(TEXT, None,
        "file of mode 600 with the token that a client must send first; required for commands by TCP, and for addresses"
        " other than 127.0.0.1",
        Option("token-file", "FILE", expert=True))


@dataclass(frozen=True, slots=True)
class StrainOutConfig:
    """[strain_out]"""

    tcp: str | None = key(LISTEN_ADDRESS, None,
        "TCP port that sends every measurement as a line to its clients (on 127.0.0.1 unless HOST is given)",
        Option("strain-out", "[HOST:]PORT"))
    udp: str | None = key(LISTEN_ADDRESS, None, "HOST:PORT to which every measurement is sent by UDP")
    serial: str | None = key(TEXT, None,
        "serial port to which every measurement is written: /dev/ttyUSB1?baud=115200")
    format: str = key(choice("json", "csv"), "json",
        "format of a line; csv begins with the names of the channels", Option("strain-format", expert=True))
    channels: tuple[str, ...] | None = key(NAMES, None,
        "channels of a line (docs/control.md; default: strain, force, stress, their ages and states, lost share,"
        " latency, all gauges)",
        Option("strain-channels", "NAME,NAME", expert=True))


@dataclass(frozen=True, slots=True)
class AlarmConfig:
    """[[alarm]]: any number of them; exactly one of above and below."""

    channel: str = key(TEXT, "", "channel that is watched (docs/control.md)")
    above: float | None = key(number(), None, "the alarm is on above this value")
    below: float | None = key(number(), None, "the alarm is on below this value")
    hysteresis: float = key(number(0), 0.0, "distance back from the limit at which the alarm ends")
    of_cycle: int | None = key(integer(1, 10**9), None,
        "above and below are multiples of the value of the channel in this cycle (1: the first)")
    name: str = key(TEXT, "", "name of the alarm in messages")
    end: bool = key(FLAG, False, "the alarm ends the run")
    end_on_unknown: bool = key(FLAG, False, "also where it comes because the value is not known (with end = true)")
    line: str = key(TEXT, "", "line sent on all strain outputs when the alarm begins")


@dataclass(frozen=True, slots=True)
class ViewConfig:
    """[view]"""

    enabled: bool = key(FLAG, True,
        "serve the rerun view (its port on 127.0.0.1 needs no token: all users of this machine can open it)",
        Option("no-view", off=True))
    rrd: bool = key(FLAG, True, "write view.rrd", Option("no-rrd", off=True, expert=True))
    port: int = key(integer(1024, 65535), 9876, "port of the view on 127.0.0.1, or the next free one")
    spawn: bool = key(FLAG, True, "open the viewer if there is a display")
    strain_range: float | None = key(number(1e-7, 10), None,
        "fixed symmetric range of the strain maps (default: from the data)")
    scale: str = key(choice("automatic", "symmetric"), "automatic",
        "colour range: automatic (lowest to highest value, about zero for both signs), or symmetric about zero")
    light: bool = key(FLAG, False, "for slow connections: a small picture, and maps once a second",
        Option("light", on=True, expert=True))


@dataclass(frozen=True, slots=True)
class SpecimenConfig:
    """[specimen]"""

    width_mm: float | None = key(number(1e-3, 1e5), None, "width of the section, mm")
    thickness_mm: float | None = key(number(1e-4, 1e5), None, "thickness of the section, mm")
    diameter_mm: float | None = key(number(1e-3, 1e5), None, "diameter of a round section, mm")
    area_mm2: float | None = key(number(1e-6, 1e9), None,
        "area of the section, mm^2, in place of width and thickness or a diameter")
    gauge_length_mm: float | None = key(number(1e-3, 1e6), None,
        "gauge length, mm; reported with the extensions")
    force_error_percent: float | None = key(number(0, 100), None,
        "limit of error of the load cell, % (its class): in the interval of E")
    section_error_percent: float | None = key(number(0, 100), None,
        "limit of error of the area of the section, %: in the interval of E")
    strain_error_um_m: float | None = key(number(0, 1e5), None,
        "limit of error of the strain that comes with the load over the elastic interval, um/m: motion off the plane"
        " (0.1 mm at 500 mm: 200), lens, alignment; in the interval of E")
    film_error_percent: float | None = key(number(0, 100), None,
        "limit of error of strains from a film whose codec makes pictures of earlier ones (H.264, VP9 ...), %: a replay"
        " of such a film takes 10 where none is given; in the intervals of strains and of E")
    modulus_GPa: float | None = key(number(1e-6, 1e6), None,
        "modulus that is expected, GPa: phasedic check shows its budget in GPa too")
    nu: float | None = key(number(0, 0.5), None,
        "Poisson's ratio, where it is known: a warning where strains of an elastic test do not fit it")
    axis: str = key(choice(AUTO, "x", "y"), AUTO,
        "direction of the load in the picture; auto: the direction of the largest strain, y until it is clear",
        Option("axis"))
    standard: str = key(choice("iso6892", "iso527", "astm-d3039", "free"), "iso6892",
        "standard of the evaluation; free: only modulus_between", Option("standard", expert=True))
    test: str = key(choice(AUTO, "tensile", "compression", "cyclic", "relaxation", "creep"), AUTO,
        "kind of the test; strengths and extensions are those of a tensile one; auto: found from its course",
        Option("test", expert=True))
    modulus_between: tuple[float, float] = key(STRAINS, (0.0005, 0.0025),
        "strain interval of the modulus in a free evaluation")
    zero: str = key(choice("raw", "toe", "preload"), "raw",
        "zero of the strain: raw (as measured), toe (foot of the elastic line) or preload", Option("zero", expert=True))
    preload_MPa: float = key(number(1e-3, 1e5), 1.0,
        "stress at which the strain is zero with zero = preload, MPa")

    @property
    def first_axis(self) -> Literal["x", "y"]:
        """The direction of the load before the test shows it."""
        return "x" if self.axis == "x" else "y"

    @property
    def area_m2(self) -> float | None:
        """Area of the section, m^2; None if it is not known."""
        if self.area_mm2 is not None:
            return self.area_mm2 * 1e-6
        if self.width_mm is not None and self.thickness_mm is not None:
            return self.width_mm * self.thickness_mm * 1e-6
        return None if self.diameter_mm is None else math.pi / 4 * self.diameter_mm**2 * 1e-6

    @property
    def section_text(self) -> str:
        """The section as it was given; empty where it is not known."""
        if self.area_m2 is None:
            return ""
        if self.area_mm2 is not None:
            return Message("{area:g} mm2", self.area_mm2)
        if self.width_mm is not None and self.thickness_mm is not None:
            return Message("{width:g} mm x {thickness:g} mm", self.width_mm, self.thickness_mm)
        return Message("diameter {diameter:g} mm", self.diameter_mm)

    def load(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """The stress (N,), Pa, of ``force``, N; the force itself where the section is not known."""
        return force / (self.area_m2 or 1.0)


@dataclass(frozen=True, slots=True)
class OutputConfig:
    """[output]"""

    dir: str | None = key(TEXT, None,
        "folder for the files (default: a new one in runs/, named by the UTC time)",
        Option("out", "DIR"))
    seconds: float | None = key(number(0.01, 1e7), None, "end after this time, s", Option("seconds", "S"))
    response: str | None = key(TEXT, None,
        "maps of what each place does over all instants: strain over stress, over that of the region (mean) or of a"
        " gauge, or over time, and where it leaves its line",
        Option("response", "stress|mean|GAUGE|time"))
    report: bool = key(FLAG, False, "write report.html at the end of the test", Option("report", on=True))
