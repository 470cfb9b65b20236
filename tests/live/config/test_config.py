"""The configuration and the rig file: accepted and refused values, messages, changes that keep comments."""

from __future__ import annotations

import json
import math
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError
from live.config.loading import Config, from_dict, laid_over, load_config, settings_in
from live.config.rig_file import new_rig, write_rig
from live.config.sections import SpecimenConfig
from live.setup.grid import grid_for
from live.ui.web.setup.config_draft import ConfigDraft


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_file_and_command_line(tmp_path: Path) -> None:
    path = written(
        tmp_path, "[measure]\nzoi = 32\nstep = 8\nroi = [0, 0, 100, 90]\n[metadata]\noperator = 'J'\n"
    )
    config = load_config(path, {"measure.zoi": 48, "camera.address": "sim:"})
    assert (config.measure.zoi, config.measure.step, config.measure.roi) == (48, 8, (0, 0, 100, 90))
    assert config.camera.address == "sim:"
    assert config.metadata == {"operator": "J"}


def test_stored_configuration_comes_back() -> None:
    values = {"measure.burst": 3, "specimen.width_mm": 10.0, "specimen.modulus_between": [0.001, 0.002]}
    config = load_config(None, values | {"metadata.note": "x"})
    assert from_dict(config.as_dict(), {}, "a session") == config
    stored = config.as_dict()
    for value in (False, True, "x"):  # a withdrawn key of an older version
        stored["measure"]["shorten_bursts"] = value
        assert from_dict(stored, {}, "a session") == config


def test_gauges_come_back_and_are_added_to() -> None:
    values = {"gauges.axial": {"start": [10, 20.5], "end": [10, 90]}}
    config = load_config(None, values)
    assert config.gauges["axial"]["start"] == (10.0, 20.5)
    stored = json.loads(json.dumps(config.as_dict()))
    assert from_dict(stored, {}, "a session") == config
    both = from_dict(stored, {"gauges.point": {"kind": "zoi", "at": [3, 4]}}, "a session")
    assert list(both.gauges) == ["axial", "point"]


def test_a_file_sets_only_what_it_says(tmp_path: Path) -> None:
    assert settings_in(written(tmp_path, "[measure]\nzoi = 32\n")) == {"measure.zoi": 32}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[measure]\nzio = 32\n", "measure.zio (did you mean zoi?)"),
        ("[mesure]\nzoi = 32\n", "[mesure] (did you mean measure?)"),
        ("[measure]\nzoi = 'big'\n", "measure.zoi = 'big' is not possible; allowed: a whole number from 8"),
        ("[measure]\nburst = 0\n", "measure.burst = 0 is not possible"),
        ("[measure]\nzoi = true\n", "measure.zoi = True"),
        ("[measure]\nroi = [1, 2, 3]\n", "four whole numbers"),
        ("[measure]\nroi = [-1, 2, 3, 4]\n", "from 0"),
        ("[measure]\nwindow = 'hann'\n", "one of 'gaussian', 'uniform', 'tukey', 'bi-triangular'"),
        ("[record]\nmode = 'every=0'\n", "every=K"),
        ("[specimen]\nwidth_mm = nan\n", "specimen.width_mm"),
        ("[specimen]\nmodulus_between = [0.003, 0.001]\n", "0 <= from < to"),
        ("[specimen]\nmodulus_between = 0.1\n", "two strains, from and to"),
        ("[specimen]\nstandard = 'din'\n", "one of 'iso6892', 'iso527'"),
        ("[gauges]\naxial = 3\n", "gauges.axial must be a table"),
        ("[gauges.'a b']\nkind = 'line'\n", "a letter first"),
        ("[gauges.axial]\nkind = 'lin'\n", "gauges.axial.kind = 'lin'"),
        ("[gauges.axial]\nstart = [1, 'x']\n", "two numbers: x, y in px"),
        ("[gauges.axial]\nstrat = [1, 2]\n", "gauges.axial.strat (did you mean start?)"),
        ("[gauges.hole]\ncorners = [[1, 2], [3, 4]]\n", "3 to 100 corners"),
        ("[load]\nmax_gap_s = inf\n", "load.max_gap_s"),
        ("measure = 3\n", "must be a section"),
        (
            "[measure]\nshorten_bursts = true\n",
            "measure.shorten_bursts is withdrawn: a burst keeps its length",
        ),
        ("[metadata]\nx = [1]\n", "metadata.x"),
        ("[measure\n", "not valid TOML"),
    ],
)
def test_refusals_name_the_key_and_what_is_allowed(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(written(tmp_path, text), {})
    assert message in str(caught.value)
    assert "rig.toml" in str(caught.value)


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such configuration file"):
        load_config(tmp_path / "none.toml", {})
    binary = tmp_path / "b.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="is no text in UTF-8; save it so in an editor"):
        load_config(binary, {})


@given(st.text(max_size=200))
def test_any_text_gives_a_configuration_or_a_clear_refusal(text: str) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.toml"
        path.write_text(text, encoding="utf-8", errors="replace")
        try:
            assert isinstance(load_config(path, {}), Config)
        except ConfigError as error:
            assert "x.toml" in str(error)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    )
)
def test_any_value_of_a_stored_key_is_taken_or_refused(value: Any) -> None:
    for key in ("zoi", "roi", "mask", "window", "noise_GL"):
        try:
            from_dict({"measure": {key: value}}, {}, "a session")
        except ConfigError as error:
            assert f"measure.{key}" in str(error)


def test_a_region_that_nobody_has_looked_for_is_refused() -> None:
    config = load_config(None, {"measure.roi": "auto"})
    with pytest.raises(ConfigError, match="found by run, check and replay"):
        grid_for(config, 640, 480, None)


def test_lengths_in_mm() -> None:
    config = load_config(
        None,
        {
            "scale.mm_per_px": 0.05,
            "measure.zoi": "3.2 mm",
            "measure.roi": "5, 4.99, 20,30mm",
            "gauges.axial": {"start": "10.01, 5 mm", "end": ["10 mm", 400]},
            "gauges.area": {"kind": "area", "corners": ["1,1 mm", "2,1 mm", [40, 50.5]]},
            "gauges.box": {"kind": "area", "box": "1, 2, 3.01, 4 mm"},
        },
    )
    assert (config.measure.zoi, config.measure.roi) == (64, (100, 100, 400, 600))
    assert config.gauges["axial"]["start"] == pytest.approx((200.2, 100))
    assert config.gauges["axial"]["end"] == pytest.approx((200, 400))
    assert config.gauges["area"]["corners"] == ((20, 20), (40, 20), (40, 50.5))
    assert config.gauges["box"]["box"] == pytest.approx((20, 40, 60.2, 80))
    assert from_dict(config.as_dict(), {"measure.step": "0.8mm"}, "a session").measure.step == 16


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"measure.zoi": "3 mm"}, "measure.zoi = '3 mm' is not possible; allowed: px; for mm the scale"),
        ({"measure.zoi": "3 mm", "scale.mm_per_px": 1}, "a whole number from 8"),
        ({"measure.zoi": "3, 3 mm", "scale.mm_per_px": 0.05}, "a whole number from 8"),
        ({"measure.roi": "1,2 mm", "scale.mm_per_px": 0.05}, "four whole numbers"),
        ({"measure.burst": "3 mm", "scale.mm_per_px": 0.05}, "a whole number from 1"),
        ({"measure.zoi": "9e99mm", "scale.mm_per_px": 0.05}, "a whole number from 8"),
        ({"measure.zoi": "9" * 300 + "mm", "scale.mm_per_px": 0.05}, "within the picture"),
        ({"scale.mm_per_px": 0}, "a number from 1e-06"),
        ({"scale": 3}, "scale must be a section"),
    ],
)
def test_lengths_in_mm_that_cannot_be(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        from_dict(values if "scale" in values else {}, {} if "scale" in values else values, "here")


TEXT = """# of the big frame
[camera]
address = "sim:"  # the left one

[measure]
# what is measured
zoi = 48  # px
step = 16

[gauges.axial]
kind = "line"  # the extensometer
start = [10, 20]
end = [10, 90]
"""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    return path


def test_a_key_is_changed_and_all_else_is_kept(rig: Path) -> None:
    config = write_rig(rig, {"measure.zoi": 64, "measure.roi": (1, 2, 300, 400), "camera.crop": None})
    assert (config.measure.zoi, config.measure.roi) == (64, (1, 2, 300, 400))
    assert load_config(rig, {}) == config
    kept = rig.read_text()
    assert "zoi = 64  # px" in kept
    for line in ("# of the big frame", '"sim:"  # the left one', "# what is measured", "step = 16"):
        assert line in kept
    assert (rig.parent / "rig.toml.bak").read_text() == TEXT
    assert sorted(p.name for p in rig.parent.iterdir()) == ["rig.toml", "rig.toml.bak"]


def test_gauges_come_and_go(rig: Path) -> None:
    point = {"kind": "zoi", "at": (30.5, 40), "value": None}
    config = write_rig(rig, {"gauges.point": point, "gauges.axial": None})
    assert list(config.gauges) == ["point"]
    assert config.gauges["point"]["at"] == (30.5, 40.0)
    assert list(write_rig(rig, {"gauges.point": None}).gauges) == []


def test_a_new_file_is_made(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    gauge = {"start": [1, 2], "end": [1, 50]}
    config = write_rig(path, {"camera.address": "sim:", "gauges.a": gauge, "measure.zoi": 32})
    assert load_config(path, {}) == config
    assert "[gauges.a]" in path.read_text()
    assert not path.with_name("new.toml.bak").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"measure.zoi": 2}, "measure.zoi = 2 is not possible; allowed: a whole number from 8"),
        ({"measure.zio": 32}, "did you mean zoi?"),
        ({"measure.zoi": 64, "gauges.2x": {}}, "a name has up to 32 letters"),
        ({"measure": 1}, "names a section and a key"),
        ({"nothing.here": 1}, "unknown section"),
    ],
)
def test_what_is_not_possible_changes_nothing(rig: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        write_rig(rig, changes)
    assert message in str(refused.value)
    assert ".part" not in str(refused.value)
    assert rig.read_text() == TEXT
    assert [p.name for p in rig.parent.iterdir()] == ["rig.toml"]


@pytest.mark.parametrize("text", ["[measure\n", "measure = 3\n", "[" * 5000, "a = 1\na = 2\n", "\0"])
def test_a_file_that_is_no_configuration_is_refused(rig: Path, text: str) -> None:
    rig.write_text(text)
    with pytest.raises(ConfigError, match=r"rig\.toml"):
        write_rig(rig, {"measure.zoi": 64})
    assert rig.read_text() == text


def test_a_new_rig_overwrites_nothing(rig: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is not overwritten"):
        new_rig(rig, TEXT)
    with pytest.raises(ConfigError, match="cannot be written"):
        new_rig(tmp_path / "no" / "folder.toml", TEXT)
    assert new_rig(tmp_path / "other.toml", TEXT).measure.zoi == 48


@pytest.mark.parametrize("box", [[-1, 0, 10, 10], [0, -1, 10, 10], [0, 0, 0, 10], [0, 0, 10, 0]])
def test_a_box_lies_in_the_picture(box: list[int]) -> None:
    with pytest.raises(ConfigError, match="x and y from 0, width and height from 1"):
        load_config(None, {"measure.roi": box})


def test_an_alarm_has_one_limit(tmp_path: Path) -> None:
    for limits, good in (
        ("above = 1", True),
        ("below = 1", True),
        ("above = 2\nbelow = 1", False),
        ("", False),
    ):
        path = written(tmp_path, f"[load]\naddress = 'sim:'\n[[alarm]]\nchannel = 'force_N'\n{limits}\n")
        with nullcontext() if good else pytest.raises(ConfigError, match="give one of above and below"):
            assert len(load_config(path, {}).alarm) == 1


@pytest.mark.parametrize(
    ("given_as", "address"), [("none", "none:"), ("None", "none:"), ("none:", "none:"), ("sim:", "sim:")]
)
def test_no_load_cell_is_said_with_and_without_a_colon(tmp_path: Path, given_as: str, address: str) -> None:
    assert load_config(None, {"load.address": given_as}).load.address == address
    assert load_config(written(tmp_path, f'[load]\naddress = "{given_as}"'), {}).load.address == address


@pytest.mark.parametrize(
    "shape", [{"area_mm2": 400.0}, {"diameter_mm": 30.0}, {"width_mm": 5.0, "thickness_mm": 5.0}]
)
def test_a_section_given_in_another_way_replaces_that_of_the_file(
    shape: dict[str, float], tmp_path: Path
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[specimen]\n" + "".join(f"{key} = {value}\n" for key, value in shape.items()))
    flat, before = (
        {"specimen.width_mm": 20.0, "specimen.thickness_mm": 2.0},
        load_config(rig, {}).specimen.area_m2,
    )
    for new, area in ((flat, 40e-6), ({"specimen.area_mm2": 7.0}, 7e-6), ({}, before)):
        assert load_config(rig, new).specimen.area_m2 == pytest.approx(area)
        draft = ConfigDraft(load_config(rig, {}), rig, {})
        draft.change_all(new)
        assert draft.config.specimen.area_m2 == pytest.approx(area)
        saved = ConfigDraft(load_config(rig, new), rig, new)
        again = from_dict(draft.config.as_dict(), laid_over(settings_in(rig), new), "")
        assert again.specimen.area_m2 == pytest.approx(area)
        text = rig.read_text()
        saved.save(None)
        assert load_config(rig, {}).specimen.area_m2 == pytest.approx(area)
        rig.write_text(text)


def test_an_impossible_option_is_of_the_command_line(tmp_path: Path) -> None:
    rig = written(tmp_path, '[scale]\nmm_per_px = 0.05\n[measure]\nzoi = "2mm"\n[load]\naddress = "sim:"')
    assert load_config(rig, {"measure.step": "1mm"}).measure.step == 20
    for key, value in (("measure.zoi", 0), ("scale.mm_per_px", 0.0), ("load.lag_s", math.nan)):
        for read in (lambda given: load_config(rig, given), lambda given: from_dict({}, given, "session.h5")):
            with pytest.raises(ConfigError, match=f"command line: {key} = .* is not possible"):
                read({key: value})


def test_two_sections_in_one_file_are_refused(tmp_path: Path) -> None:
    rig = written(tmp_path, "[specimen]\nwidth_mm = 20\nthickness_mm = 2\ndiameter_mm = 10")
    named = "specimen.width_mm and specimen.thickness_mm and specimen.diameter_mm are two sections"
    with pytest.raises(ConfigError, match=named):
        load_config(rig, {})
    stored = {"specimen": {"width_mm": 20.0, "thickness_mm": 2.0, "diameter_mm": 10.0}}
    assert from_dict(stored, {}, "").specimen.area_m2 == pytest.approx(40e-6), (
        "of a session that was recorded"
    )


@pytest.mark.parametrize(
    ("given", "text", "area"),
    [
        ({"width_mm": 12.0, "thickness_mm": 5.0}, "12 mm x 5 mm", 60e-6),
        ({"diameter_mm": 10.0}, "diameter 10 mm", 78.5398e-6),
        ({"width_mm": 20.0, "thickness_mm": 2.0, "diameter_mm": 10.0}, "20 mm x 2 mm", 40e-6),
        ({"area_mm2": 7.0, "width_mm": 20.0, "thickness_mm": 2.0}, "7 mm2", 7e-6),
        ({"width_mm": 12.0}, "", None),
    ],
)
def test_a_section_in_words_and_its_area(given: dict[str, float], text: str, area: float | None) -> None:
    specimen = SpecimenConfig(**given)
    assert (specimen.section_text, specimen.area_m2) == (text, area and pytest.approx(area))
