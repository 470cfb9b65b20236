"""Which maps and instants an export takes, where it goes, and its columns in the axes asked for."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from live.pipeline.consumer import Screen
from live.results.export.formats import ExportRequest, export
from live.results.export.job import ExportJob, ExportOptions, chosen_fields
from live.results.quantities import Display
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import CONFIG, GAUGES, make_run

SHOWN = Display(mm_per_px=0.05, y_up=True, percent=True)


@pytest.mark.parametrize(
    ("start", "end", "rows"),
    [(None, None, range(12)), (0.3, 0.5, (3, 4, 5)), (0.3000001, 0.4999999, (3, 4, 5)), (0.31, None, range(4, 12)),
     (None, 0.19, (0, 1)), (0.3001, 0.4999, (4,))],
)  # fmt: skip
def test_instants_between_two_times(
    run: RunFolder, start: float | None, end: float | None, rows: Any
) -> None:
    assert run.strain.rows_between(start, end, "--from, --until") == tuple(rows)


def test_the_maps_that_are_chosen(run: RunFolder) -> None:
    strain = run.strain
    assert chosen_fields(strain, None) == (
        "u",
        "v",
        "exx",
        "eyy",
        "exy",
        "sigma_exx",
        "sigma_eyy",
        "sigma_exy",
        "status",
    )
    assert chosen_fields(strain, "all") == strain.names
    assert chosen_fields(strain, " eyy,u , eyy") == ("eyy", "u")
    assert chosen_fields(strain, None, ("ezz", "u")) == ("u",)


def test_where_an_export_goes(run: RunFolder, tmp_path: Path) -> None:
    run.path = tmp_path
    for kind, layout, name in (
        ("csv", "long", "strain.csv"), ("csv", "means", "means.csv"), ("csv", "wide", "wide"),
        ("npz", "long", "strain.npz"), ("tiff", "long", "eyy.tif"), ("vtk", "long", "vtk"),
    ):  # fmt: skip
        request = ExportRequest(kind, start_s=1.0, options=ExportOptions(layout=layout))
        assert export(run, request, Screen()) == tmp_path / "export" / name
        assert (tmp_path / "export" / name).exists()
    run.strain.names = ("residual",)
    with pytest.raises(ConfigError, match="holds none of the usual maps"):
        export(run, ExportRequest("csv", tmp_path / "x.csv"), Screen())


def test_shears_of_gauges_turn_with_the_axis(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0, 1e-3], config={**CONFIG, "gauges": GAUGES})) as run:
        values = run.strain.values
        job = ExportJob(run, ("eyy",), (1,), SHOWN, Screen())
        for name, sign in (
            ("gauge_shear", -100), ("gauge_axial", 100), ("sigma_gauge_shear", 100), ("exy", -100), ("eyy", 100),
            ("v_px", -0.05), ("sigma_exy", 100), ("time_s", 1), ("n_valid", 1),
        ):  # fmt: skip
            np.testing.assert_allclose(job.column(name), sign * values[name][1:], err_msg=name)


def test_a_file_that_cannot_be_written_leaves_nothing(
    run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks = itertools.count()

    def full(*_: Any) -> None:
        if next(ticks) > 2:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("live.results.export.maps.image", lambda *_: full() or b"")  # type: ignore[func-returns-value]
    with pytest.raises(DataError, match="No space left on device"):
        export(run, ExportRequest("vtk", tmp_path / "vtk"), Screen())
    assert list(tmp_path.iterdir()) == []
