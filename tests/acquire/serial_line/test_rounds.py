"""Rounds of a serial cell by value: polls, times, floods, and the end."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from acquire.load_sample import LoadFlag
from acquire.serial_line import cell as cell_module
from tests.acquire.serial_line.fake_port import FIRST, SILENCE, FakeLine


def polled(line: FakeLine, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """When each poll is sent, from now on, s after the beginning."""
    at, write = list[float](), line.port.write

    def noted(data: bytes, /) -> int:
        at.append(round(line.time.now - 100.0, 6))
        return write(data)

    monkeypatch.setattr(line.port, "write", noted)
    return at


def test_polling_asks_once_and_waits_for_the_answer() -> None:
    line = FakeLine([], address="/dev/fake?protocol=sauter&unit=N&rate=10", answers={b"9": b"1021.15"})
    with line.cell:
        samples = line.passes(8)
    assert [s.force for s in samples] == pytest.approx([21.15] * 4)
    assert line.port.sent.count(b"9") == 4
    assert [b.t - a.t for a, b in pairwise(samples)] == pytest.approx([0.1] * 3)


def test_polls_keep_their_pace_and_are_not_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    line = FakeLine([], address="/dev/fake?protocol=sauter&unit=N&rate=10")
    at = polled(line, monkeypatch)
    for late_s in (0.0, 0.13, 0.0, 4.8, 0.0, 0.0):
        line.time.sleep(late_s)
        line.cell._poll()
    assert at == pytest.approx([0.0, 0.13, 0.2, 5.0, 5.0, 5.1])


def test_a_babble_without_an_answer_is_asked_again_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    line = FakeLine([b"x"] * 120, address="/dev/fake?protocol=sauter&unit=N&rate=10", pace=0.03)
    at = polled(line, monkeypatch)
    samples = line.passes(110)
    assert at == pytest.approx([0.0, 1.02, 2.04, 3.06])
    assert len(samples) == 3 and all(LoadFlag.ERROR in sample.flags for sample in samples)


def test_of_two_answers_to_one_poll_the_first_is_an_old_one() -> None:
    answers = {b"SI\r\n": b"S S     1.00 N\r\nS S     2.00 N\r\n"}
    line = FakeLine([], address="/dev/fake?protocol=mt-sics&mode=poll", answers=answers)
    samples = line.passes(3)
    assert [(s.force, LoadFlag.STALE in s.flags) for s in samples[-2:]] == [(1.0, True), (2.0, False)]


def test_bytes_that_waited_before_the_test_count_for_the_times_of_later_ones() -> None:
    line = FakeLine([FIRST, b"1 N\r\n", b"half a line\r\n", b"4 N\r\n"], address="/dev/fake?unit=N", wait="5")
    line.port._buffer += b"5 N\r\n" * 7
    with line.cell as cell:
        cell._pass()
        (sample,) = cell._pass()
    assert sample.force == 4.0
    assert sample.t == pytest.approx(line.time.now - 5 * 10 / 9600, abs=1e-9)


def test_what_is_skipped_of_floods_is_counted_and_leaves_a_hole() -> None:
    """Twice as much comes as one round takes; what was left after a quarter of a second is skipped, again and again."""
    chunk = (b"1 N\r\n" * 820)[: 2 * cell_module.BLOCK]
    line = FakeLine([FIRST, *[chunk] * 12], address="/dev/fake?unit=N&wire=no", pace=0.1)
    samples = line.run()
    holes = [sample for sample in samples if math.isnan(sample.force) and sample.raw == b""]
    line.cell._report_end()
    assert len(holes) >= 2 and all(LoadFlag.STALE in hole.flags for hole in holes)
    told = line.told[-1].replace("\u202f", "")
    skipped = int(told.partition(" ")[0])
    assert told == f"{skipped} bytes were skipped, since lines came faster than they are read"
    read = sum(len(sample.raw) + 2 for sample in samples if sample.raw)
    assert skipped + read == pytest.approx(12 * len(chunk), abs=10 * len(holes))


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        (
            [(0.0, 0.0), (1000.0, 1.022)],
            "load times are those of the device's clock; readings came 1.4 ms late (rms)",
        ),
        (
            [(1000.0 * k * (1 + 1e-4), float(k)) for k in range(21)],
            "load times are those of the device's clock; readings came 0.0 ms late (rms), drift 100 us/s against this"
            " machine",
        ),
    ],
)
def test_how_the_clock_of_a_device_went_is_told_at_the_end(
    stamps: list[tuple[float, float]], words: str
) -> None:
    line = FakeLine([FIRST])
    for device_ms, arrived in stamps:
        line.cell._device.stamp(device_ms, arrived)
    line.cell._report_end()
    assert [(event.level, event.text) for event in line.events] == [("info", words)]


def test_without_a_clock_of_its_own_nothing_is_told_at_the_end() -> None:
    line = FakeLine([FIRST, b"1 N\r\n"])
    line.run()
    line.cell._report_end()
    assert line.told == []


@pytest.mark.parametrize("waits", [1, 5])
def test_a_first_reading_is_waited_for_as_long_as_the_address_says(waits: int) -> None:
    line = FakeLine([SILENCE] * 100, wait=str(waits))
    assert line.time.now == pytest.approx(100 + waits, abs=0.11)
    assert line.told == [
        f"no reading within {waits} s: nothing came; check protocol, baud and cable ('phasedic identify' listens)"
    ]


def test_a_stream_is_started_once_and_stopped_at_the_end() -> None:
    line = FakeLine([FIRST, b"1.5 N\r\n"], address="/dev/fake?protocol=mark10&rate=60")
    line.run()
    assert line.port.sent == [b"AOUT125\r", b"AOUT0\r"]
    listening = FakeLine([FIRST], address="/dev/fake?protocol=mark10&mode=listen")
    listening.run()
    assert listening.port.sent == []


def test_stop_ends_the_iteration_and_closes_the_port() -> None:
    line = FakeLine([FIRST, b"1 N\r\n" * 3])
    with line.cell as cell:
        for _ in cell:
            cell.stop()
    assert line.port.closed == 1
    cell.close()
