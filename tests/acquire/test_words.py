"""Words for a person, and what is kept of a test, by value."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError, DeviceError, Interrupted, MachineUnfit, PhasedicError
from acquire.load_sample import LoadFlag, LoadSample
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


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (lambda n: counted(n, "frame"), {0: "0 frames", 1: "1 frame", 2: "2 frames"}),
        (
            duration,
            {0: "0:00", -5: "0:00", 9.6: "0:10", 59.6: "1:00", 83: "1:23", 3599.4: "59:59", 3723: "1:02:03"},
        ),
        (share_text, {1.0: "", 0.0: "of 0 % of the area"}),
        (share_text, dict.fromkeys((0.999, 0.9999999), "of 99 % of the area")),  # never all of it
        (share_text, dict.fromkeys((0.836, float(np.float32(0.83))), "of 83 % of the area")),
    ],
    ids=["things are counted", "a duration", "a share", "almost all of it", "a share in whole percent"],
)
def test_a_number_in_words(words: Callable[[float], str], values: dict[float, str]) -> None:
    assert {value: words(value) for value in values} == values


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain, µm/m ± 1\n\tnext", "plain, µm/m ± 1\n\tnext"),
        ("\x1b]0;title\x07\x1b[2J", "\\x1b]0;title\\x07\\x1b[2J"),
        ("a\rb\x9bc\x7f\x00", "a\\x0db\\x9bc\\x7f\\x00"),
        ("right\u202eleft\u2028end", "right\\u202eleft\\u2028end"),
        ("file\udcff", "file\\xff"),
        ("\ufeffa\u00ad\u200bb", "\\ufeffa\\xad\\u200bb"),
        ("\ud800", "\\ud800"),
        ("\udc80\udcff", "\\x80\\xff"),
        ("\udc7f", "\\udc7f"),
        ("\udd00", "\\udd00"),
    ],
)
def test_what_is_not_seen_is_written_as_an_escape(text: str, shown: str) -> None:
    assert printable(text) == shown
    printable(text).encode()


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
