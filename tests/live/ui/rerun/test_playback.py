"""A finished run in the view: all of its data, as in the files, drawn by the process of the view."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.text.quantity import Amount
from live.cli import main
from live.commands.show import ShowRequest, playback_messages, selected_rows, show, view_setup
from live.pipeline.consumer import Screen
from live.results.run_folder import RunFolder, open_run
from live.ui.rerun.messages import events_of, field_of, picture_of, rows_of
from live.ui.rerun.wire import Kind
from tests.live.ended import code_of
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run

chunk = pytest.importorskip("rerun.chunk")
N = len(PULLED)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("shown"), config={**CONFIG, "gauges": GAUGES})


@pytest.fixture
def run(folder: Path) -> Iterator[RunFolder]:
    with open_run(folder) as opened:
        yield opened


def drawn(path: Path) -> dict[str, list[Any]]:
    """Rows that are not static, by entity."""
    found: dict[str, list[Any]] = {}
    for part in chunk.RrdReader(path).stream():
        if not part.is_static:
            found.setdefault(str(part.entity_path), []).append(part.to_record_batch())
    return found


def test_the_messages_contain_the_data_of_the_files(run: RunFolder) -> None:
    messages = list(playback_messages(run, (0, 50, N - 1)))
    kinds = [message.kind for message in messages]
    assert kinds.count(Kind.FIELD) == kinds.count(Kind.PICTURE) == 3
    t, field = field_of(messages[-1])
    assert t == run.strain.time_s[-1]
    for name in ("u", "v", "exx", "eyy", "exy", "sigma_u", "sigma_eyy", "sigma_exy"):
        np.testing.assert_allclose(
            getattr(field, name), run.strain.maps(name, N - 1), rtol=2e-5, atol=2e-8, err_msg=name
        )
    np.testing.assert_array_equal(field.status, run.strain.maps("status", N - 1))
    pictures = [picture_of(message) for message in messages if message.kind is Kind.PICTURE]
    levels = [int(picture.image[0, 0]) for picture in pictures]
    assert all(level - 100 - 8 * k in (3, 4) for level, k in zip(levels, (0, 50, N - 1), strict=True))
    (events,) = (events_of(message) for message in messages if message.kind is Kind.EVENTS)
    assert [round(event.t, 3) for event in events] == [0.0, 0.0, 1.5]
    points = [row for message in messages if message.kind is Kind.POINTS for row in rows_of(message)]
    np.testing.assert_array_equal([row[0] for row in points], run.strain.values["gauge_axial"])
    gauges = {message.meta["name"]: rows_of(message) for message in messages if message.kind is Kind.GAUGE}
    assert list(gauges) == list(view_setup(run).gauges) == ["axial", "shear"]
    axial = np.stack([run.strain.time_s, run.gauges["axial"].value, run.gauges["axial"].sigma], axis=1)
    np.testing.assert_array_equal(gauges["axial"], axial)
    status = next(message for message in messages if message.kind is Kind.STATUS)
    assert status.meta["markdown"].startswith("**S1**, 96 instants, 33 of 34 ZOIs at the end\n\n")
    for name, gauge in run.gauges.items():
        value = Amount("strain", gauge.value[-1], gauge.sigma[-1])
        assert f"gauge **{name}** {value} at the end" in status.meta["markdown"]


def test_the_gauges_are_drawn_where_they_lie(run: RunFolder, tmp_path: Path) -> None:
    drawn = view_setup(run).outlines
    assert set(drawn) == {"axial", "shear"}
    assert drawn["axial"][0] == ((64.0, 20.0), (64.0, 76.0))
    np.testing.assert_allclose(np.mean(drawn["axial"][2][1:], axis=0), (64, 76), atol=1e-9)
    assert drawn["shear"] == (((40, 30), (90, 30), (90, 70), (40, 70), (40, 30)),)
    assert view_setup(run).with_load
    run.strain.config["gauges"] = {"axial": {"kind": "spiral"}}
    del run.gauges
    assert view_setup(run).outlines == {}
    with open_run(make_run(tmp_path, PULLED[:3], session=False)) as plain:
        plain.strain.values["force_N"][:] = np.nan
        assert not view_setup(plain).with_load


@pytest.mark.slow
def test_all_of_it_is_drawn_and_every_zoi_shows_its_values(
    folder: Path, tmp_path: Path, run: RunFolder
) -> None:
    path = tmp_path / "shown.rrd"
    assert main(["show", str(folder), "--rrd", str(path)]) == 0
    found = drawn(path)
    assert sum(len(batch) for batch in found["/specimen/map/eyy"]) == N
    assert sum(len(batch) for batch in found["/camera/picture"]) == N
    assert [sum(len(batch) for batch in found[f"/gauges/{name}"]) for name in GAUGES] == [N, N]
    batch = next(b for b in found["/specimen/values"] if "eyy_um_m" in b.schema.names)
    times = batch.column("time").cast("int64").to_pylist()
    row = int(np.argmin(np.abs(run.strain.time_s - times[-1] * 1e-9)))
    active = run.strain.grid.active
    np.testing.assert_allclose(
        batch.column("eyy_um_m").to_pylist()[-1], 1e6 * run.strain.maps("eyy", row)[active], rtol=2e-5
    )


def test_it_serves_until_it_is_stopped(run: RunFolder) -> None:
    stop, lines = threading.Event(), list[str]()

    class RecordingScreen(Screen):
        def print(self, text: str = "") -> None:
            lines.append(text)
            if "--connect" in text:
                stop.set()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("live.commands.show.spawn_viewer", lambda port, notify: None)
        show(run, ShowRequest(every=40), RecordingScreen(), stop, port=19876)
    assert any("this shows it, Ctrl-C ends it" in line for line in lines)
    assert lines[0] == "3 of 96 instants are shown; --from, --to and --every choose others"


@pytest.mark.parametrize(
    ("shown", "rows"),
    [
        (ShowRequest(), tuple(range(N))),
        (ShowRequest(every=50), (45, 95)),
        (ShowRequest(1.0, 1.25), (10, 11, 12)),
    ],
)
def test_which_rows_are_shown(run: RunFolder, shown: ShowRequest, rows: tuple[int, ...]) -> None:
    run.strain.values["time_s"][:] = 0.1 * np.arange(N)
    assert selected_rows(run, shown) == rows


@pytest.mark.parametrize(
    ("more", "code", "says"),
    [
        (["--from", "100"], 2, "no measurement between 100 and"),
        (["--every", "0"], 2, "--every: '0': give a whole number from 1"),
        (["--port", "80"], 2, "--port: '80': give a whole number from 1024 to 65535"),
        (["--rrd", "{folder}/strain.h5"], 2, "exists already and is not overwritten"),
    ],
)
def test_refusals(
    folder: Path, capsys: pytest.CaptureFixture[str], more: list[str], code: int, says: str
) -> None:
    assert code_of(["show", str(folder), *(word.format(folder=folder) for word in more)]) == code
    assert says in capsys.readouterr().err


@pytest.mark.slow
def test_damaged_results_end_it_with_a_message(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from acquire.errors import DataError

    def broken(*_: object) -> None:
        raise DataError("strain.h5: map 'u' cannot be read")

    monkeypatch.setattr("live.results.run_folder.read_field", broken)
    assert main(["show", str(folder), "--rrd", str(tmp_path / "a.rrd")]) == 4
    assert "map 'u' cannot be read" in capsys.readouterr().err
