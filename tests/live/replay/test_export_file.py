"""Exports of testing machines are read to the value, or refused with the option that settles it; none is read wrong."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquire.errors import DataError
from live.config.sections import LoadConfig
from live.replay import export_text
from live.replay.export_file import Export, read_export
from tests.live.replay.exports import EXPORTS, TIMES, thousands


def read(data: bytes | str, **options: Any) -> Export:
    data = data.encode() if isinstance(data, str) else data
    return read_export(io.BytesIO(data), "forces.csv", LoadConfig(**options))


@pytest.fixture(params=[1 << 20, 200], ids=["one block", "many blocks"])
def block(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Characters that are read at once."""
    monkeypatch.setattr(export_text, "_BLOCK", request.param)
    return int(request.param)


@pytest.mark.usefixtures("block")
@pytest.mark.parametrize("name", [name for name, made in EXPORTS.items() if not made.refused])
def test_exports_are_read_to_the_value(name: str) -> None:
    made = EXPORTS[name]
    found = read(made.data, **made.given)
    assert found.times is not None
    np.testing.assert_allclose(found.times - found.times[0], TIMES, atol=1e-6)
    np.testing.assert_allclose(found.forces, made.forces, rtol=max(made.tolerance, 1e-9), atol=1e-4)


@pytest.mark.usefixtures("block")
@pytest.mark.parametrize("name", [name for name, made in EXPORTS.items() if made.refused])
def test_what_has_two_readings_is_refused_with_its_option(name: str) -> None:
    made = EXPORTS[name]
    with pytest.raises(DataError, match=r"^forces\.csv: ") as refused:
        read(made.data, **made.given)
    assert made.refused in str(refused.value)


def test_what_was_taken_is_said() -> None:
    found = read(EXPORTS["testXpert .txt, preamble and footer"].data)
    assert found.taken == (
        "column Kraft, kN, 80 rows, 0.25 to 7 204 N against Zeit (s); CP1252, semicolons, decimal comma"
    )
    assert found.remarks == ("1 line of text left out",)
    found = read(EXPORTS["footer of results"].data)
    assert "line 84: another table begins ('Nummer, Fmax [N]'): its 2 rows are not read" in found.remarks
    assert "taken as newtons" in read("0,1\n0.5,2.5\n").remarks[0]
    assert "taken as seconds" in read("Time,Load [N]\n0,1\n0.5,2.5\n").remarks[0]


def test_empty_cells_are_no_force_and_the_first_may_be_one() -> None:
    found = read("Zeit [s];Kraft [N]\n0;\n1;NaN\n2;-3,5\n3;---\n4;#NV\n")
    assert found.times is not None and found.times.tolist() == [0, 1, 2, 3, 4]
    assert found.forces.tolist() == pytest.approx([math.nan, math.nan, -3.5, math.nan, math.nan], nan_ok=True)


def test_dates_prove_no_decimal_mark() -> None:
    found = read("Datum;Zeit;Kraft [kN]\n25.11.2026;10:00:00.000;1.5\n25.11.2026;10:00:01.000;2.25\n")
    assert found.forces.tolist() == [1500.0, 2250.0]


def test_the_rows_before_a_pause_are_kept_whichever_part_is_longer() -> None:
    head = "Time (s)\tLoad (N)\n"
    for cut in (3, 12):
        rows = [f"{k}.5\t{k * 10}.25\n" for k in range(15)]
        found = read(head + "".join(rows[:cut]) + head + "".join(rows[cut:]))
        assert found.forces.tolist() == [k * 10 + 0.25 for k in range(15)]


@pytest.mark.usefixtures("block")
@pytest.mark.parametrize("line", ["{0};{1}", "{0} {1}"], ids=["columns", "one column"])
@pytest.mark.parametrize(
    ("dates", "days"),
    [
        (("25.11.2026", "26.11.2026"), 1),
        (("25.11.2026", "27.11.2026"), 2),
        (("2026-11-30", "2026-12-01"), 1),
        (("11/29/2026", "12/01/2026"), 2),
        (("1/2/26", "1/3/26"), 1),
        (("1/2/26", "2/2/26"), 1),
        (("28.02.2028", "01.03.2028"), 2),
    ],
)
def test_dates_count_the_days_between_times_of_the_day(line: str, dates: tuple[str, str], days: int) -> None:
    clocks = [(0, 23, 59, 58), (0, 23, 59, 59), (1, 0, 0, 1), (1, 23, 59, 59.5)]
    text = ("Date;Time" if ";" in line else "Timestamp") + ";Load [N]\n"
    for part, h, m, s in clocks:
        text += line.format(dates[part], f"{h:02d}:{m:02d}:{s:04.1f}") + f";{s}\n"
    found = read(text)
    assert found.times is not None
    seconds = [86_400 * days * part + 3600 * h + 60 * m + s for part, h, m, s in clocks]
    assert found.times.tolist() == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("dates", "says"),
    [
        (("1/2/26", "1/4/26"), "two ways"),
        (("26.11.2026", "25.11.2026"), "do not rise"),
        (("99.99.2026", "98.11.2026"), "do not rise"),
    ],
)
def test_dates_with_two_readings_or_none_are_refused(dates: tuple[str, str], says: str) -> None:
    with pytest.raises(DataError, match=says):
        read("Date;Time;Load (N)\n" + "".join(f"{date};10:00:00.0;1\n" for date in dates))


def test_tables_above_the_longest_are_left_out_with_a_word() -> None:
    table = "".join(f"{k}.5;{k}.25\n" for k in range(9))
    found = read("Time (s);Load (N)\n0.5;7\n1.5;8\n\nTime (s);Load 2 (kN)\n" + table)
    assert len(found.forces) == 9
    assert "line 2: another table ('Time (s), Load (N)'): its 2 rows are not read" in found.remarks
    assert not read(EXPORTS["Trapezium"].data).remarks


@st.composite
def tables(draw: st.DrawFn) -> tuple[str, list[float], list[float]]:
    """A table in any dialect, and its times and forces."""
    decimal = draw(st.sampled_from(".,"))
    separator = draw(st.sampled_from([";", "\t", ",", "|"]))
    group = draw(st.sampled_from(["", "", {".": ",", ",": "."}[decimal], " ", "'", "\u202f"]))
    digits = draw(st.integers(0, 4))
    quoted = draw(st.booleans())
    unit, per = draw(st.sampled_from([("N", 1.0), ("kN", 1e3), ("lbf", 4.4482216153)]))
    n = draw(st.integers(2, 12))
    times = np.cumsum(draw(st.lists(st.integers(1, 5000), min_size=n, max_size=n))) / 1000.0
    forces = draw(st.lists(st.integers(-99_999_999, 99_999_999), min_size=n, max_size=n))
    values = [f / 10 ** draw(st.integers(0, 4)) for f in forces]
    order = draw(st.permutations([0, 1, 2]))

    def line(cells: list[str]) -> str:
        return separator.join(f'"{cells[k]}"' if quoted else cells[k] for k in order) + "\n"

    def number(value: float, places: int) -> str:
        return thousands(value, group, decimal, places)

    text = draw(st.sampled_from(["", "Report\n\n", "# made\n", "Operator: M\n"]))
    below = draw(st.booleans())
    text += line(["Time", "Ext", "Load"] if below else ["Time (s)", "Ext (mm)", f"Load ({unit})"])
    text += line(["s", "mm", unit]) if below else ""
    places = draw(st.integers(0, 3))
    times = np.unique(np.round(times, places))
    times, values = times[:n], [round(v, digits) for v in values[: len(times)]]
    for t, v in zip(times.tolist(), values, strict=True):
        text += line([number(t, places), number(t / 7, 5), number(v, digits)])
    return text + draw(st.sampled_from(["", "\nend\n"])), times.tolist(), [v * per for v in values]


@settings(max_examples=400, deadline=None)
@given(tables())
def test_any_table_is_read_to_the_value_or_refused(made: tuple[str, list[float], list[float]]) -> None:
    text, times, forces = made
    try:
        found = read(text)
    except DataError as refused:
        assert "--load-decimal" in str(refused)
        return
    assert found.times is not None
    np.testing.assert_allclose(found.times, times, atol=1e-9)
    np.testing.assert_allclose(found.forces, forces, rtol=1e-9, atol=1e-9)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.text('0123456789.,;:-+eE \t"\nNsTimeLoad()[]', max_size=12), max_size=30))
def test_any_text_is_refused_in_words_or_has_rising_times(parts: list[str]) -> None:
    try:
        found = read("".join(parts))
    except DataError as refused:
        assert str(refused).startswith("forces.csv: ")
    else:
        assert found.times is None or bool((np.diff(found.times) > 0).all())


def test_a_force_beyond_sense_is_refused() -> None:
    with pytest.raises(DataError, match=r"a force of 1e\+15 N is beyond sense; give --load-unit"):
        read("time [s];Force [N]\n0;1\n1;1e15\n")


@pytest.mark.parametrize(
    ("heading", "code_page"),
    [
        ("时间(s),试验力(kN)", "gb18030"),
        ("時間(s),荷重(kN)", "cp932"),
        ("시간(s),하중(kN)", "cp949"),
        ("Czas [s],Siła [kN]", "cp1250"),
        ("Время (с),Усилие (кН)", "cp1251"),
        ("Tempo (s),Força (kN)", "cp1252"),
    ],
)
def test_headings_of_other_languages_are_understood_in_their_code_pages(heading: str, code_page: str) -> None:
    for encoding in ("utf-8", code_page):
        found = read(f"{heading}\n0,1\n1,3\n".encode(encoding))
        assert found.taken.startswith(f"column {heading.partition(',')[2].split()[0].partition('(')[0]}, ")
        assert found.times is not None and found.times.tolist() == [0, 1]
        assert found.forces.tolist() == [1000, 3000]


def test_a_stress_in_another_language_is_no_force() -> None:
    with pytest.raises(DataError, match="no force"):
        read("时间(s),应力(MPa)\n0,1\n1,3\n")
