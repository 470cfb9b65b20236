"""Addresses taken apart and changed, who opens a scheme, and numbers within their bounds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from acquire import addresses as module
from acquire.addresses import (
    Address,
    Options,
    Registry,
    expanded,
    parse_address,
    session_file,
    with_setting,
)
from acquire.bounds import NotAllowed, as_integer, as_number, same_value
from acquire.errors import ConfigError
from acquire.events import Event, EventKind, EventSink, RateLimiter, device_event, ignore_event


@pytest.mark.parametrize(
    ("text", "scheme", "target", "settings"),
    [
        ("/dev/video0", "", "/dev/video0", ()),
        ("sim:", "sim", "", ()),
        ("SIM:hole?fps=60&bits=12", "sim", "hole", (("fps", "60"), ("bits", "12"))),
        ("files:a/shot?.tif?fps=5", "files", "a/shot?.tif", (("fps", "5"),)),
        ("files:a/shot?.tif", "files", "a/shot?.tif", ()),
        ("socket://host:7000?unit=N", "socket", "//host:7000", (("unit", "N"),)),
        ("a:?x=", "a", "", (("x", ""),)),
        ("ab:?x=a%26b%3Dc%20d", "ab", "", (("x", "a&b=c d"),)),
        ("ab:?x=1=2", "ab", "", (("x", "1=2"),)),
        ("/dev/x?1=2", "", "/dev/x?1=2", ()),
        ("/dev/x?a=1&b", "", "/dev/x?a=1&b", ()),
        ("v4l-2+x.y:z", "v4l-2+x.y", "z", ()),
    ],
)
def test_an_address_is_taken_apart(
    text: str, scheme: str, target: str, settings: tuple[tuple[str, str], ...]
) -> None:
    if text.startswith("a:"):  # one letter is a drive, not a scheme
        scheme, target = "", "a:"
    assert parse_address(text) == Address(text, scheme, target, settings)


@pytest.mark.parametrize("name", ["shot?fps=5.tif", "a?b=1"])
@pytest.mark.parametrize("scheme", ["", "files:"])
def test_what_is_the_name_of_a_file_has_no_settings(tmp_path: Path, name: str, scheme: str) -> None:
    text = f"{scheme}{tmp_path}/{name}"
    assert parse_address(text).settings != ()
    (tmp_path / name).touch()
    assert parse_address(text) == Address(text, scheme.rstrip(":"), f"{tmp_path}/{name}", ())


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "is empty"), ("  ", "is empty"), ("sim:?a=1&b=2&a=1", "a setting is given twice")],
)
def test_what_is_no_address(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        parse_address(text)


@pytest.mark.parametrize(
    ("address", "key", "value", "changed"),
    [
        ("sim:", "fps", 30.0, "sim:?fps=30"),
        ("sim:?fps=60&bits=12", "fps", 7.5, "sim:?fps=7.5&bits=12"),
        ("sim:?fps=60&bits=12", "fps", "", "sim:?bits=12"),
        ("sim:?fps=60", "fps", "", "sim:"),
        ("sim:?a=&fps=60", "fps", 1e6, "sim:?a=&fps=1e+06"),
        ("files:x?.tif", "gray", "luma", "files:x?.tif?gray=luma"),
        ("files:x?.tif?gray=luma", "gray", "r", "files:x?.tif?gray=r"),
        ("files:x?.tif?gray=luma", "gray", "", "files:x?.tif"),
        ("files:x??/y?.tif?fps=5", "first", "a", "files:x??/y?.tif?fps=5&first=a"),
        ("ab:", "x", "a&b=c d/e,f:g", "ab:?x=a%26b%3Dc%20d/e,f:g"),
    ],
)
def test_one_setting_is_changed_and_the_others_stay(
    address: str, key: str, value: float | str, changed: str
) -> None:
    assert with_setting(address, key, value) == changed
    if value != "":
        assert dict(parse_address(changed).settings)[key] == (
            value if isinstance(value, str) else f"{value:g}"
        )


def test_a_home_folder_is_that_of_somebody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    assert expanded("~/shots") == Path("/home/me/shots") and expanded("a~b") == Path("a~b")
    with pytest.raises(ConfigError, match="~nobody-of-that-name/a: there is no such user"):
        expanded("~nobody-of-that-name/a")


def test_the_session_of_a_run_is_in_its_folder(tmp_path: Path) -> None:
    assert session_file(tmp_path) == tmp_path
    (tmp_path / "session.h5").touch()
    assert session_file(tmp_path) == tmp_path / "session.h5"
    assert session_file(tmp_path / "session.h5") == tmp_path / "session.h5"


WORDS = dict.fromkeys(("1", "yes", "true", "on", "YES", "On"), True)
WORDS |= dict.fromkeys(("0", "no", "false", "off", "False"), False)


@pytest.mark.parametrize(("word", "meant"), WORDS.items())
def test_words_for_yes_and_no(word: str, meant: bool) -> None:
    assert Options(parse_address(f"sim:?a={word}")).flag("a", not meant) == meant


NUMBER, WHOLE = {"minimum": 0.5, "maximum": 8}, {"minimum": 1, "maximum": 8}


@pytest.mark.parametrize(
    ("kind", "bounds", "values", "allowed"),
    [
        ("flag", {}, ("", "y", "2", "yesno", "ja"), "yes or no"),
        ("number", NUMBER, ("0.4", "8.1", "inf", "nan", "five"), "a number from 0.5 to 8"),
        ("number", {}, ("inf", "-inf", "nan", "1e999"), "a number"),
        ("integer", WHOLE, ("0", "9", "2.0", "1e3", "x"), "a whole number from 1 to 8"),
    ],
    ids=["no word", "no number", "no finite number", "no whole number"],
)
def test_a_value_of_another_kind_or_beyond_its_bounds_is_refused(
    kind: str, bounds: dict[str, float], values: tuple[str, ...], allowed: str
) -> None:
    for value in values:
        with pytest.raises(ConfigError) as caught:
            getattr(Options(parse_address(f"sim:?a={value}")), kind)("a", **bounds)
        assert str(caught.value) == f"sim:?a={value}: a={value} is not possible; allowed: {allowed}"


def test_what_an_address_gives_is_what_it_says() -> None:
    options = Options(parse_address("sim:?fps=0.5&bits=8&seed=-3&lockstep=No&mode=b"))
    assert options.number("fps", minimum=0.5) == 0.5 and options.number("gain", 3.0) == 3.0
    assert options.integer("bits", maximum=8) == 8 and options.integer("seed") == -3
    assert not options.flag("lockstep", True) and options.flag("other", True)
    assert options.choice("mode", ("a", "b"), "a") == "b"
    options.done()


def test_what_nobody_takes_is_refused_with_what_is_known() -> None:
    options = Options(parse_address("sim:?fps=5&nose=1&ear=2"))
    assert options.number("fps") == 5 and options.text("gain") is None and options.text("mode", "a") == "a"
    with pytest.raises(ConfigError) as caught:
        options.done()
    assert str(caught.value).endswith(": unknown setting 'nose'; known: fps, gain, mode")
    assert options.rest() == {"nose": "1", "ear": "2"}
    options.done()
    with pytest.raises(ConfigError, match="unknown setting 'a'; known: none"):
        Options(parse_address("sim:?a=1")).done()


def open_thing(address: Address, sink: EventSink) -> str:
    return f"thing {address.target}"


def list_things() -> list[str]:
    return ["thing 1", "thing 2"]


class Entry:
    """An entry point of another package."""

    def __init__(self, name: str, loaded: Any) -> None:
        self.name, self._loaded = name, loaded

    def load(self) -> Any:
        return self._loaded

    def __lt__(self, other: Entry) -> bool:
        return self.name < other.name


@pytest.fixture
def registry(monkeypatch: pytest.MonkeyPatch) -> Registry[str]:
    """Ours and those of another package."""
    entries = {
        "things": [Entry("theirs", lambda address, sink: f"theirs {address.target}")],
        "lists": [Entry("zeta", lambda: ["z"]), Entry("alpha", lambda: ["a"])],
    }

    def entry_points(group: str, name: str | None = None) -> list[Entry]:
        return [entry for entry in entries.get(group, []) if name in (None, entry.name)]

    monkeypatch.setattr(module, "entry_points", entry_points)
    return Registry(
        "thing",
        "things",
        {"ours": f"{__name__}:open_thing", "": f"{__name__}:open_thing"},
        lists_group="lists",
        lists={"ours": f"{__name__}:list_things"},
        elsewhere=["sim"],
    )


def test_a_scheme_is_opened_by_whoever_has_it(registry: Registry[str]) -> None:
    assert registry.open("ours:7") == registry.open("7") == "thing 7"
    assert registry.open("theirs:7") == "theirs 7"
    registry.register("mine", lambda address, sink: "mine")
    assert registry.open("mine:") == "mine"
    assert registry.schemes() == ["", "mine", "ours", "theirs"]
    with pytest.raises(ConfigError) as caught:
        registry.open("nobody:7")
    assert str(caught.value) == (
        "nobody:7: no thing has the scheme nobody:; known: /dev/..., mine:, ours:, theirs:, sim:"
    )


def test_every_scheme_is_taken_where_somebody_takes_the_rest() -> None:
    registry: Registry[str] = Registry("thing", "no such group", {}, f"{__name__}:open_thing")
    assert registry.open("any:7") == "thing 7"


def test_our_devices_are_listed_first(registry: Registry[str]) -> None:
    listed = [(scheme, one()) for scheme, one in registry.listers()]
    assert listed == [("ours", ["thing 1", "thing 2"]), ("alpha", ["a"]), ("zeta", ["z"])]


# -- bounds -----------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1, 8, 2**70])
def test_whole_numbers_up_to_their_ends(value: int) -> None:
    assert as_integer(value, 1, 2**70) == value


@pytest.mark.parametrize("value", [0, 9, True, 2.0, "3", None])
def test_what_is_no_whole_number_between(value: object) -> None:
    with pytest.raises(NotAllowed, match=r"^a whole number from 1 to 8$"):
        as_integer(value, 1, 8)


@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan, True, "0.5", None])
def test_what_is_no_number_between(value: object) -> None:
    with pytest.raises(NotAllowed, match=r"^a number from 0 to 1$"):
        as_number(value, 0, 1)


def test_bounds_are_said_as_far_as_there_are_any() -> None:
    assert as_number(1) == 1.0 and isinstance(as_number(1), float) and as_number(0.5, 0.5, 0.5) == 0.5
    for bounds, words in (((), "a number"), ((2.5,), "a number from 2.5"), ((-math.inf, 3), "a number to 3")):
        with pytest.raises(NotAllowed, match=f"^{words}$"):
            as_number(math.nan, *bounds)
    with pytest.raises(NotAllowed, match="of fewer digits"):
        as_number(10**400)


@pytest.mark.parametrize(
    ("got", "asked", "same"),
    [
        ("100.009", "100", True), ("100.02", "100", False), ("-100.009", "-100", True), ("0", "0", True),
        ("1e-9", "0", False), ("Off", "off", True), ("Office", "Off", False), ("On", "Off", False),
        ("1", "true", False),
    ],
)  # fmt: skip
def test_what_a_device_has_in_force(got: str, asked: str, same: bool) -> None:
    assert same_value(got, asked) == same


# -- events -----------------------------------------------------------------------------------


def test_a_fault_of_every_frame_is_told_at_once_and_then_as_a_count() -> None:
    limiter = RateLimiter()
    assert [limiter.due(t) for t in (10.0, 10.5, 11.9, 12.0, 13.0, 20.0)] == [1, 0, 0, 3, 0, 2]
    slow = RateLimiter(5.0)
    assert [slow.due(t) for t in (0.0, 4.9, 5.0)] == [1, 0, 2]


def test_an_event_of_a_device_is_a_warning_unless_it_is_said_otherwise() -> None:
    events: list[Event] = []
    device_event(events.append, "sim:", "a word", missing=3)
    device_event(events.append, "sim:", "another", "error")
    assert [(e.kind, e.source, e.text, e.level, e.data) for e in events] == [
        (EventKind.DEVICE, "sim:", "a word", "warning", {"missing": 3}),
        (EventKind.DEVICE, "sim:", "another", "error", {}),
    ]
    assert Event(1.0, EventKind.NOTE, "operator", "x").level == "info"
    ignore_event(events[0])


def test_the_words_of_events_are_those_in_files() -> None:
    assert [kind.value for kind in EventKind] == [
        "start", "stop", "reference", "measured", "new-reference", "tare", "pause", "resume", "record", "alarm",
        "note", "lost", "device", "recorder", "measurement", "view",
    ]  # fmt: skip
