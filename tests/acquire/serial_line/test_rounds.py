"""Rounds of a serial cell by value: polls, times, tares, floods, and the end."""

from __future__ import annotations

import math

import pytest

from acquire.events import EventKind
from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line import cell as cell_module
from tests.acquire.serial_line.fake_port import SILENCE, FakeLine, FakePort

FIRST = b"partial\r\n"


def polled(line: FakeLine, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """When each poll is sent, from now on, s after the beginning."""
    (port,), at = line.ports, []
    assert isinstance(port, FakePort)
    write = port.write

    def noted(data: bytes, /) -> int:
        at.append(round(line.time.now - 100.0, 6))
        return write(data)

    monkeypatch.setattr(port, "write", noted)
    return at


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
    samples = [sample for _ in range(110) for sample in line.cell._pass()]
    assert at == pytest.approx([0.0, 1.02, 2.04, 3.06])
    assert len(samples) == 3 and all(LoadFlag.ERROR in sample.flags for sample in samples)


def test_of_two_answers_to_one_poll_the_first_is_an_old_one() -> None:
    answers = {b"SI\r\n": b"S S     1.00 N\r\nS S     2.00 N\r\n"}
    line = FakeLine([], address="/dev/fake?protocol=mt-sics&mode=poll", answers=answers)
    samples = [sample for _ in range(3) for sample in line.cell._pass()]
    assert [(s.force, LoadFlag.STALE in s.flags) for s in samples[-2:]] == [(1.0, True), (2.0, False)]


def test_what_comes_while_a_device_tares_is_late() -> None:
    lines = [b"S S     10.00 N\r\n"] * 10
    line = FakeLine([FIRST, *lines], address="/dev/fake?protocol=mt-sics", pace=0.08)
    with line.cell as cell:
        for _ in range(4):
            cell._pass()
        cell.tare()
        flags = [LoadFlag.STALE in sample.flags for _ in range(5) for sample in cell._pass()]
    assert flags == [True, True, True, True, False, False], (
        "the hole, three samples within 0.3 s, and the rest"
    )


def test_a_stamp_before_a_tare_counts_as_that_of_the_tare() -> None:
    """The device's own stamps may be older than the instant at which zero moved here."""
    script = [FIRST, *[f"{t},10 N\r\n".encode() for t in range(1000, 1050, 10)], *[SILENCE] * 4]
    line = FakeLine([*script, b"1060,10 N\r\n"], address="/dev/fake?millis=1&unit=N&wire=no")
    samples: list[LoadSample] = []
    with line.cell as cell:
        for k in range(12):
            if k == 9:
                cell.tare(force=True)
            samples += cell._pass()
    hole = next(k for k, sample in enumerate(samples) if math.isnan(sample.force))
    assert samples[hole].t == pytest.approx(100.36), "five lines 10 ms apart, and silence"
    assert samples[hole].raw == b"" and LoadFlag.STALE in samples[hole].flags
    assert [sample.t for sample in samples[hole:]] == [samples[hole].t] * 2


@pytest.mark.parametrize(
    ("still", "force", "forced"), [(True, False, False), (True, True, False), (False, True, True)]
)
def test_a_tare_is_forced_where_it_would_have_been_refused(still: bool, force: bool, forced: bool) -> None:
    lines = [b"10 N\r\n"] * 3 if still else [b"10 N\r\n", b"20 N\r\n", b"30 N\r\n"]
    line = FakeLine([FIRST, *lines, b"12 N\r\n"])
    for _ in range(4):
        line.cell._pass()
    line.cell.tare(force=force)
    line.cell._pass()
    (tare,) = [event for event in line.events if event.kind is EventKind.TARE]
    assert tare.data["forced"] is forced and tare.level == "info"
    assert tare.text == f"tared: {10 if still else 20} N is zero now"


def test_words_of_a_tare_that_is_undone() -> None:
    line = FakeLine([FIRST, *[b"10 N\r\n"] * 6])
    with line.cell as cell:
        for order in (None, None, None, None, cell.tare, cell.undo_tare, cell.undo_tare):
            if order is not None:
                order()
            cell._pass()
    assert line.told[-3:] == [
        "tared: 10 N is zero now",
        "the last tare is undone: forces rise by 10 N",
        "there is no tare to undo",
    ]
    assert line.events[-2].data == {"offset_N": 0.0, "step_N": -10.0, "forced": False, "undo": True}
    assert (line.events[-1].level, line.events[-1].data) == ("warning", {"tared": False})


@pytest.mark.parametrize(("tare", "sent"), [("auto", True), ("device", True), ("software", False)])
def test_where_a_tare_is_made_is_said_by_the_address(tare: str, sent: bool) -> None:
    line = FakeLine([FIRST, *[b"S S     10.00 N\r\n"] * 4], address=f"/dev/fake?protocol=mt-sics&tare={tare}")
    for _ in range(4):
        line.cell._pass()
    line.cell.tare()
    line.cell._pass()
    (port,) = line.ports
    assert isinstance(port, FakePort) and (b"TI\r\n" in port.sent) == sent
    assert ("tare sent to the device under 10 N" in line.told) == sent


def test_bytes_that_waited_before_the_test_count_for_the_times_of_later_ones() -> None:
    line = FakeLine([FIRST, b"1 N\r\n", b"half a line\r\n", b"4 N\r\n"], address="/dev/fake?unit=N", wait="5")
    (port,) = line.ports
    assert isinstance(port, FakePort)
    port._buffer += b"5 N\r\n" * 7
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
    (port,) = line.ports
    assert isinstance(port, FakePort) and port.sent == [b"AOUT125\r", b"AOUT0\r"]
    listening = FakeLine([FIRST], address="/dev/fake?protocol=mark10&mode=listen")
    listening.run()
    assert isinstance(listening.ports[0], FakePort) and listening.ports[0].sent == []
