"""Exports as testing machines, spreadsheets and loggers write them, made of known times and forces.

Nothing here comes from the reader: each file is put together as text from numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

TIMES = [round(0.1 * k, 1) for k in range(80)]
FORCES = [round(0.25 + 96.125 * k - 0.0625 * k * k, 4) for k in range(80)]
"""0.25 to 7,203.8 N: below and above a thousand, with up to four decimals."""


@dataclass(frozen=True)
class Made:
    """A file and what is to be read from it: times from its first row unless ``absolute``, or words of a refusal."""

    data: bytes
    forces: Sequence[float] = field(default_factory=lambda: FORCES)
    refused: str = ""
    given: dict[str, object] = field(default_factory=dict)
    tolerance: float = 1e-9


def comma(text: str) -> str:
    return text.replace(".", ",")


def thousands(value: float, group: str, decimal: str = ".", digits: int = 1) -> str:
    return f"{value:,.{digits}f}".replace(",", "\0").replace(".", decimal).replace("\0", group)


def clock(t: float, start: float = 43_262.345, half: bool = False) -> str:
    t += start
    hour = int(t // 3600)
    rest = f":{int(t // 60) % 60:02d}:{t % 60:06.3f}"
    return f"{(hour - 1) % 12 + 1}{rest} {'PM' if hour >= 12 else 'AM'}" if half else f"{hour:02d}{rest}"


def rows(
    line: Callable[[float, float], str], times: Sequence[float] = TIMES, forces: Sequence[float] = FORCES
) -> str:
    return "".join(line(t, f) + "\r\n" for t, f in zip(times, forces, strict=True))


def _bluehill2() -> bytes:
    head = 'General,\r\n"Sample","A,1"\r\nWidth,10.5,mm\r\n\r\nTime,Extension,Load\r\n(sec),(mm),(kN)\r\n'
    return (head + rows(lambda t, f: f"{t:.5f},{t / 20:.5f},{f / 1e3:.7f}")).encode()


def _bluehill3() -> bytes:
    head = '"Results Table 1"\r\n"","Maximum Load","Modulus"\r\n"","(kN)","(MPa)"\r\n"1","7.20380","21000.1"\r\n\r\n'
    head += '"Results Table 2"\r\n"Time","Extension","Load"\r\n"(s)","(mm)","(N)"\r\n'
    return (head + rows(lambda t, f: f'"{t:.3f}","{t / 20:.5f}","{f:,.4f}"')).encode()


def _zwick_tra() -> bytes:
    head = '"Prüfzeit";"Standardkraft";"Verformung"\r\n"s";"N";"mm"\r\n'
    return comma(head + rows(lambda t, f: f"{t:.3f};{f:.4f};{t / 20:.5f}")).encode("cp1252")


def _zwick_txt() -> bytes:
    head = "Prüfer;Müller\r\nDatum;25.11.2026\r\nMaximum;7153,5;N\r\n\r\nKraft;Weg;Zeit\r\nkN;mm;s\r\n"
    tail = "Fmax;7,2;kN\r\n"
    return (head + comma(rows(lambda t, f: f"{f / 1e3:.7f};{t / 20:.4f};{t:.2f}")) + tail).encode("cp1252")


def _mts() -> bytes:
    head = "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\r\n\r\nData Acquisition: Timed\r\nStation Name: a.cfg\r\n"
    head += "Time\tAxial Force\tAxial Displacement\r\ns\tkN\tmm\r\n"
    return (head + rows(lambda t, f: f"{t:g}\t{f / 1e3:.7f}\t{t / 20:.5f}")).encode()


def _mts_paused() -> bytes:
    block = "Data Acquisition: (Timed)\r\nTime\tAxial Force\tAxial Displacement\r\nSec\tN\tmm\r\n"
    first = rows(lambda t, f: f"{t:.3f}\t{f:.4f}\t0", TIMES[:40], FORCES[:40])
    return (
        block + first + "\r\n" + block + rows(lambda t, f: f"{t:.3f}\t{f:.4f}\t0", TIMES[40:], FORCES[40:])
    ).encode()


def _testworks() -> bytes:
    head = "[Header]\r\nOperator=MM\r\n[Data]\r\n Load (lbf),Crosshead (in),Time (s)\r\n"
    return (head + rows(lambda t, f: f" {f / 4.4482216153:.9f}, {t / 20:.4f}, {t:.3f}")).encode()


def _shimadzu() -> bytes:
    head = '"Name","1 _ 1"\r\n"Test type","Tensile"\r\n"1 _ 1","",""\r\n"Time","Force","Stroke"\r\n"sec","N","mm"\r\n'
    return (head + rows(lambda t, f: f'"{t:.2f}","{f:.4f}","{t / 20:.5f}"')).encode()


def _shimadzu_japanese() -> bytes:
    head = '"試験名","引張"\r\n"時間","荷重","ストローク"\r\n"sec","N","mm"\r\n'
    return (head + rows(lambda t, f: f'"{t:.2f}","{f:.4f}","{t / 20:.5f}"')).encode("cp932")


def _tinius_olsen() -> bytes:
    head = "Horizon\r\nTest 1\r\nTime (min),Force (lbf),Position (in)\r\n"
    return (head + rows(lambda t, f: f"{t / 60:.9f},{f / 4.4482216153:.9f},{t / 20:.4f}")).encode()


def _hegewald() -> bytes:
    head = "LabMaster\r\nZeit [s]\tKraft [kN]\tTraverse [mm]\r\n"
    return (head + comma(rows(lambda t, f: f"{t:.3f}\t{f / 1e3:.7f}\t{t / 20:.4f}"))).encode("cp1252")


def _hounsfield() -> bytes:
    head = "   Time s      Force N     Ext mm\r\n"
    return (head + rows(lambda t, f: f"{t:9.3f}   {f:12.4f}   {t / 20:9.4f}")).encode()


def _lvm() -> bytes:
    head = "LabVIEW Measurement\t\r\nWriter_Version\t2\r\nSeparator\tTab\r\nDecimal_Separator\t.\r\nX_Columns\tOne\r\n"
    head += "***End_of_Header***\t\r\n\t\r\nChannels\t2\t\t\r\nSamples\t80\t80\t\r\nDate\t2026/11/25\t2026/11/25\t\r\n"
    head += "Y_Unit_Label\tN\tmm\t\r\nX_Dimension\tTime\tTime\t\r\nX0\t0\t0\t\r\nDelta_X\t0.1\t0.1\t\r\n"
    head += "***End_of_Header***\t\t\t\r\nX_Value\tForce\tStroke\tComment\r\n"
    return (head + rows(lambda t, f: f"{t:.6f}\t{f:.6f}\t{t / 20:.6f}\t")).encode()


def _simple(head: str, line: Callable[[float, float], str], encoding: str = "utf-8", tail: str = "") -> bytes:
    return (head + "\r\n" + rows(line) + tail).encode(encoding)


def _german(t: float, f: float) -> str:
    return comma(f"{t:.1f};{f:.4f}")


UNIX = 1_764_064_800.0
EXPORTS: dict[str, Made] = {
    "Bluehill 2": Made(_bluehill2()),
    "Bluehill 3, results above, thousands": Made(_bluehill3()),
    "testXpert .tra": Made(_zwick_tra()),
    "testXpert .txt, preamble and footer": Made(_zwick_txt()),
    "MTS TestSuite": Made(_mts()),
    "MTS, heading again after a pause": Made(_mts_paused()),
    "TestWorks, blanks after commas": Made(_testworks()),
    "Trapezium": Made(_shimadzu()),
    "Trapezium, Shift-JIS": Made(_shimadzu_japanese()),
    "Tinius Olsen, minutes and lbf": Made(_tinius_olsen(), tolerance=1e-6),
    "Hegewald & Peschke": Made(_hegewald()),
    "Hounsfield, columns by blanks": Made(_hounsfield()),
    "LabVIEW .lvm": Made(_lvm()),
    "Excel, UTF-16": Made(_simple("Time (s)\tForce (N)", lambda t, f: f"{t}\t{f}", "utf-16")),
    "UTF-16 without a mark": Made(_simple("Time (s)\tForce (N)", lambda t, f: f"{t}\t{f}", "utf-16-le")),
    "Excel, German": Made(_simple("Zeit in s;Kraft in N", _german, "utf-8-sig")),
    "German, sep= line": Made(_simple("sep=;\r\nZeit [s];Zugkraft [N]", _german)),
    "French": Made(_simple("Temps (s);Déplacement (mm);Charge (N)", lambda t, f: comma(f"{t};0;{f}"), "cp1252")),
    "French, effort in daN": Made(_simple("Durée (s);Effort (daN)", lambda t, f: comma(f"{t};{f / 10:.6f}"))),
    "German thousands with points": Made(
        _simple("Zeit [s];Kraft [N]", lambda t, f: f"{comma(str(t))};{thousands(f, '.', ',', 4)}")
    ),
    "Swiss thousands": Made(_simple("Zeit [s];Kraft [N]", lambda t, f: f"{t};{thousands(f, chr(39), digits=4)}")),
    "French thousands": Made(
        _simple("Temps (s);Force (N)", lambda t, f: f"{comma(str(t))};{thousands(f, chr(0x202F), ',', 4)}")
    ),
    "thousands with blanks": Made(_simple("Time (s);Load (N)", lambda t, f: f"{t};{thousands(f, ' ', digits=4)}")),
    "clock": Made(_simple("Time,Load [N]", lambda t, f: f"{clock(t)},{f}")),
    "date and clock": Made(_simple("Date,Time,Load (N)", lambda t, f: f"2026-11-25,{clock(t)},{f}")),
    "date and clock in one": Made(_simple("Timestamp;Load (N)", lambda t, f: f"25.11.2026 {clock(t)};{f}")),
    "across midnight": Made(
        _simple("Time;Load (N)", lambda t, f: f"{clock((t + 86_396.0) % 86_400, 0)};{f}")
    ),
    "12-hour clock": Made(_simple("Time;Load (N)", lambda t, f: f"{clock(t, 43_196.0, half=True)};{f}")),
    "ISO times with a zone": Made(
        _simple("Time,Load (N)", lambda t, f: f"2026-11-25T{clock(t)}+01:00,{f}")
    ),
    "elapsed minutes": Made(_simple("Elapsed Time,Load (N)", lambda t, f: f"00:{t:04.1f},{f}")),
    "Unix": Made(_simple("Timestamp,Load (N)", lambda t, f: f"{UNIX + t:.3f},{f}"), tolerance=1e-6),
    "Unix in ms": Made(_simple("Time,Load (N)", lambda t, f: f"{(UNIX + t) * 1e3:.0f},{f}"), tolerance=1e-6),
    "milliseconds": Made(_simple("Time (ms),Load (N)", lambda t, f: f"{t * 1e3:.0f},{f}")),
    "microseconds, cp1252": Made(_simple("Zeit [µs];Kraft [N]", lambda t, f: f"{t * 1e6:.0f};{f}", "cp1252")),
    "kgf": Made(_simple("Time,Load (kgf)", lambda t, f: f"{t},{f / 9.80665:.9f}")),
    "unit behind a comma": Made(_simple("Time, s,Load, kN", lambda t, f: f"{t},{f / 1e3:.7f}")),
    "unit by underscore": Made(_simple("time_s,load_kN", lambda t, f: f"{t},{f / 1e3:.7f}")),
    "exponents": Made(_simple("Time (s),Load (N)", lambda t, f: f"{t:.6E},{f:.6E}"), tolerance=1e-6),
    "quoted decimal commas": Made(
        _simple('"Time (s)","Load (N)"', lambda t, f: '"' + comma(f"{t}") + '","' + comma(f"{f}") + '"')
    ),
    "the force is a channel": Made(_simple("Time (s);Ch 1 [N];Ch 2 [mm]", lambda t, f: f"{t};{f};0")),
    "footer of results": Made(
        _simple("Zeit [s];Kraft [N]", _german, tail="\r\nMaximum;7153\r\nNummer;Fmax [N]\r\n99;7153\r\n100;1\r\n")
    ),
    "negative, turned by --load-sign": Made(
        _simple("Time (s),Load (N)", lambda t, f: f"{t},{-f}"), given={"sign": -1}
    ),
    "true minus signs": Made(
        _simple("Time (s),Load (N)", lambda t, f: f"{t},\u2212{f}"), forces=[-f for f in FORCES]
    ),
    "two load cells, one given": Made(
        _simple("Time (s),Load 1 (N),Load 2 (N)", lambda t, f: f"{t},7,{f}"), given={"column": "Load 2"}
    ),
    "unknown headings, given": Made(
        _simple("A;B;C", lambda t, f: f"{f};0;{t}"), given={"column": "1,3", "unit": "N,s"}
    ),
    "commas for everything, given": Made(
        _simple("Time (s),Load (N)", lambda t, f: comma(f"{t:.1f}") + "," + comma(f"{f:.4f}")),
        given={"decimal": "comma"},
    ),
    "whole seconds and three decimals, given": Made(
        _simple("Time (ms);Load (kN)", lambda t, f: f"{1e3 * t:.0f};{1 + f / 1e4:.3f}"),
        forces=[1e3 * round(1 + f / 1e4, 3) for f in FORCES],
        given={"decimal": "point"},
    ),
    "numpy.savetxt, the heading is a remark": Made(
        _simple("# made by hand\r\n# time_s,load_kN\r\n# of run 7", lambda t, f: f"{t},{f / 1e3:.7f}")
    ),
    "numpy.savetxt with blanks": Made(_simple("# time_s load_kN", lambda t, f: f"{t} {f / 1e3:.7f}")),
    "a language that is not known": Made(_simple("Idő (s);Erő (N)", _german)),
    "quotes behind blanks": Made(_simple('"Time (s)", "Load (N)"', lambda t, f: f'"{t}", "{f}"')),
    # -- refused --------------------------------------------------------------------------------
    "groups of three digits": Made(
        _simple("Time (s);Load (N)", lambda t, f: f"{10 * t:.0f};{thousands(f, '.', digits=0)}"),
        refused="--load-decimal",
    ),
    "groups of three digits beside decimal times": Made(
        _simple("Time (s);Load (N)", lambda t, f: f"{t};{thousands(f, '.', digits=0)}"), refused="--load-decimal"
    ),
    "three decimals or thousands": Made(
        _simple("Time (ms);Load (kN)", lambda t, f: f"{1e3 * t:.0f};{1 + f / 1e4:.3f}"), refused="--load-decimal"
    ),
    "commas for everything": Made(
        _simple("Time (s),Load (N)", lambda t, f: comma(f"{t:.1f}") + "," + comma(f"{f:.4f}")), refused="--load-decimal"
    ),
    "no unit": Made(_simple("Time,Load", lambda t, f: f"{t},{f}"), refused="--load-unit"),
    "a mass": Made(_simple("Time (s),Load (kg)", lambda t, f: f"{t},{f}"), refused="--load-unit"),
    "two load cells": Made(
        _simple("Time (s),Load 1 (N),Load 2 (N)", lambda t, f: f"{t},{f},{f}"), refused="--load-column"
    ),
    "unknown headings": Made(_simple("A;B;C", lambda t, f: f"{f};0;{t}"), refused="--load-column"),
    "two marks": Made(
        _simple("Time (s);Load (N)", lambda t, f: f"{t:.1f};{comma(f'{f:.4f}')}"), refused="--load-decimal"
    ),
    "months by name": Made(
        _simple("Time;Load (N)", lambda t, f: f"25-Nov-2026 {clock(t)};{f}"), refused="as '25-Nov-2026 12:01:02"
    ),
    "all times are equal": Made(_simple("Time (s),Load (N)", lambda t, f: f"1.0,{f}"), refused="line 3"),
    "clock without fractions": Made(
        _simple("Time,Load (N)", lambda t, f: f"{clock(t)[:8]},{f}"), refused="stands twice"
    ),
    "the test again from zero": Made(
        _simple("Time (s),Load (N)", lambda t, f: f"{t},{f}", tail="Time (s),Load (N)\r\n0.0,1.5\r\n"),
        refused="line 83: the times run backwards",
    ),
    "a damaged number": Made(
        _simple("Time (s),Load (N)", lambda t, f: f"{t},{f}", tail="8.0,7x.5\r\n"), refused="line 82: '7x.5'"
    ),
    "a quote that is not closed": Made(
        _simple("Time (s),Load (N)", lambda t, f: f"{t},{f}", tail='8.0,"7\r\n8.1,5\r\n'), refused="line 82"
    ),
    "a workbook": Made(b"PK\x03\x04" + bytes(200), refused="CSV"),
    "binary": Made(bytes(range(256)) * 20, refused="binary"),
}  # fmt: skip
