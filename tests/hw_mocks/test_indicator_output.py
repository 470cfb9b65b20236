"""What an indicator puts on the line, fault by fault, and the plans of faults; no port and no clock."""

from __future__ import annotations

import numpy as np
import pytest

from acquire.errors import ConfigError
from hw_mocks.indicator import AsciiIndicator, IndicatorOutput, IndicatorReading, Sensing
from hw_mocks.sim_indicators import MtSicsIndicator
from hw_mocks.sim_settings import CAMERA_FAULTS, SERIAL_FAULTS, Fault, FaultPlan, parse_faults, plan_frames

RATE = 10.0


def lines(
    faults: str = "", seconds: float = 1.0, style: str = "millis", noise: float = 0.0
) -> list[list[bytes]]:
    """The chunks of each sample; the force is 100 N a second, the test begins with the indicator."""
    sensing = Sensing(lambda t: 100 * t, lambda t: t, RATE, noise)
    plan = parse_faults(faults, SERIAL_FAULTS, "test")
    output = IndicatorOutput(AsciiIndicator(style=style), sensing, boot=0.0, faults=plan)
    t, found = 0.0, []
    while t < seconds - 1e-9:
        found.append(output.sample(t))
        t += output.interval(t)
    return found


def flat(faults: str = "", seconds: float = 1.0, style: str = "millis") -> bytes:
    return b"".join(chunk for sample in lines(faults, seconds, style) for chunk in sample)


def test_one_line_a_sample() -> None:
    assert lines()[:3] == [[b"0,0.0,N\r\n"], [b"100,10.0,N\r\n"], [b"200,20.0,N\r\n"]]


@pytest.mark.parametrize(
    ("style", "line"),
    [
        ("millis", b"1234,-0.5,N\r\n"),
        ("plain", b"-0.5 N\r\n"),
        ("label", b"Reading: -0.5 N\r\n"),
        ("openscale", b"1234,-0.5,N,-411,21.5,\r\n"),
    ],
)
def test_styles(style: str, line: bytes) -> None:
    assert AsciiIndicator(style=style).render(IndicatorReading(-0.514, 1234.4)) == line


def test_saturation_is_the_converters_end_value() -> None:
    assert AsciiIndicator().render(IndicatorReading(1e9, 7, status="overload")) == b"7,8388607,N\r\n"
    assert b",-8388608," in AsciiIndicator(style="openscale").render(
        IndicatorReading(-1e9, 7, status="underload")
    )


def test_noise_is_as_stated() -> None:
    values = [float(sample[0].split(b",")[1]) for sample in lines(seconds=90, noise=2.0)]
    assert np.std(np.array(values) - 10 * np.arange(len(values))) == pytest.approx(2.0, rel=0.1)


def test_silence_sends_nothing_and_late_sends_all_at_once() -> None:
    assert [len(s) for s in lines("silence@0.3*0.3")] == [1, 1, 1, 0, 0, 0, 1, 1, 1, 1]
    late = lines("late@0.3*0.3")
    assert [len(s) for s in late] == [1, 1, 1, 0, 0, 0, 1, 1, 1, 1]
    assert late[6] == [b"300,30.0,N\r\n400,40.0,N\r\n500,50.0,N\r\n600,60.0,N\r\n"]


def test_single_line_faults() -> None:
    assert lines("partial@0.3")[3] == [b".0,N\r\n"]
    assert lines("duplicate@0.3")[3] == [b"300,30.0,N\r\n" * 2]
    assert lines("split@0.3")[3] == [b"300,30", b".0,N\r\n"]
    assert lines("split@0.3*2")[4] == [b"400,40", b".0,N\r\n"]


def test_foreign_bytes_come_before_the_line() -> None:
    assert lines("nul@0.3*4")[3] == [bytes(4) + b"300,30.0,N\r\n"]
    garbage = lines("garbage@0.3*40")[3][0]
    assert len(garbage) == 40 + 12 and garbage.endswith(b"300,30.0,N\r\n")


def test_writing_faults() -> None:
    assert lines("comma@0.3*0.1")[3:5] == [[b"300,30,0,N\r\n"], [b"400,40.0,N\r\n"]]
    assert lines("cr@0.3*0.1")[3:5] == [[b"300,30.0,N\r"], [b"400,40.0,N\r\n"]]
    assert lines("unit@0.3*0.1")[3:5] == [[b"300,0.0300,kN\r\n"], [b"400,40.0,N\r\n"]]
    assert lines("overload@0.3*0.1")[3] == [b"300,8388607,N\r\n"]


def test_clock_faults() -> None:
    assert lines("jump@0.3*60")[3] == [b"60300,30.0,N\r\n"]
    assert lines("reset@0.3")[3] == [AsciiIndicator.banner + b"0,30.0,N\r\n"]
    assert lines("reset@0.3")[4] == [b"100,40.0,N\r\n"]


def test_a_backlog_is_each_old_line_once_and_all_together() -> None:
    (chunk,) = lines("backlog@0.5*0.3")[5]
    assert chunk == b"200,20.0,N\r\n300,30.0,N\r\n400,40.0,N\r\n500,50.0,N\r\n"


@pytest.mark.parametrize(
    ("force", "status"),
    [(-10.1, "underload"), (-10.0, "ok"), (-0.1, "ok"), (0.0, "ok"), (10.0, "ok"), (10.1, "overload")],
)
def test_the_range_is_the_same_to_both_sides(force: float, status: str) -> None:
    sensing = Sensing(lambda t: force, lambda t: t, noise_N=0.0, capacity_N=10.0)
    shown = IndicatorOutput(AsciiIndicator(), sensing, 2.0).shown(5.0)
    assert (shown.status, shown.force, shown.ms, shown.stable) == (status, force, 3000.0, True)
    plain = Sensing(lambda t: 0.0, lambda t: t)
    assert (plain.rate, plain.noise_N, plain.capacity_N) == (80.0, 1.0, 10_000.0)


@pytest.mark.parametrize(("amount", "interval_s"), [("0.5", 0.2), ("0", 100.0), ("2", 0.05)])
def test_a_rate_that_falls_short_never_stops_altogether(amount: str, interval_s: float) -> None:
    plan = parse_faults(f"rate@1*{amount}", SERIAL_FAULTS, "test")
    output = IndicatorOutput(AsciiIndicator(), Sensing(lambda t: 0.0, lambda t: t, RATE), 0.0, faults=plan)
    assert [output.interval(t) for t in (0.9, 1.0, 2.0)] == pytest.approx([0.1, interval_s, interval_s])


def test_a_rate_that_was_commanded_comes_before_its_own() -> None:
    indicator = AsciiIndicator()
    output = IndicatorOutput(indicator, Sensing(lambda t: 0.0, lambda t: t, RATE), 0.0)
    indicator.rate = 50.0
    assert output.interval(0.0) == pytest.approx(0.02)


def test_a_device_that_is_not_sending_is_silent_until_it_is_asked() -> None:
    output = IndicatorOutput(MtSicsIndicator(), Sensing(lambda t: 7.0, lambda t: t, RATE, 0.0), 0.0)
    assert output.sample(0.0) == []
    assert output.answers(b"SI\r\n", 0.1) == b"S S        7.0 N\r\n"
    output.answers(b"SIR\r\n", 0.2)
    assert output.sample(0.3) == [b"S S        7.0 N\r\n"]


def test_an_unstable_reading_says_so_and_silence_answers_nothing() -> None:
    plan = parse_faults("unstable@1*1,silence@3*1,cr@5*1", SERIAL_FAULTS, "test")
    sensing = Sensing(lambda t: 7.0, lambda t: t, RATE, 0.0)
    output = IndicatorOutput(MtSicsIndicator(), sensing, 0.0, faults=plan)
    answers = [output.answers(b"SI\r\n", t) for t in (0.5, 1.5, 2.5, 3.5, 5.5)]
    assert answers == [
        b"S S        7.0 N\r\n", b"S D        7.0 N\r\n", b"S S        7.0 N\r\n", b"", b"S S        7.0 N\r",
    ]  # fmt: skip


def test_lasting_faults_have_an_end() -> None:
    plan = parse_faults("unplug@1*2", SERIAL_FAULTS, "test")
    output = IndicatorOutput(AsciiIndicator(), Sensing(lambda t: 0.0, lambda t: t), 0.0, faults=plan)
    assert [output.unplugged(t) for t in (0.9, 1.0, 2.9, 3.0)] == [False, True, True, False]
    assert plan.lasting("late", 2.0) is None


def test_begun_is_told_once_each() -> None:
    plan = parse_faults("drop@1, drop@3*7", CAMERA_FAULTS, "sim:")
    assert plan.begun("drop", 0.5) is None
    assert plan.begun("drop", 1.2) == Fault("drop", 1.0, 3.0)
    assert plan.begun("drop", 1.3) is None
    assert plan.begun("drop", 9.0) == Fault("drop", 3.0, 7.0)
    assert plan.begun("drop", 9.0) is None


def test_every_name_can_be_written() -> None:
    for table in (CAMERA_FAULTS, SERIAL_FAULTS):
        text = ",".join(f"{name}@1" for name in table)
        plan = parse_faults(text, table, "sim:")
        for name in table:
            assert plan.begun(name, 1.0) == Fault(name, 1.0, table[name])


@pytest.mark.parametrize(
    "text", ["drop", "drop@", "drop@x", "drop@1*x", "drop@1*-1", "drop@inf", "@3", "fall@3"]
)
def test_malformed_text_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="sim:y"):
        parse_faults(text, CAMERA_FAULTS, "sim:y")


def test_plan_without_faults_is_every_frame() -> None:
    planned = list(plan_frames(1.0, 10.0, FaultPlan()))
    assert [p.index for p in planned] == list(range(11))
    assert {p.fate for p in planned} == {"good"}
    assert planned[3].t == pytest.approx(0.3)


def test_overlapping_faults_keep_their_counts() -> None:
    plan = parse_faults("drop@0.2*2,damage@0.2*1", CAMERA_FAULTS, "sim:")
    fates = [p.fate for p in plan_frames(0.6, 10.0, plan)]
    assert fates == ["good", "good", "lost", "lost", "damaged", "good", "good"]
