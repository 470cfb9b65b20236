"""Tares of a serial cell: on the line or in the device, refused, forced, undone, and what they leave in the stream."""

from __future__ import annotations

import math
import random

import pytest

from acquire.load_sample import LoadFlag
from tests.acquire.serial_line.fake_port import FIRST, SILENCE, FakeLine, flagged

SICS = "/dev/fake?protocol=mt-sics"


def read(*lines: bytes, address: str = "", passes: int = 4, **more: float) -> FakeLine:
    """A cell that has made so many rounds of these lines."""
    line = FakeLine([FIRST, *lines], address=address, **more)
    line.cell.__enter__()
    line.passes(passes)
    return line


def test_a_line_without_commands_gets_an_offset() -> None:
    line = read(*[b"10 N\r\n"] * 3, b"12 N\r\n")
    line.cell.tare()
    forces = [sample.force for sample in line.passes(1)]
    assert forces == pytest.approx([math.nan, 2.0], nan_ok=True)  # no force is interpolated across it
    (tare,) = line.tares
    assert tare.data == {"offset_N": 10.0, "step_N": 10.0, "forced": False, "undo": False}
    assert (tare.level, tare.text) == ("info", "tared: 10 N is zero now")


def test_a_device_that_can_gets_a_command() -> None:
    line = read(*[b"S S     10.00 N\r\n"] * 3, b"S S      0.00 N\r\n", address=SICS)
    line.cell.tare()
    line.passes(1)
    (tare,) = line.tares
    assert (tare.data["step_N"], tare.data["offset_N"]) == (10.0, None)
    line.cell.undo_tare()
    assert math.isnan(line.passes(1)[0].force)
    assert line.events[-1].data["step_N"] == -10.0


@pytest.mark.parametrize(("tare", "sent"), [("auto", True), ("device", True), ("software", False)])
def test_where_it_is_made_is_said_by_the_address(tare: str, sent: bool) -> None:
    line = read(*[b"S S     10.00 N\r\n"] * 4, address=f"{SICS}&tare={tare}")
    line.cell.tare()
    line.passes(1)
    assert (b"TI\r\n" in line.port.sent, "tare sent to the device under 10 N" in line.told) == (sent, sent)


QUIET = "no valid sample in the last 0.5 s"


@pytest.mark.parametrize(
    ("lines", "address", "words"),
    [
        pytest.param([SILENCE] * 5, "", QUIET, id="no sample"),
        pytest.param([*[b"100 N\r\n"] * 9, *[SILENCE] * 20], "", QUIET, id="silence of two seconds"),
        pytest.param(
            [f"{k} N\r\n".encode() for k in range(20)],
            "",
            "the load is not still: it moved by 19 N",
            id="moving",
        ),
        pytest.param([*[b"1 N\r\n"] * 30, b"90 N\r\n"], "", "not still: it moved by 89 N", id="a step"),
        pytest.param([*[b"S S   1.00 N\r\n"] * 9, b"S +\r\n"], SICS, "in overload", id="overload"),
        pytest.param(
            [b"S D   1.00 N\r\n"] * 9,
            SICS,
            "9 of the 9 samples of the last 0.5 s are unstable",
            id="unstable",
        ),
        pytest.param([b"1 N\r\n"], "", "only 1 samples", id="one sample"),
    ],
)
def test_without_a_still_load_it_is_refused_unless_forced(
    lines: list[bytes], address: str, words: str
) -> None:
    line = read(*lines, address=address, passes=len(lines) + 1)
    line.cell.tare()
    line.passes(2)
    assert any(text.startswith("not tared: ") and words in text for text in line.told), line.told
    assert line.tares == []
    line.cell.tare(force=True)
    line.passes(1)
    some = any(lines)
    assert [tare.data["forced"] for tare in line.tares] == [True] * some
    assert some or any("nothing to tare" in text for text in line.told)


def test_a_still_load_with_noise_is_tared_and_not_forced() -> None:
    rng = random.Random(3)
    line = read(*[f"{100 + rng.gauss(0, 1):.1f} N\r\n".encode() for _ in range(60)], passes=60)
    line.cell.tare(force=True)
    line.passes(1)
    assert [tare.data["forced"] for tare in line.tares] == [False]


def test_tares_are_undone_one_after_the_other() -> None:
    line = read(*[b"10 N\r\n"] * 4, *[b"30 N\r\n"] * 30, passes=5)
    shown = []
    for order, how in (
        *[(line.cell.tare, {"force": True})] * 2,
        *[(line.cell.undo_tare, {})] * 3,
    ):
        order(**how)
        shown.append(line.passes(5)[-1].force)
    # The second tare is forced while the force has just jumped: zero is the mean of both.
    assert shown == pytest.approx([20.0, shown[1], 20.0, 30.0, 30.0])
    assert line.told[-2:] == ["the last tare is undone: forces rise by 10 N", "there is no tare to undo"]
    assert line.events[-2].data == {"offset_N": 0.0, "step_N": -10.0, "forced": False, "undo": True}
    assert (line.events[-1].level, line.events[-1].data) == ("warning", {"tared": False})


def test_what_comes_while_a_device_tares_is_late() -> None:
    """The hole, three samples within 0.3 s, and the rest."""
    line = read(*[b"S S     10.00 N\r\n"] * 10, address=SICS, pace=0.08)
    line.cell.tare()
    assert flagged(line.passes(5), LoadFlag.STALE) == [True, True, True, True, False, False]


def test_a_stamp_before_a_tare_counts_as_that_of_the_tare() -> None:
    """The device's own stamps may be older than the instant at which zero moved here."""
    stamped = [f"{t},10 N\r\n".encode() for t in range(1000, 1050, 10)]
    address = "/dev/fake?millis=1&unit=N&wire=no"
    line = read(*stamped, *[SILENCE] * 4, b"1060,10 N\r\n", address=address, passes=9)
    line.cell.tare(force=True)
    hole, *after = line.passes(3)
    assert math.isnan(hole.force) and hole.raw == b"" and LoadFlag.STALE in hole.flags
    assert hole.t == pytest.approx(100.36), "five lines 10 ms apart, and silence"
    assert [sample.t for sample in after] == [hole.t]
