"""Calibrating a load cell with known loads: a straight line, its residual, and the file that keeps it."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from acquire.errors import ConfigError, DataError


@dataclass(frozen=True, slots=True)
class Point:
    """One known load.

    Attributes
    ----------
    force : float, N
        Known.
    value : float
        Mean of what stood on the line.
    noise : float
        Standard deviation of one reading.
    n : int
        Readings.
    """

    force: float
    value: float
    noise: float
    n: int


@dataclass(frozen=True, slots=True)
class Calibration:
    """force = (value - zero) * gain.

    Attributes
    ----------
    gain : float, N per unit of the line
    zero : float
        Value at no load.
    residual_N : float, N
        Greatest distance of a point from the line.
    points : tuple of Point
    date : str
        ISO 8601, UTC.
    address : str
        Of the load cell when it was calibrated; empty where it is not known.
    """

    gain: float
    zero: float
    residual_N: float
    points: tuple[Point, ...]
    date: str
    address: str = ""


def point(force_N: float, values: Sequence[float]) -> Point:
    """A point from the readings under a known load.

    Raises
    ------
    DataError
        No reading has a value.
    """
    finite = np.array([value for value in values if np.isfinite(value)])
    if not finite.size:
        raise DataError("no reading had a value; look at the lines with 'phasedic load-check'")
    return Point(float(force_N), float(finite.mean()), float(finite.std()), int(finite.size))


def fit(points: Sequence[Point], now: datetime | None = None) -> Calibration:
    """The line of least squares through the points.

    Parameters
    ----------
    points : sequence of Point
        At least two different loads; a reading without load before and after shows the drift.
    now : datetime or None

    Raises
    ------
    DataError
        The loads are all the same, or the readings do not follow them.
    """
    force = np.array([p.force for p in points])
    value = np.array([p.value for p in points])
    if len(points) < 2 or np.ptp(force) == 0:
        raise DataError("a calibration needs two different loads, none and a known one")
    scatter = max(float(np.max([p.noise / np.sqrt(p.n) for p in points])), 0.0)
    if np.ptp(value) <= 5 * scatter:
        raise DataError("the readings do not change with the load; check the cell and its wiring")
    # The loads are known and the readings scatter: readings against loads, not the reverse.
    # In closed form: no wrong force may come from a wrong linear algebra library.
    middle = force.mean()
    slope = np.sum((force - middle) * value) / np.sum((force - middle) ** 2)
    zero = value.mean() - slope * middle
    residual = float(np.abs((value - zero) / slope - force).max())
    date = (now or datetime.now(UTC)).isoformat(timespec="seconds")
    return Calibration(float(1 / slope), float(zero), residual, tuple(points), date)


def save(calibration: Calibration, path: Path, address: str) -> None:
    """Write a calibration as TOML.

    Raises
    ------
    DataError
        The file exists already, or cannot be written.
    """
    lines = [
        "# Calibration of a load cell; use it with calibration=THIS_FILE in the address.",
        f"address = {_quoted(address)}",
        f"date = {_quoted(calibration.date)}",
        f"gain = {calibration.gain!r}  # N per unit of the line",
        f"zero = {calibration.zero!r}  # on the line, without load",
        f"residual_N = {calibration.residual_N!r}",
    ]
    for p in calibration.points:
        lines += ["", "[[points]]", f"force_N = {p.force!r}", f"value = {p.value!r}"]
        lines += [f"noise = {p.noise!r}", f"n = {p.n}"]
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")
    except FileExistsError as error:
        raise DataError("{path} exists already and is not overwritten; choose another name", path) from error
    except OSError as error:
        raise DataError(
            "{path} cannot be written ({strerror}); choose another folder", path, error
        ) from error


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def load(path: str) -> Calibration:
    """Read what ``save`` wrote.

    Raises
    ------
    ConfigError
        Missing, or not such a file.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        points = tuple(
            Point(float(p["force_N"]), float(p["value"]), float(p["noise"]), int(p["n"]))
            for p in content["points"]
        )
        numbers = [float(content[name]) for name in ("gain", "zero", "residual_N")]
        date, address = str(content["date"]), str(content.get("address", ""))
    except OSError as error:
        raise ConfigError(
            "calibration={path}: {strerror}; name the file of a calibration", path, error
        ) from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, ValueError, TypeError) as error:
        raise ConfigError(
            "calibration={path}: not a calibration of this program ({error})", path, repr(error)
        ) from error
    if not np.isfinite(numbers).all() or numbers[0] == 0:
        raise ConfigError(
            "calibration={path}: gain, zero and residual must be numbers, the gain not zero", path
        )
    return Calibration(numbers[0], numbers[1], numbers[2], points, date, address)
