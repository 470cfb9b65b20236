"""The settings of a serial load cell: what they are unsaid, what they may be, and what is stored of them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.load_cell import open_load_cell
from acquire.load_cell.calibration import Point, fit, save
from acquire.serial_line.settings import describe, read_settings

ALLOWED = {
    "mode": "one of listen, stream, poll",
    "gain": "a number",
    "wire": "yes or no",
    "tare": "one of auto, device, software",
    "rate": "a number from 0.01 to 1000",
    "capacity": "a number from 1e-09",
    "max_step": "a number from 1e-09",
    "zero": "a number",
    "timeout": "a number from 0.05 to 3600",
    "wait": "a number from 0 to 3600",
    "mass_reads_force": "yes or no",
    "baud": "a whole number from 50 to 12000000",
    "bytesize": "a whole number from 5 to 8",
    "parity": "one of N, E, O",
    "stopbits": "one of 1, 1.5, 2",
}


@pytest.mark.parametrize("key", ALLOWED)
def test_an_impossible_value_is_refused_with_what_is_allowed(key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_settings(parse_address(f"/dev/fake?unit=N&{key}=nonsense"))
    assert str(caught.value).partition(" is not possible; allowed: ")[2] == ALLOWED[key]


def test_what_is_not_said() -> None:
    s = read_settings(parse_address("/dev/fake"))
    given, line = s.given, s.line
    assert (s.protocol.name, s.mode, s.sign, s.gain, s.zero, s.rate, s.calibration) == (
        "ascii", "listen", 1, None, 0.0, 10.0, None,
    )  # fmt: skip
    assert (given.unit, given.capacity, given.max_step, given.mass_reads_force) == (None, None, None, False)
    assert (given.timeout, given.wait, given.tare) == (2.0, 5.0, "auto")
    assert (line.url, line.baud, line.bytesize, line.parity, line.stopbits) == (
        "/dev/fake",
        9600,
        8,
        "N",
        1.0,
    )
    assert s.byte_time_s == pytest.approx(10 / 9600)


@pytest.mark.parametrize(("protocol", "seconds"), [("ascii", 0.1), ("sauter&unit=N", 0.05)])
def test_a_read_lasts_as_long_as_the_silence_that_ends_a_message(protocol: str, seconds: float) -> None:
    assert read_settings(parse_address(f"/dev/fake?protocol={protocol}")).line.read_timeout_s == seconds


def test_capacity_and_step_are_not_mixed_up_and_a_line_may_have_no_wire() -> None:
    s = read_settings(
        parse_address("/dev/fake?unit=N&capacity=500&max_step=20&wire=no&timeout=7&wait=3&rate=4")
    )
    assert (s.given.capacity, s.given.max_step, s.byte_time_s) == (500.0, 20.0, 0.0)
    assert (s.given.timeout, s.given.wait, s.rate) == (7.0, 3.0, 4.0)


@pytest.mark.parametrize(("sign", "taken"), [("1", 1), ("+1", 1), ("-1", -1)])
def test_a_sign_is_one_or_minus_one(sign: str, taken: int) -> None:
    assert read_settings(parse_address(f"/dev/fake?unit=N&sign={sign}")).sign == taken


@pytest.mark.parametrize("sign", ["11", "-", "0", "1.0", "--1", "2"])
def test_no_other_sign_is_taken(sign: str) -> None:
    with pytest.raises(ConfigError, match="allowed: 1 or -1"):
        read_settings(parse_address(f"/dev/fake?unit=N&sign={sign}"))


def calibrated(folder: Path, settings: str = "") -> str:
    """An address with a calibration: 2 N a count from 100 counts on."""
    points = [Point(0.0, 100.0, 0.1, 50), Point(50.0, 125.0, 0.1, 50)]
    save(fit(points, datetime(2026, 5, 9, tzinfo=UTC)), folder / "cal.toml", "")
    return f"/dev/fake?calibration={folder}/cal.toml{settings}"


@pytest.mark.parametrize(
    ("settings", "gain", "zero"),
    [("", 2.0, 100.0), ("&gain=3", 3.0, 100.0), ("&zero=90", 2.0, 90.0), ("&gain=3&zero=0", 3.0, 0.0)],
)
def test_gain_and_zero_of_the_address_come_before_those_of_a_calibration(
    tmp_path: Path, settings: str, gain: float, zero: float
) -> None:
    s = read_settings(parse_address(calibrated(tmp_path, settings)))
    assert (s.gain, s.zero) == (pytest.approx(gain), pytest.approx(zero))


@pytest.mark.parametrize(
    ("then", "now", "other"),
    [
        ("/dev/fake?protocol=ascii", "/dev/fake?unit=N&", ""),
        ("/dev/fake?baud=9600", "/dev/fake?baud=19200&rate=80&", "(baud, rate)"),
        ("/dev/other", "/dev/fake?", "(port)"),
        ("", "/dev/fake?rate=80&", ""),
    ],
)
def test_a_calibration_with_other_settings_is_named(tmp_path: Path, then: str, now: str, other: str) -> None:
    """A device with another range or filter may send other values for the same force."""
    points = [Point(0.0, 100.0, 0.1, 50), Point(50.0, 125.0, 0.1, 50)]
    save(fit(points), tmp_path / "cal.toml", then)
    settings = read_settings(parse_address(f"{now}calibration={tmp_path}/cal.toml"))
    found = [
        text for text in describe(settings, "").warnings if text.startswith("calibrated with other settings")
    ]
    assert [other in text and then in text for text in found] == [True] * bool(other)


def test_what_is_stored_of_a_load_cell() -> None:
    address = (
        "/dev/fake?protocol=aed-standard&unit=kN&sign=-1&capacity=500&max_step=20&zero=3"
        "&mass_reads_force=yes&wire=no&stopbits=1.5"
    )
    info = describe(read_settings(parse_address(address)), "0403:6001:A1")
    assert (info.address, info.name, info.protocol) == (address, "aed-standard on /dev/fake", "aed-standard")
    assert (info.clock, info.sign, info.capacity_N) == ("host", -1, 500.0)
    assert info.settings == {
        "port": "/dev/fake", "line": "2400 7E1.5", "mode": "listen", "unit": "kN", "gain": None, "zero": 3.0,
        "calibration": None, "mass_reads_force": True, "max_step_N": 20.0, "byte_time_s": 0.0,
        "usb": "0403:6001:A1",
    }  # fmt: skip
    assert info.warnings == ("transmission errors are not detected: a changed digit reads as another value",)


def test_an_address_opens_a_serial_load_cell() -> None:
    with open_load_cell("loop://?unit=N&wait=0&sign=-1") as cell:
        info = cell.info
    assert (info.name, info.sign, info.settings["port"]) == ("ascii on loop://", -1, "loop://")


@pytest.mark.parametrize(
    ("protocol", "rate", "start"),
    [
        ("hbm-aed&unit=N&mode=stream", "12", b"ICR3;MSV?0;"),
        ("hbm-aed&unit=N&mode=stream", "0.5", b"ICR7;MSV?0;"),
        ("hbm-aed&unit=N&mode=poll", "12", b"MSV?0;"),
        ("mark10", "7", b"AOUT10\r"),
        ("mark10", "25", b"AOUT25\r"),
        ("mark10", "999", b"AOUT250\r"),
    ],
)
def test_a_stream_is_at_least_as_fast_as_asked(protocol: str, rate: str, start: bytes) -> None:
    """Of a device that is polled the reader keeps the rate."""
    address = f"/dev/fake?protocol={protocol}&rate={rate}"
    assert read_settings(parse_address(address)).commands["start"] == start


def test_how_an_address_tares_is_not_the_command_of_a_preset() -> None:
    s = read_settings(parse_address("/dev/fake?protocol=lines&preset=loadstar&unit=N&tare=device&zero=3"))
    assert (s.given.tare, s.zero, s.commands["tare"]) == ("device", 3.0, b"CT0\r")
    assert "zero" not in s.commands


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("/dev/fake?protocol=nobody", "ascii, mt-sics"),
        ("/dev/fake?foo=1", "unknown setting 'foo'"),
        ("/dev/fake?unit=stone", "not known"),
        ("/dev/fake?protocol=sauter", "unit=N"),
        ("/dev/fake?protocol=modbus", "profile="),
        ("/dev/fake?protocol=lines", "preset="),
        ("/dev/fake?mode=poll", "no command to poll"),
        ("/dev/fake?column=2&millis=2", "must differ"),
        ("nonsense:thing", "no load cell has the scheme"),
    ],
)
def test_wrong_addresses_name_the_key(address: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        read_settings(parse_address(address))


def test_a_pyserial_url_keeps_its_own_settings() -> None:
    settings = read_settings(parse_address("socket://host:7000?unit=N&logging=debug&baud=115200"))
    assert settings.line.url == "socket://host:7000?logging=debug"
    assert settings.line.baud == 115200 and settings.given.unit == "N"


def test_the_line_is_that_of_the_address_or_of_the_protocol() -> None:
    plain = read_settings(parse_address("/dev/fake?protocol=aed-standard")).line
    assert (plain.baud, plain.bytesize, plain.parity, plain.stopbits) == (2400, 7, "E", 1.0)
    given = "protocol=aed-standard&baud=4800&bytesize=8&parity=O&stopbits=1.5"
    line = read_settings(parse_address(f"/dev/fake?{given}")).line
    assert (line.baud, line.bytesize, line.parity, line.stopbits) == (4800, 8, "O", 1.5)


@pytest.mark.parametrize(
    ("address", "sign"), [("", -1), ("&sign=1", 1), ("&gain=2", 1), ("&gain=2&sign=-1", -1)]
)
def test_the_sign_of_a_protocol_is_not_that_of_a_gain_of_ones_own(address: str, sign: int) -> None:
    assert read_settings(parse_address(f"/dev/fake?protocol=mark10{address}")).sign == sign
