"""The default and the limits of each key of the configuration."""

from __future__ import annotations

import dataclasses
import math
from contextlib import nullcontext
from typing import Any

import pytest

from acquire.bounds import NotAllowed
from acquire.errors import ConfigError
from live.config.loading import Config, load_config, options
from live.config.sections import DEFAULT_BURST, DEFAULT_REFERENCE_BURST, AlarmConfig, PlateConfig
from live.config.values import COVARIANCE, LENS_PARAMETERS

INF = math.inf
NUMBERS: dict[str, tuple[float | None, float, float]] = {  # default, lowest, highest
    "camera.readout_ms": (None, 0, 10_000),
    "camera.sigma_readout_ms": (None, 0, 10_000),
    "load.max_gap_s": (0.5, 1e-3, 3600),
    "load.lag_s": (0.0, -10, 10),
    "load.zero_N": (0.0, -1e9, 1e9),
    "measure.bending_px": (0.05, 0, INF),
    "measure.noise_GL": (None, 0, 65535),
    "measure.renew_at": (0.2, 0, 1),
    "measure.reference_shift_px": (0.05, 0, 10),
    "scale.mm_per_px": (None, 1e-6, 1e3),
    "scale.sigma_mm_per_px": (None, 0, 1e3),
    "scale.stand_off_mm": (None, 1, 1e6),
    "lens.focal_px": (None, 1, 1e9),
    "lens.k1": (0.0, -1e6, 1e6),
    "lens.k2": (0.0, -1e6, 1e6),
    "lens.p1": (0.0, -1e6, 1e6),
    "lens.p2": (0.0, -1e6, 1e6),
    "lens.k3": (0.0, -1e6, 1e6),
    "lens.rms_px": (None, 0, 1e3),
    "record.keep_s": (2.0, 0, 60),
    "record.start_above_N": (None, 1e-6, 1e9),
    "record.rotate_MB": (None, 10, 1e9),
    "record.buffer_MB": (512.0, 1, 1e6),
    "view.strain_range": (None, 1e-7, 10),
    "specimen.width_mm": (None, 1e-3, 1e5),
    "specimen.thickness_mm": (None, 1e-4, 1e5),
    "specimen.diameter_mm": (None, 1e-3, 1e5),
    "specimen.area_mm2": (None, 1e-6, 1e9),
    "specimen.gauge_length_mm": (None, 1e-3, 1e6),
    "specimen.force_error_percent": (None, 0, 100),
    "specimen.section_error_percent": (None, 0, 100),
    "specimen.strain_error_um_m": (None, 0, 1e5),
    "specimen.film_error_percent": (None, 0, 100),
    "specimen.modulus_GPa": (None, 1e-6, 1e6),
    "specimen.nu": (None, 0, 0.5),
    "specimen.preload_MPa": (1.0, 1e-3, 1e5),
    "output.seconds": (None, 0.01, 1e7),
}
COUNTS: dict[str, tuple[int | None, int, int]] = {
    "measure.zoi": (64, 8, 1024),
    "measure.step": (16, 1, 1024),
    "measure.burst": (None, 1, 10_000),
    "measure.reference_burst": (None, 1, 10_000),
    "measure.order": (1, 1, 2),
    "view.port": (9876, 1024, 65_535),
}
OTHERS = {
    "camera": {"address": "", "back": None, "beside": (), "crop": None, "dark": None, "flat": None},
    "load": {"address": "none:", "unit": None, "column": None, "decimal": None, "sign": 1},
    "measure": {
        "roi": None, "mask": None, "gauges": "given", "window": "gaussian", "estimator": "spectral",
        "strain": "engineering",
    },
    "scale": {"date": None, "method": None},
    "record": {"enabled": True, "mode": "all", "armed": False, "when_full": "gap"},
    "operate": {"orders": None, "token_file": None},
    "strain_out": {"tcp": None, "udp": None, "serial": None, "format": "json", "channels": None},
    "view": {"enabled": True, "rrd": True, "spawn": True, "scale": "automatic", "light": False},
    "specimen": {
        "axis": "auto", "standard": "iso6892", "test": "auto", "modulus_between": (0.0005, 0.0025), "zero": "raw",
    },
    "output": {"dir": None, "response": None, "report": False},
}  # fmt: skip


def value(key: str, **given: Any) -> Any:
    """The value of a key where it, or nothing, is given."""
    section, name = key.split(".")
    found = load_config(None, {key: given["as_"]} if given else {})
    return getattr(getattr(found, section), name)


@pytest.mark.parametrize("key", [*NUMBERS, *COUNTS])
def test_each_number_has_its_default_and_its_limits(key: str) -> None:
    default, low, high = {**NUMBERS, **COUNTS}[key]
    assert value(key) == default
    for edge, way in ((low, -1), (high, 1)):
        assert value(key, as_=edge) == edge
        if math.isinf(edge):
            continue
        beyond = edge + way if key in COUNTS else edge + way * max(abs(edge), 1e-3) * 1e-3
        with pytest.raises(ConfigError, match=f"{key} = .* is not possible; allowed: a (whole )?number from"):
            value(key, as_=beyond)


def test_no_key_is_left_out_here() -> None:
    plain = load_config(None, {}).as_dict()
    sections = {name: table for name, table in plain.items() if name not in ("alarm", "gauges", "metadata")}
    of_numbers = {(key.split(".")[0], key.split(".")[1]) for key in (*NUMBERS, *COUNTS)}
    rest = {
        name: {key: one for key, one in table.items() if (name, key) not in of_numbers}
        for name, table in sections.items()
    }
    assert rest == OTHERS
    assert dataclasses.asdict(AlarmConfig()) == {
        "channel": "", "above": None, "below": None, "hysteresis": 0.0, "name": "", "end": False, "line": "",
        "end_on_unknown": False, "of_cycle": None,
    }  # fmt: skip
    assert PlateConfig().box is None
    assert (DEFAULT_BURST, DEFAULT_REFERENCE_BURST) == (4, 32)


def test_some_options_are_switches_and_some_are_for_experts() -> None:
    found = {name: field.metadata["option"] for name, (_, field) in options().items()}
    assert {name for name, one in found.items() if one.on} == {"armed", "light", "report"}
    assert {name for name, one in found.items() if one.off} == {"no-record", "no-view", "no-rrd"}
    assert {name for name, one in found.items() if not one.expert} == {
        "camera", "back", "beside", "load", "load-unit", "load-column", "load-decimal", "load-sign",
        "roi", "zoi", "step", "burst", "mask", "gauges", "strain", "scale",
        "no-record", "armed", "orders", "strain-out", "no-view", "axis", "out", "seconds", "response",
        "report",
    }  # fmt: skip
    keys = {name: key for name, (key, _) in options().items()}
    assert (keys["no-record"], keys["lag"], keys["bending"]) == (
        "record.enabled",
        "load.lag_s",
        "measure.bending_px",
    )


@pytest.mark.parametrize("hysteresis", [-0.001, math.nan])
def test_a_hysteresis_is_not_below_zero(hysteresis: float) -> None:
    with pytest.raises(ConfigError, match=r"alarm 1\.hysteresis"):
        load_config(None, {"alarm": [{"channel": "axial", "above": 1.0, "hysteresis": hysteresis}]})


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("camera.crop", [0, 0, 1, 1], [0, 0, 1, 0]),
        ("measure.roi", "all", "ALL"),
        ("load.sign", -1, 0),
        ("load.decimal", "comma", ","),
        ("specimen.modulus_between", [0, 1], [0, 1.001]),
        ("specimen.modulus_between", [0.001, 0.002], [-0.001, 0.002]),
        ("specimen.modulus_between", [0.001, 0.002], [0.002, 0.002]),
        ("specimen.modulus_between", [0.001, 0.002], [0.001, True]),
        ("specimen.modulus_between", [0.001, 0.002], [0.001, 0.002, 0.003]),
        ("lens.centre", [-999_999, 999_999.0], [0, 1_000_000]),
        ("lens.centre", [0, 0], [0, 0, 0]),
        ("lens.picture", [1, 1_000_000], [0, 5]),
        ("lens.picture", [1_000_000, 1], [5, 1_000_001]),
        ("lens.picture", [640, 480], [640, 480, 1]),
        ("lens.box", [0, 0, 0.1, 0.1], [0, 0, 0, 0.1]),
        ("lens.box", [0, 0, 0.1, 0.1], [0, 0, 0.1, 0]),
        ("lens.box", [0, 0, 0.1, 0.1], [-0.1, 0, 0.1, 0.1]),
        ("lens.box", [0, 0, 0.1, 0.1], [0, -0.1, 0.1, 0.1]),
        ("strain_out.channels", ["axial"] * 64, ["axial"] * 65),
        ("strain_out.channels", ["axial"], []),
        ("operate.orders", "socket", "sockets"),
        ("operate.orders", "0", "1023"),
        ("operate.orders", "1024", "65536"),
        ("operate.orders", "192.168.0.1:65535", "here:65535"),
        ("record.mode", "every=2", "every"),
        ("record.enabled", False, 0),
        ("camera.address", "sim:", "sim:\0"),
        ("record.when_full", "stop", "st"),
        ("view.scale", "automatic", "auto"),
        ("specimen.zero", "preload", "pre"),
        ("specimen.standard", "astm-d3039", "astm"),
        ("strain_out.format", "csv", "CSV"),
    ],
)  # fmt: skip
def test_other_values_are_taken_or_refused_whole(key: str, good: Any, bad: Any) -> None:
    found = value(key, as_=good)
    assert (list(found) if isinstance(found, tuple) else found) == good
    with pytest.raises(ConfigError, match=key):
        value(key, as_=bad)


@pytest.mark.parametrize(("corners", "good"), [(2, False), (3, True), (100, True), (101, False)])
def test_a_polygon_has_3_to_100_corners(corners: int, good: bool) -> None:
    given = {"gauges.hole": {"kind": "area", "corners": [[k, k * k] for k in range(corners)]}}
    with nullcontext() if good else pytest.raises(ConfigError, match="3 to 100 corners"):
        assert len(load_config(None, given).gauges["hole"]["corners"]) == corners


@pytest.mark.parametrize(
    ("name", "good"),
    [("a" * 32, True), ("a" * 33, False), ("a_1", True), ("_a", False), ("aä", False), ("a\n", False)],
)
def test_the_name_of_a_gauge_is_part_of_names_of_columns(name: str, good: bool) -> None:
    given = {f"gauges.{name}": {"kind": "zoi", "at": [1, 2]}}
    with nullcontext() if good else pytest.raises(ConfigError, match="a name has up to 32 letters"):
        assert list(load_config(None, given).gauges) == [name]


def covariance(**changed: float) -> list[list[float]]:
    """Variances of 4."""
    rows = [[4.0 if i == j else 0.0 for j in range(LENS_PARAMETERS)] for i in range(LENS_PARAMETERS)]
    for name, one in changed.items():
        rows[int(name[1])][int(name[2])] = one
    return rows


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (covariance(c01=1.0), "the same on both sides"),
        (covariance(c10=1.0), "the same on both sides"),
        (covariance(c77=-1.0), "no variance below 0"),
        (covariance(c01=4.1, c10=4.1), "no correlation beyond 1"),
        (covariance(c01=-4.1, c10=-4.1), "no correlation beyond 1"),
        (covariance()[:-1], "8 rows of 8 numbers"),
        ([row[:-1] for row in covariance()], "8 rows of 8 numbers"),
        (covariance(c00=1.1e18), "a number from"),
        (4.0, "8 rows of 8 numbers"),
    ],
)
def test_what_is_no_covariance_of_a_lens(rows: Any, words: str) -> None:
    with pytest.raises(NotAllowed, match=words):
        COVARIANCE.accept(rows)


def test_a_covariance_may_be_rounded_and_have_no_variance_at_all() -> None:
    assert COVARIANCE.accept(covariance(c01=1.0, c10=1.0 + 2e-6))[0][1] == 1.0
    with pytest.raises(NotAllowed, match="the same on both sides"):
        COVARIANCE.accept(covariance(c01=1.0, c10=1.0 + 6e-6))
    assert COVARIANCE.accept(covariance(c01=3.9, c10=3.9))[1][0] == 3.9
    zero = [[0.0] * LENS_PARAMETERS] * LENS_PARAMETERS
    assert COVARIANCE.accept(zero)[7][7] == 0.0


def test_lengths_in_mm_have_signs_and_points_and_end_with_mm() -> None:
    def start(text: str) -> Any:
        table = {"gauges.axial": {"start": text, "end": [1, 50]}}
        return load_config(None, {"scale.mm_per_px": 0.5, **table}).gauges["axial"]["start"]

    assert start("-1.5, .5 mm") == (-3.0, 1.0)
    assert start(" +2 ,3.mm ") == (4.0, 6.0)
    for text in ("1, 2", "1, 2 mm2", "1e1, 2 mm", "x1, 2 mm"):
        with pytest.raises(ConfigError, match="two numbers"):
            start(text)


def test_the_configuration_file_has_at_most_a_megabyte(tmp_path: Any) -> None:
    path = tmp_path / "rig.toml"
    for size, good in ((1_000_000, True), (1_000_001, False)):
        path.write_bytes(b"#" * size)
        with nullcontext() if good else pytest.raises(ConfigError, match="cannot be read"):
            assert load_config(path, {}) == Config()
