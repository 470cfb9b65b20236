"""R3XA exports: the metadata of an experiment and its tables."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.load_sample import LoadCellInfo
from live.pipeline.consumer import Screen
from live.results.export.job import ExportJob
from live.results.export.tables import VERSION, describe
from live.results.quantities import Display
from live.results.run_folder import RunFolder
from tests.live.made_run import THICKNESS_MM, WIDTH_MM, force_of
from tests.live.results.export.test_tables import exported, table


def parts_of(described: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {
        one["id"]: one for part in ("settings", "data_sources", "data_sets") for one in described[part]
    }  # fmt: skip


def test_the_metadata_of_an_experiment(run: RunFolder, tmp_path: Path) -> None:
    out = exported(run, tmp_path / "r", "r3xa", start_s=0.3, end_s=0.5)
    described = json.loads((out / "r3xa.json").read_text(encoding="utf-8"))
    assert (described["title"], described["version"]) == ("S1", VERSION)
    assert described["description"] == "Displacement and strain fields measured by phasedic"
    assert (described["authors"], described["date"]) == ([{"name": "Zoé"}], "2030-01-02")
    parts = parts_of(described)
    assert len(parts) == sum(len(described[name]) for name in ("settings", "data_sources", "data_sets"))
    for item in described["data_sets"]:
        assert (out / item["path"]).exists() and set(item["parent_data_sources"]) <= parts.keys()
    assert [(one["title"], one["unit"], one["value"]) for one in parts["stg-specimen"]["sizes"]] == [
        ("width", "mm", WIDTH_MM),
        ("thickness", "mm", THICKNESS_MM),
    ]
    camera = parts["src-camera"]
    assert (camera["title"], camera["output_dimension"], camera["output_components"]) == (
        "made up",
        "surface",
        1,
    )
    assert [(one["unit"], one["value"]) for one in camera["image_size"]] == [("px", 128), ("px", 96)]
    assert camera["output_units"] == [{"kind": "unit", "unit": "GL"}] and "exposure" not in camera
    load = parts["src-load"]
    assert (load["title"], load["output_dimension"]) == ("made-up cell", "point")
    assert load["capacity"] == {"kind": "unit", "unit": "N", "value": 5000.0}
    assert load["output_units"] == [{"kind": "unit", "unit": "N"}]
    dic, strain = parts["src-dic"], parts["src-strain"]
    assert [(one["unit"], one["title"]) for one in dic["output_units"]] == [("mm", "u"), ("mm", "v")]
    assert [one["value"] for one in (*dic["subset_size"], dic["step_size"])] == [32, 32, 16]
    assert (dic["shape_function"], dic["model"], dic["output_components"]) == ("affine", "0.1.0", 2)
    assert [(one["unit"], one["title"]) for one in strain["output_units"]] == [
        ("%", n) for n in ("exx", "eyy", "exy")
    ]
    assert strain["virtual_strain_gauge_size"]["value"] == 32 and strain["description"].startswith(
        "small strain"
    )
    assert {one["kind"] for one in (dic, strain)} == {
        "data_sources/dic_measurement",
        "data_sources/strain_computation",
    }
    fields, means = parts["set-fields"], parts["set-means"]
    assert fields["timestamps"] == pytest.approx([0.3, 0.4, 0.5]) and fields["path"] == "fields"
    assert fields["values"] == ["00000.csv", "00001.csv", "00002.csv"]
    assert means["timestamps"]["col"] == "time_s" and means["values"]["col"] == "eyy_percent"
    assert (means["values"]["filename"], means["values"]["rows"], means["values"]["delimiter"]) == (
        "means.csv", [0, None], ",",
    )  # fmt: skip
    assert means["time_reference"] == {"kind": "unit", "unit": "s", "value": 0.0}
    assert (
        parts["set-load"]["values"]["col"] == "force_N"
        and parts["set-load"]["timestamps"]["filename"] == "load.csv"
    )
    assert (tmp_path / "r" / parts["set-images"]["path"]).resolve() == (run.path / "session.h5").resolve()
    assert (tmp_path / "r" / parts["set-results"]["path"]).resolve() == (run.path / "strain.h5").resolve()


def test_what_was_recorded_besides(run: RunFolder, tmp_path: Path) -> None:
    job = ExportJob(run, ("eyy",), (0,), Display(), Screen())
    run.strain.metadata.update(note="a note", operator="")
    run.strain.config["measure"]["order"] = 2
    run.__dict__["pictures"] = replace(run.pictures, info=replace(run.pictures.info, exposure_s=0.008))  # type: ignore[union-attr, type-var]
    run.session.load_cell = LoadCellInfo("x", "a cell", "ascii")  # type: ignore[union-attr, misc]
    described = describe(job, tmp_path, True)
    parts = parts_of(described)
    assert described["description"] == "a note" and described["authors"] == [{"name": "not recorded"}]
    assert (
        parts["src-dic"]["shape_function"] == "quadratic"
        and parts["src-dic"]["output_units"][0]["unit"] == "px"
    )
    assert parts["src-strain"]["output_units"][0]["unit"] == "1"
    assert parts["src-camera"]["exposure"] == {"kind": "unit", "unit": "s", "value": 0.008}
    assert parts["src-load"]["title"] == "a cell" and "capacity" not in parts["src-load"]
    run.__dict__["pictures"] = None
    parts = parts_of(describe(job, tmp_path, False))
    assert "image_size" not in parts["src-camera"] and parts["src-camera"]["title"] == "sim:made-up"
    assert not {"src-load", "set-load"} & parts.keys()


def test_the_tables_of_r3xa_hold_the_instants_asked_for(run: RunFolder, tmp_path: Path) -> None:
    out = exported(run, tmp_path / "r", "r3xa", start_s=0.3, end_s=0.5)
    comments, columns = table(out / "fields" / "00001.csv")
    grid, active = run.strain.grid, run.strain.grid.active
    assert not comments
    np.testing.assert_allclose(columns["eyy_percent"], 100 * run.strain.maps("eyy", 4)[active], rtol=1e-6)
    rows, places = np.nonzero(active)
    np.testing.assert_allclose(columns["x_mm"], 0.05 * grid.x[places])
    np.testing.assert_allclose(columns["y_mm"], -0.05 * grid.y[rows])
    _, means = table(out / "means.csv")
    np.testing.assert_allclose(means["time_s"], [0.3, 0.4, 0.5])
    _, loads = table(out / "load.csv")
    np.testing.assert_allclose(loads["time_s"], 0.1 * np.arange(12), atol=1e-9)
    np.testing.assert_allclose(loads["force_N"], [force_of(1e-4 * k) for k in range(12)])
