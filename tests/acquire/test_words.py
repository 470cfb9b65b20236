"""Words for a person, and what is kept of a test, by value."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError, DeviceError, Interrupted, MachineUnfit, PhasedicError
from acquire.load_sample import LoadFlag, LoadSample
from acquire.record_mode import RecordMode
from acquire.text.message import brief, counted, duration, printable, share_text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/dev/ttyUSB0?unit=N&baud=9600: lost", "/dev/ttyUSB0: lost"),
        ("sim:?fps=5", "sim:"),
        ("sim:?fps=5 stalled", "sim:?fps=5 stalled"),  # no end of an address
        ("files:a?b/c.tif: no image", "files:a?b/c.tif: no image"),
        ("files:x?fps=5/c.tif: no image", "files:x?fps=5/c.tif: no image"),
        ("the camera sim:?fps=5: lost", "the camera sim:?fps=5: lost"),
    ],
)
def test_a_sentence_without_the_settings_of_its_address(text: str, shown: str) -> None:
    assert brief(text) == shown


@pytest.mark.parametrize(("n", "text"), [(0, "0 frames"), (1, "1 frame"), (2, "2 frames")])
def test_things_are_counted(n: int, text: str) -> None:
    assert counted(n, "frame") == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0:00"),
        (-5, "0:00"),
        (9.6, "0:10"),
        (59.6, "1:00"),
        (83, "1:23"),
        (3599.4, "59:59"),
        (3723, "1:02:03"),
    ],
)
def test_a_duration_in_words(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (1.0, ""),
        (0.999, "of 99 % of the area"),
        (0.9999999, "of 99 % of the area"),
        (0.836, "of 83 % of the area"),
        (float(np.float32(0.83)), "of 83 % of the area"),
        (0.0, "of 0 % of the area"),
    ],
)
def test_a_part_of_an_area_is_never_all_of_it(share: float, text: str) -> None:
    assert share_text(share) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\ufeffa\u00ad\u200bb", "\\ufeffa\\xad\\u200bb"),
        ("\ud800", "\\ud800"),
        ("\udc80\udcff", "\\x80\\xff"),
        ("\udc7f", "\\udc7f"),
        ("\udd00", "\\udd00"),
    ],
)
def test_what_is_not_seen_is_written_as_an_escape(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_each_kind_of_error_ends_with_its_code() -> None:
    kinds = (PhasedicError, ConfigError, DeviceError, DataError, MachineUnfit, Interrupted)
    assert [kind.exit_code for kind in kinds] == [1, 2, 3, 4, 6, 130]


def test_flags_are_the_bits_that_stand_in_files() -> None:
    assert {flag.name: flag.value for flag in LoadFlag} == {
        "OVERLOAD": 1, "UNDERLOAD": 2, "UNSTABLE": 4, "ERROR": 8, "STALE": 16, "NET": 32, "PEAK": 64,
        "OUT_OF_RANGE": 128, "STEP": 256,
    }  # fmt: skip
    plain = LoadSample(1.0, 2.0)
    assert (plain.unit, plain.stable, plain.flags, plain.raw, plain.device_ms) == (
        "N",
        None,
        LoadFlag(0),
        b"",
        None,
    )


@pytest.mark.parametrize(
    ("text", "utc"),
    [
        ("2026-05-09T07:35:25.123456Z", datetime(2026, 5, 9, 7, 35, 25, 123456, UTC)),
        ("2026-05-09T07:35:25", datetime(2026, 5, 9, 7, 35, 25, 0, UTC)),
        ("2026-05-09T09:35:25+02:00", datetime(2026, 5, 9, 9, 35, 25, 0, timezone(timedelta(hours=2)))),
    ],
)
def test_a_time_without_a_zone_is_utc(text: str, utc: datetime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "XYZ-13")
    time.tzset()
    assert ClockPair.from_iso(3.5, text) == ClockPair(3.5, utc)
    monkeypatch.undo()
    time.tzset()


# -- what is recorded -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["all ", "bursts2", "every=2x", "every=2 ", "xevery=2", "every=1234567890", ""]
)
def test_a_mode_is_the_whole_word(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        RecordMode.parse(text)
    assert "allowed: 'all', 'bursts', 'every=K' or 'cycles=K' with K from 1" in str(caught.value)


def test_a_mode_keeps_its_crop_and_the_first_frame() -> None:
    mode = RecordMode.parse("every=3", (1, 2, 3, 4))
    assert (mode.kind, mode.every, mode.crop, mode.text()) == ("every", 3, (1, 2, 3, 4), "every=3")
    assert [k for k in range(8) if mode.keeps(k)] == [0, 3, 6]
    assert (
        RecordMode.parse("all", (1, 2, 3, 4)).crop
        == RecordMode.parse("bursts", (1, 2, 3, 4)).crop
        == (1, 2, 3, 4)
    )


@pytest.mark.parametrize("crop", [(0, 0, 40, 30), (39, 29, 1, 1), (10, 0, 30, 1), (0, 20, 1, 10)])
def test_a_crop_may_reach_to_the_edges(crop: tuple[int, int, int, int]) -> None:
    RecordMode(crop=crop).check(40, 30)


@pytest.mark.parametrize(
    "crop", [(0, 0, 41, 30), (0, 0, 40, 31), (40, 0, 1, 1), (0, 30, 1, 1), (0, -1, 5, 5), (0, 0, 5, 0)]
)
def test_a_crop_may_not_reach_beyond(crop: tuple[int, int, int, int]) -> None:
    with pytest.raises(ConfigError, match=r"leaves the picture of 40 x 30 px; give x,y,width,height"):
        RecordMode(crop=crop).check(40, 30)


def test_what_is_cut_out_is_x_y_width_height() -> None:
    image = np.arange(12).reshape(3, 4)
    assert RecordMode(crop=(1, 0, 2, 3)).cut(image).tolist() == [[1, 2], [5, 6], [9, 10]]
    assert RecordMode().cut(image) is image
