"""The serial load cell over scripts of what may happen on a line."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.events import EventKind
from acquire.load_sample import LoadFlag
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import QUICK, SILENCE, STALL, FakeLine, FakePort

FIRST = b"partial\r\n"


def forces(line: FakeLine) -> list[float]:
    return [sample.force for sample in line.run()]


def test_lines_become_newtons() -> None:
    line = FakeLine([FIRST, b"1.5 N\r\n2.5 kN\r\n", b"-3 mN\r\n"])
    assert forces(line) == pytest.approx([1.5, 2500.0, -0.003])


@pytest.mark.parametrize(
    ("unit", "newtons"),
    [("N", 1.0), ("kN", 1e3), ("kgf", 9.80665), ("lbf", 4.4482216153), ("daN", 10.0)],
)
def test_the_unit_of_the_address_where_the_line_has_none(unit: str, newtons: float) -> None:
    assert forces(FakeLine([FIRST, b"2\r\n"], address=f"/dev/fake?unit={unit}")) == pytest.approx(
        [2 * newtons]
    )


def test_mass_reads_force_only_when_said() -> None:
    with pytest.raises(ConfigError, match="mass_reads_force=yes"):
        read_settings(parse_address("/dev/fake?unit=kg"))
    address = "/dev/fake?unit=kg&mass_reads_force=yes"
    assert forces(FakeLine([FIRST, b"2\r\n"], address=address)) == pytest.approx([19.6133])


def test_a_mass_on_the_line_is_refused_at_the_start() -> None:
    with pytest.raises(ConfigError, match=r"mass_reads_force=yes.*12.5 kg"):
        FakeLine([FIRST, b"12.5 kg\r\n"], address="/dev/fake", wait="5")


def test_no_unit_anywhere_is_refused_at_the_start() -> None:
    with pytest.raises(ConfigError, match="unit=N"):
        FakeLine([FIRST, b"12.5\r\n"], address="/dev/fake", wait="5")


def test_a_mass_in_mid_test_gives_no_force_and_is_told_once() -> None:
    line = FakeLine([FIRST, b"1 N\r\n", b"2 kg\r\n", b"3 kg\r\n", b"4 N\r\n"])
    samples = line.run()
    assert [s.force for s in samples] == pytest.approx([1.0, math.nan, math.nan, 4.0], nan_ok=True)
    assert LoadFlag.ERROR in samples[1].flags
    assert sum("no force from now on" in text for text in line.told) == 1
    assert any("unit on the line changed from N to kg" in text for text in line.told)


def test_a_force_in_another_unit_in_mid_test_stays_right() -> None:
    line = FakeLine([FIRST, b"1000 N\r\n", b"1 kN\r\n"])
    assert forces(line) == [1000.0, 1000.0]


@pytest.mark.parametrize(("address", "force"), [("", 5.0), ("&sign=-1", -5.0)])
def test_sign(address: str, force: float) -> None:
    assert forces(FakeLine([FIRST, b"5\r\n"], address=f"/dev/fake?unit=N{address}")) == [force]


def test_mark10_shows_tension_as_negative() -> None:
    line = FakeLine([FIRST, b"-18.78 lbF\r\n"], address="/dev/fake?protocol=mark10")
    assert forces(line) == pytest.approx([18.78 * 4.4482216153])
    assert isinstance(line.ports[0], FakePort) and line.ports[0].sent == [b"AOUT10\r", b"AOUT0\r"]


def test_gain_and_zero_of_a_calibration() -> None:
    line = FakeLine([FIRST, b"1100\r\n"], address="/dev/fake?gain=0.5&zero=100")
    assert forces(line) == [500.0]


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


def test_beyond_the_capacity_is_an_overload_where_the_line_has_no_mark() -> None:
    line = FakeLine([FIRST, b"99\r\n101\r\n-101\r\n"], address="/dev/fake?unit=N&capacity=100")
    samples = line.run()
    assert [s.force for s in samples] == pytest.approx([99, math.nan, math.nan], nan_ok=True)
    assert samples[1].flags & LoadFlag.OVERLOAD and samples[2].flags & LoadFlag.UNDERLOAD


def test_beyond_the_capacity_is_a_flag_where_the_device_judges_itself() -> None:
    line = FakeLine([FIRST, b"S S     101.00 N\r\n"], address="/dev/fake?protocol=mt-sics&capacity=100")
    (sample,) = line.run()
    assert sample.force == 101 and LoadFlag.OUT_OF_RANGE in sample.flags


def test_a_step_too_large_is_a_flag() -> None:
    line = FakeLine(
        [FIRST, b"1\r\n", b"2\r\n", b"900\r\n", b"901\r\n"], address="/dev/fake?unit=N&max_step=10"
    )
    assert [LoadFlag.STEP in s.flags for s in line.run()] == [False, False, True, False]


def test_garbage_keeps_its_bytes_and_is_told_after_a_while() -> None:
    line = FakeLine([FIRST, *[b"\xff\x00x\r\n"] * 12])
    samples = line.run()
    assert all(s.raw == b"\xff\x00x" and LoadFlag.ERROR in s.flags for s in samples)
    assert sum("lines in a row give no reading" in text for text in line.told) == 1


def test_a_line_split_over_reads() -> None:
    assert forces(FakeLine([FIRST, b"12", b".5 ", b"N\r", b"\n"])) == [12.5]


# -- time -----------------------------------------------------------------------------------


def test_a_sample_began_its_transmission_time_before_the_read() -> None:
    line = FakeLine([FIRST, b"1.25 N\r\n"], address="/dev/fake?baud=9600")
    (sample,) = line.run(silences=0)
    assert sample.t == pytest.approx(100.02 - 8 * 10 / 9600, abs=1e-9)


def test_times_never_go_back() -> None:
    times = [s.t for s in FakeLine([FIRST, b"1 N\r\n" * 50, b"2 N\r\n" * 50], pace=1e-4).run()]
    assert times == sorted(times) and len(times) == 100


def test_a_burst_of_late_lines_is_flagged_stale_but_for_the_last() -> None:
    line = FakeLine([FIRST, b"1 N\r\n", SILENCE, SILENCE, b"2 N\r\n3 N\r\n4 N\r\n"])
    assert [LoadFlag.STALE in s.flags for s in line.run()] == [False, True, True, False]


def test_device_milliseconds_replace_the_jitter_of_arrival() -> None:
    script: list[bytes | Exception] = [FIRST]
    script += [f"{1000 + 10 * k},{k} N\r\n".encode() for k in range(5)]
    script += [SILENCE, b"".join(f"{1000 + 10 * k},{k} N\r\n".encode() for k in range(5, 10))]
    samples = FakeLine(script, address="/dev/fake?millis=1&unit=N&wire=no").run()
    steps = [b.t - a.t for a, b in pairwise(samples)]
    assert steps == pytest.approx([0.01] * 9, abs=3e-4)


def millis_lines(*times: int) -> list[bytes | Exception]:
    return [f"{t},1 N\r\n".encode() for t in times]


def test_a_restarted_device_clock_is_doubted_told_and_tied_anew() -> None:
    script = [FIRST, *millis_lines(*range(5000, 5100, 10)), *millis_lines(*range(0, 1000, 10))]
    line = FakeLine(script, address="/dev/fake?millis=1&unit=N&wire=no")
    samples = line.run()
    stale = [LoadFlag.STALE in s.flags for s in samples]
    assert stale == [False] * 10 + [True] * 50 + [False] * 50
    assert [b.t - a.t for a, b in pairwise(samples)] == pytest.approx([0.01] * 109, abs=1e-3)
    assert sum("clock jumped" in text for text in line.told) == 1


def test_old_lines_with_old_stamps_are_doubted_and_the_clock_stays_tied() -> None:
    script = [FIRST, *millis_lines(*range(5000, 5100, 10))]
    script.append(b"".join(f"{t},1 N\r\n".encode() for t in range(1000, 3000, 10)))
    line = FakeLine([*script, *millis_lines(*range(5110, 5200, 10))], address="/dev/fake?millis=1&unit=N")
    stale = [LoadFlag.STALE in s.flags for s in line.run()]
    assert stale == [False] * 10 + [True] * 200 + [False] * 9
    assert not any("clock jumped" in text for text in line.told)


def test_lines_of_unknown_age_at_the_start_do_not_tie_the_device_clock() -> None:
    old = b"".join(f"{t},1 N\r\n".encode() for t in range(1000, 4000, 10))
    new = [f"{t},2 N\r\n".encode() for t in range(60_000, 62_000, 100)]
    line = FakeLine([FIRST, STALL, old, *new], address="/dev/fake?millis=1&unit=N&wire=no", pace=0.06)
    samples = line.run()
    assert [s.force for s in samples if LoadFlag.STALE not in s.flags] == [2.0] * 20
    assert sum(LoadFlag.STALE in s.flags for s in samples) == 300
    assert not any("clock jumped" in text for text in line.told)


def test_old_lines_without_stamps_are_too_many_for_their_time() -> None:
    script: list[bytes | Exception] = [FIRST, *[b"1 N\r\n"] * 100, b"2 N\r\n" * 50, *[b"1 N\r\n"] * 40]
    stale = [LoadFlag.STALE in s.flags for s in FakeLine(script).run()]
    assert stale == [False] * 100 + [True] * 74 + [False] * 16


def test_lines_after_a_stall_are_late_though_each_comes_in_a_read_of_its_own() -> None:
    line = FakeLine([FIRST, *[b"1 N\r\n"] * 200, STALL, *[QUICK] * 80, *[b"1 N\r\n"] * 20], pace=0.05)
    samples = line.run()
    stale = [LoadFlag.STALE in s.flags for s in samples]
    assert stale == [False] * 200 + [True] * 79 + [False] * 21


def test_a_device_that_pauses_is_late_for_a_moment_only() -> None:
    line = FakeLine([FIRST, *[b"1 N\r\n"] * 200, STALL, *[b"1 N\r\n"] * 100])
    stale = [LoadFlag.STALE in s.flags for s in line.run()]
    assert stale == [False] * 200 + [True] * 25 + [False] * 75


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
    assert forces(line) == [1.0, 3.0]
    lost = next(text for text in line.told if text.startswith("lost"))
    assert "last good sample 1 N" in lost
    assert "connected again" in line.told
    assert isinstance(line.ports[0], FakePort) and line.ports[0].closed == 1


def test_a_stream_is_started_again_after_a_loss() -> None:
    address = "/dev/fake?protocol=mt-sics"
    line = FakeLine([FIRST, OSError(5, "gone")], [FIRST, b"S S     1.00 N\r\n"], address=address)
    assert forces(line) == [1.0]
    assert isinstance(line.ports[1], FakePort) and line.ports[1].sent[0] == b"SIR\r\n"


def test_a_missing_port_fails_the_start() -> None:
    with pytest.raises(DeviceError, match="gone"):
        FakeLine(DeviceError("gone"))


def test_a_silent_device_does_not_fail_the_start_but_is_told() -> None:
    line = FakeLine([SILENCE], wait="1")
    assert any("no reading within 1 s: nothing came" in text for text in line.told)


def test_a_device_that_says_other_things_is_told_so_at_the_start() -> None:
    line = FakeLine([FIRST, *[b"hello\r\n"] * 5], wait="1")
    assert any("5 lines came, none of them a reading of ascii" in text for text in line.told)


def test_what_waited_since_the_opening_is_thrown_away() -> None:
    line = FakeLine([FIRST, b"1 N\r\n2 N\r\n3", b" N\r\n4 N\r\n"], wait="5")
    assert forces(line) == [4.0]


# -- commands ---------------------------------------------------------------------------------


def taring(*lines: bytes, address: str = "", passes: int = 4, **how: bool) -> tuple[FakeLine, list[float]]:
    """A tare after so many of these lines; the forces of the others."""
    line = FakeLine([FIRST, *lines], address=address)
    line.cell.__enter__()
    for _ in range(passes):
        line.cell._pass()
    line.cell.tare(**how)
    return line, [s.force for _ in range(len(lines) + 1 - passes) for s in line.cell._pass()]


def test_tare_of_a_line_without_commands_is_an_offset() -> None:
    line, forces = taring(*[b"10 N\r\n"] * 3, b"12 N\r\n")
    assert forces == pytest.approx([math.nan, 2.0], nan_ok=True)  # no force is interpolated across it
    (tare,) = [event for event in line.events if event.kind is EventKind.TARE]
    assert tare.data == {"offset_N": 10.0, "step_N": 10.0, "forced": False, "undo": False}


def test_tare_of_a_device_that_can_is_a_command() -> None:
    lines = [b"S S     10.00 N\r\n"] * 3
    line, _ = taring(*lines, b"S S      0.00 N\r\n", address="/dev/fake?protocol=mt-sics")
    assert isinstance(line.ports[0], FakePort) and b"TI\r\n" in line.ports[0].sent
    (tare,) = [event for event in line.events if event.kind is EventKind.TARE]
    assert tare.data["step_N"] == 10.0 and tare.data["offset_N"] is None
    line.cell.undo_tare()
    assert math.isnan(line.cell._pass()[0].force)
    assert line.events[-1].data["step_N"] == -10.0


NOT_STILL = {
    "no sample": ([SILENCE] * 5, "", "no valid sample in the last 0.5 s"),
    "silence of two seconds": (
        [*[b"100 N\r\n"] * 9, *[SILENCE] * 20],
        "",
        "no valid sample in the last 0.5 s",
    ),
    "moving": ([f"{k} N\r\n".encode() for k in range(20)], "", "the load is not still: it moved by 19 N"),
    "a step": ([*[b"1 N\r\n"] * 30, b"90 N\r\n"], "", "not still: it moved by 89 N"),
    "overload": ([*[b"S S   1.00 N\r\n"] * 9, b"S +\r\n"], "mt-sics", "in overload"),
    "unstable": ([b"S D   1.00 N\r\n"] * 9, "mt-sics", "9 of the 9 samples of the last 0.5 s are unstable"),
    "one sample": ([b"1 N\r\n"], "", "only 1 samples"),
}


@pytest.mark.parametrize("name", NOT_STILL)
def test_a_tare_without_a_still_load_is_refused_unless_forced(name: str) -> None:
    lines, protocol, words = NOT_STILL[name]
    address = f"/dev/fake?protocol={protocol}" if protocol else ""
    line, _ = taring(*lines, address=address, passes=len(lines) + 1)
    line.cell._pass()
    assert any(text.startswith("not tared: ") and words in text for text in line.told), line.told
    assert not any(event.kind is EventKind.TARE for event in line.events)
    line.cell.tare(force=True)
    line.cell._pass()
    tares = [event for event in line.events if event.kind is EventKind.TARE]
    assert [tare.data["forced"] for tare in tares] == ([] if name == "no sample" else [True])
    assert tares or any("nothing to tare" in text for text in line.told)


def test_a_still_load_with_noise_is_tared() -> None:
    rng = random.Random(3)
    lines = [f"{100 + rng.gauss(0, 1):.1f} N\r\n".encode() for _ in range(60)]
    line, _ = taring(*lines, passes=len(lines))
    assert any(event.kind is EventKind.TARE for event in line.events), line.told


def test_tares_are_undone_one_after_the_other() -> None:
    line = FakeLine([FIRST, *[b"10 N\r\n"] * 4, *[b"30 N\r\n"] * 30])
    with line.cell as cell:
        shown = []
        for order in (None, cell.tare, cell.tare, cell.undo_tare, cell.undo_tare, cell.undo_tare):
            if order is not None:
                order(**({"force": True} if order == cell.tare else {}))
            shown.append([s.force for _ in range(5) for s in cell._pass()][-1])
    # The second tare is forced while the force has just jumped: zero is the mean of both.
    assert shown == pytest.approx([10.0, 20.0, shown[2], 20.0, 30.0, 30.0])
    assert "there is no tare to undo" in line.told


def test_polling_asks_once_and_waits_for_the_answer() -> None:
    line = FakeLine([], address="/dev/fake?protocol=sauter&unit=N&rate=10", answers={b"9": b"1021.15"})
    with line.cell:
        samples = [s for _ in range(8) for s in line.cell._pass()]
    port = line.ports[0]
    assert isinstance(port, FakePort)
    assert [s.force for s in samples] == pytest.approx([21.15] * 4)
    assert port.sent.count(b"9") == 4
    steps = [b.t - a.t for a, b in pairwise(samples)]
    assert steps == pytest.approx([0.1] * 3)


def test_stop_ends_the_iteration_and_closes_the_port() -> None:
    line = FakeLine([FIRST, b"1 N\r\n" * 3])
    with line.cell as cell:
        for _ in cell:
            cell.stop()
    assert isinstance(line.ports[0], FakePort) and line.ports[0].closed == 1
    line.cell.close()


# -- addresses --------------------------------------------------------------------------------


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
        ("/dev/fake?baud=1", "baud=1"),
        ("/dev/fake?sign=2", "sign=2"),
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


@pytest.mark.parametrize(("rate", "start"), [("7", b"AOUT10\r"), ("25", b"AOUT25\r"), ("999", b"AOUT250\r")])
def test_the_stream_is_at_least_as_fast_as_asked(rate: str, start: bytes) -> None:
    settings = read_settings(parse_address(f"/dev/fake?protocol=mark10&rate={rate}"))
    assert settings.commands["start"] == start
