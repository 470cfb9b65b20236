"""The configuration of a run: the sections of a TOML file, overridden by the command line.

Every key has a type, bounds and a default. An unknown key, a wrong type or an impossible value raises a
``ConfigError`` with the name of the key and what is allowed. Every file stores the configuration in force as
JSON (``as_dict``); ``from_dict`` reads it back.
"""

from __future__ import annotations

import dataclasses
import math
import reprlib
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from acquire.bounds import NotAllowed
from acquire.errors import ConfigError, DataError
from acquire.files.picture import read_bytes
from acquire.text import Message, meant
from analysis.evaluate import AUTO_GAUGES
from live.config import sections
from live.config.figures import CYCLE_CHANNELS, channel_names
from live.config.gauges import DEFAULT_KIND, NAME_PATTERN, GaugeTable, gauge_checks
from live.config.values import AUTO, Check, Option, in_px

Section = TypeVar("Section")
MAX_BYTES = 10**6  # of a configuration file
_REMOVED_KEYS = {
    ("measure", "shorten_bursts"): Message(
        "a burst keeps its length; leave it out, and take a smaller measure.burst where the picture moves"
    )
}
"""Keys of earlier versions, with advice: left out of a stored configuration, refused in a new one."""

_SHAPES = (
    frozenset({"specimen.width_mm", "specimen.thickness_mm"}),
    frozenset({"specimen.diameter_mm"}),
    frozenset({"specimen.area_mm2"}),
)
"""Keys that say the section in one way."""


@dataclass(frozen=True, slots=True)
class Config:
    """All sections, the virtual gauges by name, and free metadata (specimen, operator, material, note ...)."""

    camera: sections.CameraConfig = field(default_factory=sections.CameraConfig)
    load: sections.LoadConfig = field(default_factory=sections.LoadConfig)
    measure: sections.MeasureConfig = field(default_factory=sections.MeasureConfig)
    scale: sections.ScaleConfig = field(default_factory=sections.ScaleConfig)
    lens: sections.LensConfig = field(default_factory=sections.LensConfig)
    record: sections.RecordConfig = field(default_factory=sections.RecordConfig)
    operate: sections.OperateConfig = field(default_factory=sections.OperateConfig)
    strain_out: sections.StrainOutConfig = field(default_factory=sections.StrainOutConfig)
    view: sections.ViewConfig = field(default_factory=sections.ViewConfig)
    specimen: sections.SpecimenConfig = field(default_factory=sections.SpecimenConfig)
    output: sections.OutputConfig = field(default_factory=sections.OutputConfig)
    alarm: tuple[sections.AlarmConfig, ...] = ()
    gauges: Mapping[str, GaugeTable] = field(default_factory=dict)
    plate: Mapping[str, sections.PlateConfig] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Nested plain values for JSON: the keys of each section, the alarms by number."""
        plain = dataclasses.asdict(self)
        for name, used in (("plate", bool(self.plate)), ("lens", self.lens != sections.LensConfig())):
            if not used:  # a section that versions before do not have
                del plain[name]
        return plain | {"alarm": {str(n): alarm for n, alarm in enumerate(plain["alarm"], 1)}}


_SECTIONS: dict[str, type] = {
    f.name: f.default_factory  # type: ignore[misc]
    for f in dataclasses.fields(Config)
    if f.name not in ("metadata", "gauges", "alarm", "plate")
}


def options() -> dict[str, tuple[str, dataclasses.Field[Any]]]:
    """The options of the command line: name to ("section.key", field of the section)."""
    found = {}
    for name, kind in _SECTIONS.items():
        for field_ in dataclasses.fields(kind):
            option: Option | None = field_.metadata["option"]
            if option is not None:
                found[option.name] = (f"{name}.{field_.name}", field_)
    return found


def load_config(path: Path | None, overrides: Mapping[str, Any], text: str | None = None) -> Config:
    """Read ``path`` and apply ``overrides`` ("measure.zoi" -> 32); ``text`` is what the file is to hold.

    Raises
    ------
    ConfigError
        Missing or malformed file, unknown key, wrong type, impossible value.
    """
    return _overlaid(
        {} if path is None else _read_toml(path, text),
        overrides,
        str(path) if path else Message("command line"),
    )


def other_shapes(given: Mapping[str, Any]) -> frozenset[str]:
    """Keys of a section said in another way, which ``given`` ("section.key" -> value) replaces."""
    named = {key for key, value in given.items() if value is not None}
    used = [shape for shape in _SHAPES if shape & named]
    return frozenset().union(*_SHAPES).difference(*used) if used else frozenset()


def two_sections(specimen: Mapping[str, Any]) -> list[str]:
    """Two ways in which keys of [specimen] say the section; empty where they say it in one, or not."""
    given = {f"specimen.{key}" for key, value in specimen.items() if value is not None}
    ways = [" and ".join(sorted(shape & given, reverse=True)) for shape in _SHAPES if shape & given]
    return ways[:2] if len(ways) > 1 else []


def laid_over(lower: Mapping[str, Any], upper: Mapping[str, Any]) -> dict[str, Any]:
    """``upper`` over ``lower``, both "section.key" -> value."""
    gone = other_shapes(upper)
    return {key: value for key, value in lower.items() if key not in gone} | dict(upper)


def from_dict(stored: Mapping[str, Any], overrides: Mapping[str, Any], where: str) -> Config:
    """The configuration stored in a file, with ``overrides`` applied; raises ConfigError.

    Keys that only earlier versions have are left out.
    """
    tree = _without_none(stored)
    for section, key in _REMOVED_KEYS:
        if isinstance(tree.get(section), dict):
            tree[section].pop(key, None)
    return _overlaid(tree, overrides, where)


def settings_in(path: Path) -> dict[str, Any]:
    """The values that ``path`` sets, "section.key" -> value, checked; raises ConfigError."""
    load_config(path, {})
    tree = _read_toml(path)
    lens = {"lens": tree.pop("lens")} if "lens" in tree else {}  # one calibration, not keys of two
    return lens | {
        f"{name}.{key}": value
        for name, section in tree.items()
        if isinstance(section, Mapping)
        for key, value in section.items()
    }


def lens_in(path: Path) -> dict[str, Any]:
    """The section [lens] of a file; raises ConfigError."""
    table = _plain_toml(path).get("lens")
    if not isinstance(table, Mapping):
        raise ConfigError("{path}: has no section [lens]; phasedic lens makes one", path)
    return dict(table)


def _without_none(stored: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _without_none_in(section) for name, section in stored.items() if section is not None}


def _without_none_in(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _without_none(value)
    return [_without_none_in(one) for one in value] if isinstance(value, list | tuple) else value


def _overlaid(tree: Mapping[str, Any], overrides: Mapping[str, Any], where: str) -> Config:
    merged: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in tree.items()}
    for dotted, value in overrides.items():
        name, _, key = dotted.partition(".")
        if not key:
            merged[name] = value
            continue
        section = merged.setdefault(name, {})
        if isinstance(section, dict):
            section[key] = value
    for name, _, key in (dotted.partition(".") for dotted in other_shapes(overrides)):
        merged[name].pop(key, None)
    _check_given(overrides, merged, where)
    return _build(merged, where)


def _check_given(overrides: Mapping[str, Any], merged: Mapping[str, Any], where: str) -> None:
    """What is impossible on the command line is not to be looked for in the file ``where``."""
    told, px_per_mm = Message("command line"), None
    for name in ("scale", *(name for name in _SECTIONS if name != "scale")):
        content = {key.partition(".")[2]: one for key, one in overrides.items() if key.startswith(f"{name}.")}
        if content:
            _section(_SECTIONS[name], name, content, told, px_per_mm)
        px_per_mm = px_per_mm or _px_per_mm(merged, where)


def _read_toml(path: Path, text: str | None = None) -> dict[str, Any]:
    tree = _plain_toml(path, text)
    if isinstance(tree.get("lens"), str):
        tree["lens"] = lens_in(Path(tree["lens"]))
    if isinstance(specimen := tree.get("specimen"), Mapping) and (ways := two_sections(specimen)):
        raise ConfigError("{path}: {one} and {other} are two sections; leave out one", path, *ways)
    return tree


def _plain_toml(path: Path, text: str | None = None) -> dict[str, Any]:
    if text is None and not path.exists():
        raise ConfigError("{path}: there is no such configuration file", path)
    with as_toml(path):
        return tomllib.loads(toml_text(path) if text is None else text)


def toml_text(path: Path) -> str:
    """The text of a file; raises UnicodeDecodeError for another encoding than UTF-8."""
    content = read_bytes(path, MAX_BYTES)
    if (zero := content.find(b"\0")) >= 0:  # UTF-16
        raise UnicodeDecodeError("utf-8", content, zero, zero + 1, "a zero byte")
    return content.decode("utf-8-sig")


@contextmanager
def as_toml(path: Path) -> Iterator[None]:
    """Around the reading of a file and of its TOML: raises ConfigError where that fails."""
    try:
        yield
    except UnicodeDecodeError:
        raise ConfigError("{path}: is no text in UTF-8; save it so in an editor", path) from None
    except DataError as error:
        raise ConfigError("{path}: cannot be read ({error}); give a text file in TOML", path, error) from None
    except RecursionError:
        raise ConfigError("{path}: not valid TOML: too many brackets within brackets", path) from None
    except ValueError as error:  # of TOML, and a number with thousands of digits
        raise ConfigError("{path}: not valid TOML: {error}", path, error) from None


def _build(tree: Mapping[str, Any], where: str) -> Config:
    known = [*_SECTIONS, "alarm", "gauges", "plate", "metadata"]
    parts: dict[str, Any] = {}
    px_per_mm = _px_per_mm(tree, where)
    for name, content in tree.items():
        if name not in known:
            raise ConfigError(
                "{where}: unknown section [{name}]{suggestion}", where, name, _suggestion(name, known)
            )
        if name == "alarm":
            parts[name] = _alarms(content, where)
        elif not isinstance(content, Mapping):
            raise ConfigError("{where}: {name} must be a section, [{name}] with keys below it", where, name)
        elif name == "metadata":
            parts[name] = dict(content)
        elif name == "gauges":
            parts[name] = {gauge: _gauge(gauge, table, where, px_per_mm) for gauge, table in content.items()}
        elif name == "plate":
            parts[name] = {plate: _plate(plate, table, where, px_per_mm) for plate, table in content.items()}
        else:
            parts[name] = _section(_SECTIONS[name], name, content, where, px_per_mm)
    _check_metadata(parts.get("metadata", {}), where)
    config = Config(**parts)
    _check_channels(config, where)
    return config


def _px_per_mm(tree: Mapping[str, Any], where: str) -> float | None:
    content = tree.get("scale")
    if not isinstance(content, Mapping):
        return None
    return _section(sections.ScaleConfig, "scale", content, where).px_per_mm


def _section(
    kind: type[Section], name: str, content: Mapping[str, Any], where: str, px_per_mm: float | None = None
) -> Section:
    checks = {f.name: f.metadata["check"] for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    return kind(**_accepted(checks, name, content, where, px_per_mm))


def _accepted(
    checks: Mapping[str, Check], name: str, content: Mapping[str, Any], where: str, px_per_mm: float | None
) -> dict[str, Any]:
    values = {}
    for key, value in content.items():
        if (name, key) in _REMOVED_KEYS:
            raise ConfigError(
                "{where}: {name}.{key} is withdrawn: {REMOVED_KEYS}",
                where,
                name,
                key,
                _REMOVED_KEYS[name, key],
            )
        if key not in checks:
            raise ConfigError(
                "{where}: unknown key {name}.{key}{suggestion}",
                where,
                name,
                key,
                _suggestion(key, list(checks)),
            )
        try:
            values[key] = checks[key].accept(in_px(value, checks[key], px_per_mm))
        except NotAllowed as allowed:
            raise ConfigError(
                "{where}: {name}.{key} = {short_repr} is not possible; allowed: {allowed}",
                where,
                name,
                key,
                _short_repr(value),
                allowed,
            ) from None
    return values


def _named_table(dotted: str, table: Any, where: str) -> Mapping[str, Any]:
    """The table ``section.NAME``; raises ConfigError for an impossible name."""
    if not NAME_PATTERN.fullmatch(dotted.partition(".")[2]):
        raise ConfigError(
            "{where}: {dotted}: a name has up to 32 letters, digits and _, a letter first", where, dotted
        )
    if not isinstance(table, Mapping):
        raise ConfigError("{where}: {dotted} must be a table, [{dotted}] with keys below it", where, dotted)
    return table


def _plate(name: str, table: Any, where: str, px_per_mm: float | None) -> sections.PlateConfig:
    dotted = f"plate.{name}"
    plate = _section(sections.PlateConfig, dotted, _named_table(dotted, table, where), where, px_per_mm)
    if plate.box is None:
        raise ConfigError("{where}: {dotted}: give box = [x, y, width, height] in px", where, dotted)
    return plate


def _gauge(name: str, table: Any, where: str, px_per_mm: float | None) -> GaugeTable:
    table = _named_table(f"gauges.{name}", table, where)
    values = _accepted(gauge_checks(table.get("kind")), f"gauges.{name}", table, where, px_per_mm)
    return {"kind": DEFAULT_KIND, **values}


def _alarms(content: Any, where: str) -> tuple[sections.AlarmConfig, ...]:
    if isinstance(content, Mapping):  # by number, as stored in files
        content = list(content.values())
    if not isinstance(content, list | tuple) or not all(isinstance(table, Mapping) for table in content):
        raise ConfigError("{where}: alarm must be tables, [[alarm]] with keys below it", where)
    alarms = tuple(
        _section(sections.AlarmConfig, Message("alarm {number}", number), table, where)
        for number, table in enumerate(content, 1)
    )
    for number, alarm in enumerate(alarms, 1):
        if (alarm.above is None) is (alarm.below is None):
            raise ConfigError("{where}: alarm {number}: give one of above and below", where, number)
        if alarm.of_cycle and alarm.channel not in CYCLE_CHANNELS:
            known = ", ".join(CYCLE_CHANNELS)
            raise ConfigError("{where}: alarm {number}: of_cycle is for {known}", where, number, known)
        if alarm.end_on_unknown and not alarm.end:
            raise ConfigError("{where}: alarm {number}: end_on_unknown needs end = true", where, number)
    return alarms


def _check_channels(config: Config, where: str) -> None:
    placed = AUTO_GAUGES if config.measure.gauges == AUTO else ()
    gauges = dict.fromkeys((*config.gauges, *placed))
    measured, known = channel_names(gauges), channel_names(gauges, system=True)
    used = [("strain_out", channel, measured) for channel in config.strain_out.channels or ()]
    used += [
        (Message("alarm {number}", number), alarm.channel, known)
        for number, alarm in enumerate(config.alarm, 1)
    ]
    for whose, channel, names in used:
        if channel not in names:
            raise ConfigError(
                "{where}: {whose}: unknown channel {channel}{suggestion}",
                where,
                whose,
                repr(channel),
                _suggestion(channel, list(names)),
            )


def _check_metadata(metadata: Mapping[str, Any], where: str) -> None:
    for key, value in metadata.items():
        if (
            not isinstance(value, str | int | float | bool)
            or value in (math.inf, -math.inf)
            or value != value
        ):
            raise ConfigError("{where}: metadata.{key} must be a text or a number, in one line", where, key)


def _short_repr(value: Any) -> str:
    try:
        return reprlib.repr(value)
    except ValueError:  # thousands of digits
        return Message("this number")


def _suggestion(word: str, known: list[str]) -> str:
    return Message("{meant}; known: {listed}", meant(word, known), ", ".join(known))
