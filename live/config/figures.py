"""The figures of a running test, each declared once: what it is, where its value is from, and where it is shown.

Columns of ``strain.csv`` and ``strain.h5`` come in the order of the table: new ones behind those that are there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from acquire.text import Message

_UNITS = {
    "N": ("force", 1.0), "Pa": ("stress", 1.0), "MPa": ("stress", 1e6), "s": ("", 1.0), "min": ("", 60.0),
    "px": ("pixels", 1.0), "GL": ("", 1.0), "": ("", 1.0),
}  # fmt: skip
"""Unit in a name -> kind of quantity for a person, and what one is in SI units."""

_JOINT = ("mean_", "bending_", "sigma_mean_")


@dataclass(frozen=True, slots=True)
class LiveFigure:
    """A figure of a running test.

    Attributes
    ----------
    name : str
        Of column and channel, with the unit at its end.
    words : str
        Its definition; of a column, empty where that of a map or of its value says it.
    column : str
        Attribute that a column of the results is: ``step.NAME`` (of ``TimeStep``), ``burst.NAME``, or "row", made by
        ``live.results.layout``; empty: no column.
    sigma : bool
        The column has its standard uncertainty behind it, ``sigma_NAME``.
    only : str
        What a test has that has the column ("section", "lag", "lens", "plates"); empty: every test.
    channel : str
        What alarms and strain output take: ``FIGURE.value``, ``.sigma`` or ``.age`` of the snapshot, ``step.NAME`` or
        ``burst.NAME`` of a measurement; or who gives it: "values" (``ChannelValues``), "cycle",
        "machine", "both", "state"; empty: no channel.
    output : int
        Place in the strain output without a choice of channels; 0: only where it is chosen.
    load : bool
        It needs a load cell.
    kind : str
        Of ``acquire.text.quantity.Amount``, which it is shown as; empty: that of its unit.
    label : str
        Its name for a person; empty: that of column and channel.
    live : bool
        All see this attribute (``plain``) of ``TimeStep`` with its age, sigma and reason; the channel is that.
    terminal : int
        Its rank in the status line, which loses the highest first; 0: not there.
    page, display, report : bool
        It is a fact of the page, stands below the large figures, has a curve in the report where it changes.
    above, below : float
        Beyond these it matters, in SI units.
    hidden : bool
        It is shown only where it is not 0.
    """

    name: str
    words: str = ""
    column: str = ""
    channel: str = ""
    sigma: bool = False
    only: str = ""
    output: int = 0
    load: bool = False
    kind: str = ""
    label: str = ""
    live: bool = False
    terminal: int = 0
    page: bool = False
    display: bool = False
    report: bool = False
    above: float = float("inf")
    below: float = -float("inf")
    hidden: bool = False

    def __post_init__(self) -> None:
        if not self.kind:
            object.__setattr__(self, "kind", _UNITS[self.unit][0])
        if self.live:
            object.__setattr__(self, "channel", f"{self.plain}.value")

    @property
    def unit(self) -> str:
        """Unit of column and channel; "" (dimensionless), as of all gauges."""
        last = self.name.rpartition("_")[2]
        return last if last in _UNITS and "gauge_" not in self.name else ""

    @property
    def plain(self) -> str:
        """The name without the unit."""
        return self.name.removesuffix(f"_{self.unit}") if self.unit else self.name

    @property
    def one(self) -> float:
        """One of its unit in SI units."""
        return _UNITS[self.unit][1]

    @property
    def of(self) -> str:
        """The figure of the snapshot that the channel is of, where it is of one."""
        return self.channel.partition(".")[0]

    @property
    def part(self) -> str:
        """What of that figure."""
        return self.channel.partition(".")[2]

    @property
    def columns(self) -> tuple[str, ...]:
        """Its columns, where it has some."""
        return (self.name, f"sigma_{self.name}") if self.sigma else (self.name,)

    @property
    def said(self) -> str:
        """Its name for a person."""
        return self.label or self.plain.replace("_", " ")


# fmt: off
_F, _STRAINS = LiveFigure, ("exx", "eyy", "exy")
FIGURES = (
    _F("frame", "sequence number of the first frame of the burst", "burst.first_index", "burst.first_index", output=2,
       kind="count"),
    _F("time_s", "middle of the burst, since the start of the test", "row", "values", output=1),
    _F("force_N", "force at that time, tension positive; nan where it is not known", "step.force", "force.value",
       output=8, load=True),
    *(_F(name, "", "row", kind="strain", live=True) for name in _STRAINS),
    *(_F(f"sigma_{name}", "", f"step.sigma_{name}") for name in _STRAINS),
    _F("n_valid", "ZOIs with a value", "step.n_valid", kind="count"),
    _F("n_zoi", "ZOIs to measure", "step.n_zoi", kind="count"),
    _F("noise_GL", "temporal standard deviation of one frame; nan for a burst of one", "burst.noise", "step.noise_GL"),
    _F("n_frames", "frames averaged", "burst.n", kind="count"),
    _F("last_frame", "sequence number of the last frame of the burst", "burst.last_index", kind="count"),
    _F("lost", "frames lost or damaged since the burst before", "burst.lost", kind="count"),
    _F("duration_s", "time of the last frame of the burst minus that of the first", "burst.duration"),
    _F("u_px", "", "step.u"),
    _F("v_px", "", "step.v"),
    _F("latency_s", "from the stamp of the last frame of the burst to the result; nan in a replay", "step.latency_s",
       "step.latency_s", output=13),
    _F("kernel_s", "time that the kernel took; nan where it was not measured", "row"),
    _F("zero_N", "sum of the tares before, subtracted from the force", "step.zero"),
    _F("extension_x", "(L - L0)/L0 between strips at the left and the right end of the region", "step.extension_x",
       kind="strain"),
    _F("extension_y", "(L - L0)/L0 between strips at the upper and the lower end of the region", "step.extension_y",
       kind="strain"),
    _F("sigma_extension_x", "", "step.sigma_extension_x"),
    _F("sigma_extension_y", "", "step.sigma_extension_y"),
    *(_F(f"uneven_{name}", f"variation of {name} over the region, rms, up to the second degree", f"step.uneven_{name}",
         kind="strain") for name in ("exx", "eyy")),
    _F("misfit", "that variation over what noise makes of it; about 1 in a uniform strain", "step.misfit"),
    _F("blur_px", "", "step.blur", sigma=True),
    _F("area_share", "share of the region that its strains stand for; below 1 where a block was lost",
       "step.area_share", kind="share", label=Message("share of the area"), report=True),
    # Columns of some tests.
    _F("stress_Pa", "force over the undeformed section", "row", only="section"),
    _F("true_strain", "logarithm of one plus the axial engineering strain", "row", only="section", kind="strain"),
    _F("true_stress_Pa", "stress times one plus the axial engineering strain; volume taken as constant", "row",
       only="section"),
    _F("force_raw_N", "force as stamped, not corrected for the lag of the load", "step.force_raw", only="lag"),
    _F("lens_exx", "exx of the region that the lens made, and that was removed", "row", only="lens"),
    _F("lens_eyy", "the same of eyy", "row", only="lens"),
    _F("sigma_lens_exx", "", "row", only="lens"),
    _F("sigma_lens_eyy", "", "row", only="lens"),
    *(_F(f"raw_{name}", Message("{name} of the region before the correction by plates", name), "row", only="plates")
      for name in _STRAINS),
    *(_F(name, words, "row", only="plates") for name, words in {
        "corrected": "1 where the plates were measured, 0 where their last motion was removed",
        "plate_shift_x": "motion of the plates along x over half the diagonal of all ZOIs",
        "plate_shift_y": "the same along y",
        "plate_scale": "change of scale of the plates",
        "plate_turn": "rotation of the plates, rad, clockwise",
        "plate_keystone_x": "change of their scale along x over half the diagonal of all ZOIs",
        "plate_keystone_y": "the same along y",
        "plate_stretch": "half the difference of their strains along x and y",
        "plate_shear": "their shear strain",
        "sigma_plate_scale": "",
    }.items()),
    # Channels alone.
    _F("axial", "strain along the load: the gauge axial, else of the region", "", "axial.value", output=3,
       kind="strain"),
    _F("sigma_axial", "its standard uncertainty", "", "axial.sigma", output=4, kind="strain"),
    _F("strain_rate", "rate of axial over the last second, 1/s", "", "values", output=5),
    _F("sigma_strain_rate", "its standard uncertainty, from the scatter", "", "values"),
    _F("age_s", "age of the strains", "", "axial.age", output=6),
    _F("state", "of the strains: live, old, unknown, not yet, paused, ended", "", "state", output=7),
    _F("stress_MPa", "force over the area of the section", "", "stress.value", output=9, load=True),
    _F("force_age_s", "age of the newest force", "", "force.age", output=10, load=True),
    _F("force_state", "of the force: as state, and overload, underload", "", "state", output=11, load=True),
    _F("largest", "strain of the largest magnitude of any ZOI", kind="strain", live=True),
    _F("lost_share", "share of the ZOIs without a value, 0 to 1", "", "step.lost_share", output=12),
    _F("cycle", "number of the last whole cycle of a cyclic test", "", "cycle", kind="count", label=Message("cycle"),
       page=True),
    _F("peak_strain", "highest axial strain in it", "", "cycle", kind="strain"),
    _F("range_strain", "range of the axial strain in it", "", "cycle", kind="strain"),
    _F("peak_N", "highest force in it", "", "cycle", load=True),
    _F("secant_modulus", "range of the stress (of the force, without a section) over that of the strain", "",
       "cycle", load=True, kind="stress"),
    _F("silent_s", "time since the last frame", "", "machine", label=Message("no frame for")),
    _F("load_silent_s", "time since the last value of the load cell", "", "machine", load=True,
       label=Message("no force for")),
    _F("disk_min", "time until the disk is full", "", "machine", label=Message("disk full in")),
    _F("mean_time_s", "the newest instant that front and back both have", "", "both"),
    _F("mean_axial", "axial strain then, mean of front and back", "", "both", kind="strain"),
    _F("bending_axial", "axial strain of the front then, minus that mean", "", "both", kind="strain"),
    _F("sigma_mean_axial", "standard uncertainty of mean_axial and of bending_axial", "", "both", kind="strain"),
    # Shown alone: counts of frames (``FrameCounts``), and what the machine does.
    _F("fps", kind="count", label=Message("frames/s"), terminal=9, page=True),
    _F("recorded", kind="count", label=Message("recorded"), page=True),
    _F("measured", kind="count", label=Message("measured"), terminal=12, hidden=True),
    _F("skipped", kind="count", label=Message("skipped"), terminal=11, page=True, above=0, hidden=True),
    _F("lost_frames", kind="count", label=Message("lost"), terminal=13, page=True, above=0),
    _F("delay", kind="delay", label=Message("delay"), terminal=12, page=True, above=0.5),
    _F("disk", kind="rest", label=Message("disk"), terminal=14, page=True, below=30 * 60),
    _F("without_force", kind="count", label=Message("without a force"), terminal=6, page=True,
       display=True, above=0, hidden=True),
)
# fmt: on
_BY_NAME = {figure.name: figure for figure in FIGURES}
OF_SNAPSHOT = tuple(figure for figure in FIGURES if figure.part in ("value", "sigma", "age"))
"""Whose channels are of a figure of the snapshot: ``of``, and its ``part``."""
LIVE = tuple(figure for figure in FIGURES if figure.live)
"""Of the snapshot, from the attribute of ``TimeStep`` with their plain name."""


def columns(only: Iterable[str] = ("",)) -> tuple[str, ...]:
    """The columns of every test (``""``), or of those that have all that is named in ``only``."""
    wanted = tuple(only)
    found = (figure for figure in FIGURES if figure.column and figure.only in wanted)
    return tuple(name for figure in found for name in figure.columns)


def attributes(of: str, *, channel: bool = False) -> dict[str, str]:
    """Columns, or channels, that are an attribute of ``of`` ("step" or "burst"), with its name."""
    found: dict[str, str] = {}
    for figure in FIGURES:
        whose, _, name = (figure.channel if channel else figure.column).partition(".")
        if whose == of:
            found[figure.name] = name
            if figure.sigma and not channel:
                found[f"sigma_{figure.name}"] = f"sigma_{name}"
    return found


def channels(*given_by: str) -> tuple[str, ...]:
    """The channels that these give."""
    return tuple(figure.name for figure in FIGURES if figure.channel in given_by)


CYCLE_CHANNELS, JOINT_CHANNELS, STATE_CHANNELS, SYSTEM_CHANNELS = map(
    channels, ("cycle", "both", "state", "machine")
)
"""Of the last whole cycle; of a test with two cameras, front and back; words, of the strain output alone; of the
machine, of alarms alone."""
MEASURED_CHANNELS = tuple(
    figure.name for figure in FIGURES if figure.channel and figure.channel not in ("both", "state", "machine")
)
OF_LOAD = tuple(figure.name for figure in FIGURES if figure.channel and figure.load)
"""Channels that there are with a load cell alone."""
OF_SECTION = {figure.name for figure in FIGURES if figure.channel and figure.kind == "stress"}
"""Channels that are stresses."""
DEFAULT_CHANNELS = tuple(
    figure.name for figure in sorted(FIGURES, key=lambda figure: figure.output) if figure.output
)
"""The channels of the strain output without a choice; the gauges are added."""


def channel_names(gauges: Iterable[str], *, system: bool = False) -> tuple[str, ...]:
    """All channels of a test with these gauges: ``gauge_NAME`` and ``sigma_gauge_NAME`` as in the files."""
    gauges = tuple(gauges)
    own = (f"{prefix}gauge_{name}" for name in gauges for prefix in ("", "sigma_"))
    return (
        *MEASURED_CHANNELS,
        *own,
        *joint_channels(gauges),
        *(SYSTEM_CHANNELS if system else STATE_CHANNELS),
    )


def joint_channels(gauges: Iterable[str]) -> tuple[str, ...]:
    """The channels of front and back together, with those of these gauges."""
    return (*JOINT_CHANNELS, *(f"{prefix}gauge_{name}" for name in gauges for prefix in _JOINT))


def is_joint(channel: str) -> bool:
    """Whether a channel is of front and back together."""
    return channel.startswith(_JOINT)


def figure_of(channel: str) -> LiveFigure:
    """The figure of a channel; others than those of the table are strains of gauges."""
    if channel in _BY_NAME:
        return _BY_NAME[channel]
    plain = channel.removeprefix("sigma_")
    part = "value" if plain == channel else "sigma"
    return LiveFigure(channel, channel="both" if is_joint(channel) else f"{plain}.{part}", kind="strain")
