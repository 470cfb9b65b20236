"""The order of pictures by their names and times: a test for each kind of name."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError
from acquire.files.order import BY, in_order, masks


def ordered(names: Sequence[str], times: Sequence[float] | None = None, **how: str) -> list[str]:
    """Names without an ending in their order; ``times`` as they are given, else all alike."""
    files = [f"{name}.png" for name in names]
    places = in_order(files, lambda: times or [0.0] * len(names), **how)
    return [names[k] for k in places]


SURE = {
    "numbers": "a1 a2 a10",
    "decimals": "strain_0.05 strain_0.1 strain_0.15",
    "decimals with a unit": "e=0.5mm e=1.0mm e=10.0mm",
    "decimals and numbers": "0.5mm_1 0.5mm_2 0.5mm_10 1mm_1",
    "decimals and whole ones": "s_0 s_0.5 s_1 s_1.25 s_10",
    "decimals without a zero": "s_.05 s_.1 s_.15",
    "decimal commas": "d0,05 d0,1 d0,15",
    "small numbers of programs": "s_5e-05 s_0.0001 s_0.001",
    "signs": "load_-10 load_5 load_10",
    "signs behind an equals sign": "F=-3 F=0 F=3",
    "signs with a unit": "T=-20C T=0C T=20C",
    "signs at the beginning": "-3 -1 2",
    "signs behind a hyphen": "load--10 load-5 load-10",
    "hyphens": "frame-1 frame-2 frame-10",
    "a hyphen before a decimal": "a-1.5 a-2.5 a-10.5",
    "dates": "2025-11-25-101502 2025-11-25-101503 2025-11-26-090000",
    "hyphens on both sides": "shot-001-a shot-002-a shot-010-a",
    "letters with numbers": "P1a-1 P1b-1 P1e-1 P1f-1",
    "times": "IMG_20251125_101502 IMG_20251125_101503",
    "times with points": "10.15.02 10.15.03 10.16.01",
    "days first": "28-01-2026 31-01-2026 01-02-2026",
    "days first with points and a time": "x_31.1.2026_10.05 x_1.2.2026_09.05",
    "months first": "01-31-2026 02-01-2026 02-13-2026",
    "months in words": "Jan_x Feb_x Apr_x Dez_x",
    "days and months in words": "28Nov2026-2 01Dec2026-1",
    "twelve hours": "9.05.01am 10.05.01am 12.05.01pm 1.05.01pm",
    "words that are no months": "may_03 spec_01 spec_02",
    "numbers that are no dates": "1_2_1500 2_1_1000",
    "a reference": "ref def_1 def_2",
    "a reference at the end": "undeformed deformed",
    "a reference of ones own": "initial final",
    "before": "before_load after_load",
    "a number before": "000_ref 001_def",
    "a reference with a number": "reference_2 def_1 def_10",
    "all references": "Ref0001 Ref0002 Ref0010",
    "no reference": "a_1 preload",
    "hexadecimal": "f_0009 f_000a f_000b f_0010",
    "hexadecimal capitals": "f_000F f_0010 f_00AA",
    "hexadecimal of any length": "f_8 f_9 f_a f_b f_c f_d f_e f_f f_10",
    "versions that agree": "v1.2 v1.3 v1.4",
    "versions of three": "v1.2.3 v1.2.10",
    "a counter and its folder": "P1000999 P1010000",
    "a counter with a hole": "img_000 img_500 img_999",
    "few digits": "img_1 img_2 img_8 img_9",
    "copies": "Bild;Bild (1);Bild (2);Bild (10)",
    "brackets": "Bild(1) Bild(2) Bild(10)",
    "blanks": "img 1;img 2;img 10",
    "full-width digits": "s_５ s_６ s_１０",
    "leading zeros": "07 8 10",
    "mixed": "a_1 a_10 b_2",
    "folders": "step1/img step2/img step10/img",
}


@pytest.mark.parametrize("names", SURE.values(), ids=SURE.keys())
def test_what_names_say(names: str) -> None:
    wanted = names.split(";" if ";" in names else None)
    for seed in range(5):
        mixed = random.Random(seed).sample(wanted, len(wanted))
        assert ordered(mixed) == wanted
        assert ordered(mixed, by="name") == wanted


UNSURE = {
    "a day or a month": "03-04-2026 04-03-2026",
    "a counter that begins again": "IMG_9998 IMG_9999 IMG_0001 IMG_0002",
    "one with five digits": "DSC09998 DSC09999 DSC00001",
    "one behind a folder": "P1009999 P1000001",
    "versions": "v1.2 v1.10",
    "versions in words": "ver2.9 ver2.10",
    "versions behind a blank": "rev 3.9;rev 3.10",
    "parts of one": "test1.8 test1.9 test1.10 test1.11",
    "pairs": "d0,25 d0,5",
    "nothing above zero": "load_0 load_-10 load_-20",
    "two references": "ref_1 def_1 ref_2",
}


@pytest.mark.parametrize("names", UNSURE.values(), ids=UNSURE.keys())
def test_what_names_do_not_say_is_asked(names: str) -> None:
    wanted = names.split(";" if ";" in names else None)
    with pytest.raises(ConfigError, match=r"\.png.*--reference NAME, --order time or --order name"):
        ordered(sorted(wanted))
    assert sorted(ordered(wanted, by="name")) == sorted(wanted)
    shown = ordered(sorted(wanted), first=f"{wanted[0]}.png")
    assert sorted(shown) == sorted(wanted)
    assert "ref" in wanted[0] or shown[0] == wanted[0]


@pytest.mark.parametrize(
    "names",
    ["IMG_9998 IMG_9999 IMG_0001", "DSC09999 DSC00001", "load_0 load_-10 load_-20", "T=-30 T=-20 T=-10"],
)
def test_times_decide_where_they_are_not_those_of_the_alphabet(names: str) -> None:
    wanted = names.split()
    assert ordered(wanted, range(len(wanted))) == wanted
    alphabet = sorted(wanted)
    with pytest.raises(ConfigError):
        ordered(alphabet, range(len(wanted)))


def test_times_do_not_decide_between_versions() -> None:
    with pytest.raises(ConfigError):
        ordered(["v1.2", "v1.10"], [1.0, 2.0])


def test_in_the_order_of_time() -> None:
    assert ordered(["a", "c", "b"], [2.0, 1.0, 3.0], by="time") == ["c", "a", "b"]
    assert ordered(["a", "c", "ref"], [2.0, 1.0, 3.0], by="time") == ["ref", "c", "a"]
    with pytest.raises(ConfigError, match=r"a\.png and b\.png have the same time"):
        ordered(["a", "b"], [1.0, 1.0], by="time")


def test_masks_by_their_names() -> None:
    assert masks(["mask.png", "a1.png"]) == {"mask.png"}
    assert masks(["Maske_2.tif", "a1.png"]) == {"Maske_2.tif"}
    assert masks(["mask_1.png", "mask_2.png"]) == set()
    assert masks(["unmasked.png", "a1.png"]) == set()


@given(st.lists(st.integers(0, 99_999), min_size=1, max_size=20, unique=True), st.sampled_from(["", "0>6"]))
def test_numbers_come_in_their_order(numbers: list[int], width: str) -> None:
    wanted = [f"shot_{number:{width}}" for number in sorted(numbers)]
    try:
        assert ordered(wanted[::-1]) == wanted
    except ConfigError:  # a hole between both ends of a counter
        assert len({len(name) for name in wanted}) == 1
        assert numbers and max(numbers) - min(numbers) > 900


@given(st.lists(st.decimals(-100, 100, places=2), min_size=1, max_size=12, unique=True))
def test_decimals_come_in_their_order(numbers: list[float]) -> None:
    wanted = [f"e_{number:f}" for number in sorted(numbers)]
    assert ordered(wanted[::-1], by="name") == wanted


@given(
    st.lists(st.text("ab019_.-v, ＝١", min_size=1, max_size=8), min_size=1, max_size=7, unique=True),
    st.sampled_from(BY[:2]),
    st.randoms(),
)
def test_any_names_have_one_order_or_none(names: list[str], by: str, chance: random.Random) -> None:
    mixed = chance.sample(names, len(names))
    try:
        found = ordered(names, by=by)
    except ConfigError:
        with pytest.raises(ConfigError):
            ordered(mixed, by=by)
    else:
        assert sorted(found) == sorted(names)
        assert ordered(mixed, by=by) == found


def test_nothing_but_names_is_looked_at(tmp_path: Path) -> None:
    def none() -> list[float]:
        raise AssertionError("times are not needed")

    assert in_order(["b2.png", "b10.png", "b1.png"], none) == [2, 0, 1]
