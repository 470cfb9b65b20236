"""The serial load cell over scripts of what may happen on a line."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.load_sample import LoadFlag
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import (
    FIRST,
    QUICK,
    SILENCE,
    STALL,
    FakeLine,
    FakePort,
    flagged,
    samples_of,
)

UNITS = {"N": 1.0, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216153, "daN": 10.0}


@pytest.mark.parametrize(
    ("address", "chunks", "forces"),
    [
        pytest.param(
            "unit=N", [b"1.5 N\r\n2.5 kN\r\n", b"-3 mN\r\n"], [1.5, 2500.0, -0.003], id="units of lines"
        ),
        *(pytest.param(f"unit={unit}", [b"2\r\n"], [2 * one], id=unit) for unit, one in UNITS.items()),
        pytest.param("unit=kg&mass_reads_force=yes", [b"2\r\n"], [19.6133], id="a mass that reads force"),
        pytest.param("unit=N", [b"12", b".5 ", b"N\r", b"\n"], [12.5], id="a line split over reads"),
    ],
)
def test_lines_become_newtons(address: str, chunks: list[bytes], forces: list[float]) -> None:
    samples = samples_of(*chunks, address=f"/dev/fake?{address}")
    assert [sample.force for sample in samples] == pytest.approx(forces)


def test_mass_reads_force_only_when_said() -> None:
    with pytest.raises(ConfigError, match="mass_reads_force=yes"):
        read_settings(parse_address("/dev/fake?unit=kg"))


@pytest.mark.parametrize(
    ("line", "words"), [("12.5 kg", r"mass_reads_force=yes.*12.5 kg"), ("12.5", "unit=N")]
)
def test_what_is_no_force_is_refused_at_the_start(line: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        FakeLine([FIRST, f"{line}\r\n".encode()], address="/dev/fake", wait="5")


def test_a_mass_in_mid_test_gives_no_force_and_is_told_once() -> None:
    line = FakeLine([FIRST, b"1 N\r\n", b"2 kg\r\n", b"3 kg\r\n", b"4 N\r\n"])
    samples = line.run()
    assert [s.force for s in samples] == pytest.approx([1.0, math.nan, math.nan, 4.0], nan_ok=True)
    assert LoadFlag.ERROR in samples[1].flags
    assert sum("no force from now on" in text for text in line.told) == 1
    assert any("unit on the line changed from N to kg" in text for text in line.told)


def test_mark10_shows_tension_as_negative() -> None:
    line = FakeLine([FIRST, b"-18.78 lbF\r\n"], address="/dev/fake?protocol=mark10")
    assert [sample.force for sample in line.run()] == pytest.approx([18.78 * 4.4482216153])
    assert line.port.sent == [b"AOUT10\r", b"AOUT0\r"]


def test_overload_is_never_a_number_and_is_told_with_the_last_good_value() -> None:
    line = FakeLine(
        [FIRST, b"ST,GS,+000001.0kN\r\n", b"OL,GS,+9999999.9kN\r\n", b"ST,GS,+000002.0kN\r\n"],
        address="/dev/fake?protocol=aed-standard",
    )
    samples = line.run()
    assert [s.force for s in samples] == pytest.approx([1e3, math.nan, 2e3], nan_ok=True)
    assert LoadFlag.OVERLOAD in samples[1].flags
    assert "load alarm: overload; last valid sample 1000 N" in line.told
    assert "the load is within its range again" in line.told


def test_garbage_keeps_its_bytes_and_is_told_after_a_while() -> None:
    line = FakeLine([FIRST, *[b"\xff\x00x\r\n"] * 12])
    samples = line.run()
    assert all(s.raw == b"\xff\x00x" and LoadFlag.ERROR in s.flags for s in samples)
    assert sum("lines in a row give no reading" in text for text in line.told) == 1


# -- time -----------------------------------------------------------------------------------


def test_a_sample_began_its_transmission_time_before_the_read() -> None:
    line = FakeLine([FIRST, b"1.25 N\r\n"], address="/dev/fake?baud=9600")
    (sample,) = line.run(silences=0)
    assert sample.t == pytest.approx(100.02 - 8 * 10 / 9600, abs=1e-9)


def test_times_never_go_back() -> None:
    times = [s.t for s in FakeLine([FIRST, b"1 N\r\n" * 50, b"2 N\r\n" * 50], pace=1e-4).run()]
    assert times == sorted(times) and len(times) == 100


def lines_at(times: Iterable[int]) -> list[bytes]:
    """Lines with milliseconds of the device."""
    return [f"{t},1 N\r\n".encode() for t in times]


ONE, STAMPED = b"1 N\r\n", lines_at(range(5000, 5100, 10))


@pytest.mark.parametrize(
    ("script", "address", "pace", "stale"),
    [
        pytest.param([ONE, SILENCE, SILENCE, ONE * 3], "", 0.01, (1, 2, 1), id="all of a burst but its last"),
        pytest.param(
            [*[ONE] * 100, ONE * 50, *[ONE] * 40], "", 0.01, (100, 74, 16), id="too many for their time"
        ),
        pytest.param(
            [*[ONE] * 200, STALL, *[QUICK] * 80, *[ONE] * 20],
            "",
            0.05,
            (200, 79, 21),
            id="behind a stall, one a read",
        ),
        pytest.param(
            [*[ONE] * 200, STALL, *[ONE] * 100], "", 0.01, (200, 25, 75), id="a moment after a pause"
        ),
        pytest.param(
            [*STAMPED, b"".join(lines_at(range(1000, 3000, 10))), *lines_at(range(5110, 5200, 10))],
            "/dev/fake?millis=1&unit=N",
            0.01,
            (10, 200, 9),
            id="old stamps leave the clock tied",
        ),
        pytest.param(
            [STALL, b"".join(lines_at(range(1000, 4000, 10))), *lines_at(range(60_000, 62_000, 100))],
            "/dev/fake?millis=1&unit=N&wire=no",
            0.06,
            (0, 300, 20),
            id="lines of unknown age at the start do not tie the clock",
        ),
    ],
)
def test_lines_that_waited_are_stale(
    script: list[bytes | Exception], address: str, pace: float, stale: tuple[int, int, int]
) -> None:
    """So many lines are good, then stale, then good again."""
    line = FakeLine([FIRST, *script], address=address, pace=pace)
    assert flagged(line.run(), LoadFlag.STALE) == [k == 1 for k, n in enumerate(stale) for _ in range(n)]
    assert not any("clock jumped" in text for text in line.told)


def test_device_milliseconds_replace_the_jitter_of_arrival() -> None:
    script = [*STAMPED[:5], SILENCE, b"".join(STAMPED[5:])]
    samples = samples_of(*script, address="/dev/fake?millis=1&unit=N&wire=no")
    assert [b.t - a.t for a, b in pairwise(samples)] == pytest.approx([0.01] * 9, abs=3e-4)


def test_a_restarted_device_clock_is_doubted_told_and_tied_anew() -> None:
    line = FakeLine(
        [FIRST, *STAMPED, *lines_at(range(0, 1000, 10))], address="/dev/fake?millis=1&unit=N&wire=no"
    )
    samples = line.run()
    assert flagged(samples, LoadFlag.STALE) == [False] * 10 + [True] * 50 + [False] * 50
    assert [b.t - a.t for a, b in pairwise(samples)] == pytest.approx([0.01] * 109, abs=1e-3)
    assert sum("clock jumped" in text for text in line.told) == 1


# -- silence, loss, return --------------------------------------------------------------------


def test_silence_is_told_once_with_the_last_good_sample_and_its_end_too() -> None:
    line = FakeLine([FIRST, b"7 N\r\n", *[SILENCE] * 30, b"8 N\r\n"], address="/dev/fake?timeout=1")
    line.run()
    silences = [text for text in line.told if "no reading for 1 s" in text]
    assert len(silences) == 1 and "last good sample 7 N" in silences[0]
    assert line.told[-1] == "readings come again"


@pytest.mark.parametrize(
    "error", [OSError(5, "Input/output error"), TypeError("closed")], ids=lambda e: type(e).__name__
)
def test_an_unplugged_port_is_found_again(error: Exception) -> None:
    first: list[bytes | Exception] = [FIRST, b"1 N\r\n", b"2 ", error]
    line = FakeLine(first, DeviceError("gone"), DeviceError("gone"), [b"5 N\r\n", b"3 N\r\n"])
    assert [sample.force for sample in line.run()] == [1.0, 3.0]
    lost = next(text for text in line.told if text.startswith("lost"))
    assert "last good sample 1 N" in lost
    assert "connected again" in line.told
    assert line.port.closed == 1


def test_a_stream_is_started_again_after_a_loss() -> None:
    address = "/dev/fake?protocol=mt-sics"
    line = FakeLine([FIRST, OSError(5, "gone")], [FIRST, b"S S     1.00 N\r\n"], address=address)
    assert [sample.force for sample in line.run()] == [1.0]
    assert isinstance(line.ports[1], FakePort) and line.ports[1].sent[0] == b"SIR\r\n"


def test_a_missing_port_fails_the_start() -> None:
    with pytest.raises(DeviceError, match="gone"):
        FakeLine(DeviceError("gone"))


def test_a_device_that_says_other_things_is_told_so_at_the_start() -> None:
    line = FakeLine([FIRST, *[b"hello\r\n"] * 5], wait="1")
    assert any("5 lines came, none of them a reading of ascii" in text for text in line.told)


def test_what_waited_since_the_opening_is_thrown_away() -> None:
    line = FakeLine([FIRST, b"1 N\r\n2 N\r\n3", b" N\r\n4 N\r\n"], wait="5")
    assert [sample.force for sample in line.run()] == [4.0]
