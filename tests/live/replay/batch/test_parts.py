"""A short session in two chunks, joined: the results of one replay; and what chunks and failures leave."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.frame import frozen
from acquire.load_sample import LoadSample
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.pipeline.consumer import Screen
from live.replay.batch import task as module
from live.replay.batch.row import RENEWED, BatchRow
from live.replay.batch.task import FIELDS_FILE, LOG_FILE, ROW_FILE, Task, TaskProgress, perform, row_done
from live.replay.parts import _BURST, StoredResults, measure_part
from live.results import Strain
from live.words.language import said
from tests.live.made_run import session_writer
from tests.live.made_up import START, make_frame

SHAPE = (96, 128)
MEASURE = {"zoi": 32, "step": 32, "burst": 1, "reference_burst": 1, "noise_GL": 16.0, "roi": "all"}


def write_session(folder: Path, pictures: list[np.ndarray]) -> str:
    folder.mkdir()
    with session_writer(folder, {"measure": MEASURE}, {}) as writer:
        for k, picture in enumerate(pictures):
            image = frozen(np.rint(4080 * picture).astype(np.uint16))
            lost = 2 if k == 6 else 0
            one = make_frame(k + 2 * (k >= 6), START + 0.1 * k)
            writer.write_frame(dataclasses.replace(one, image=image, lost_before=lost))
            writer.write_load(LoadSample(START + 0.1 * k, 10.0 * k))
    return str(folder / "session.h5")


def picture(strain: float, seed: int = 5) -> np.ndarray:
    return np.asarray(Speckle(SHAPE, radius=2.0, seed=seed).render(Affine(x0=64, y0=48, dv_dy=strain), SHAPE))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A reference and eleven bursts, of which the sixth follows two lost frames."""
    strains = [picture(2e-4 * k) for k in range(12)]
    return write_session(tmp_path_factory.mktemp("parts") / "run", strains)


def progressed(task: Task) -> tuple[Any, list[TaskProgress]]:
    told: list[TaskProgress] = []
    return perform(task, told.append), told


def test_chunks_joined_are_a_replay(session: str, tmp_path: Path) -> None:
    whole = Task("whole", str(tmp_path), session, key="w")
    row, _ = progressed(whole)
    assert row.is_well and row.values["instants"] == 11
    chunks = [
        dataclasses.replace(whole, name="0000", of="long", numbers=(0, 7), key="a"),
        dataclasses.replace(whole, name="0001", of="long", numbers=(4, 11), run_in=3, key="b"),
    ]
    for chunk, count in zip(chunks, (7, 7), strict=True):
        done, told = progressed(chunk)
        assert (done.values["test"], done.values["outcome"]) == (chunk.title, "done")
        assert {path.name for path in chunk.folder.iterdir()} == {FIELDS_FILE, LOG_FILE, ROW_FILE}
        assert (told[-1].done, told[-1].expected) == (count, count)
    for chunk in chunks:
        stored = json.loads((chunk.folder / ROW_FILE).read_text(encoding="utf-8"))
        stored["row"]["seconds"] = 1000.0
        (chunk.folder / ROW_FILE).write_text(json.dumps(stored), encoding="utf-8")
    joined = dataclasses.replace(whole, name="long", chunks=[str(chunk.folder) for chunk in chunks], key="j")
    row, _ = progressed(joined)
    assert row.is_well and row.values["instants"] == 11 and row.values["frames_lost"] == 2
    assert 2000 < float(row.values["seconds"]) < 2100, "with that of its chunks"
    assert "joined of 2 chunks" in (joined.folder / LOG_FILE).read_text(encoding="utf-8")
    with Strain.open(whole.folder / "strain.h5") as one, Strain.open(joined.folder / "strain.h5") as other:
        for name in ("frame", "last_frame", "time_s", "force_N", "lost", "n_valid", "noise_GL"):
            np.testing.assert_array_equal(other.values[name], one.values[name], err_msg=name)
        for name in ("u", "v", "eyy", "sigma_eyy", "residual", "status", "iterations"):
            np.testing.assert_array_equal(other.maps(name)[:7], one.maps(name)[:7], err_msg=name)
        for name in ("u", "v", "exx", "eyy"):
            sigma = np.nanmedian(one.maps(f"sigma_{name}"))
            assert np.nanmax(np.abs(other.maps(name) - one.maps(name))) < 0.01 * sigma, name
        assert one.values["lost"].tolist() == [0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0]
        np.testing.assert_allclose(other.values["eyy"], 2e-4 * np.arange(1, 12), atol=2e-5)


def test_a_chunk_in_which_a_reference_is_renewed_replaces_no_part(tmp_path: Path) -> None:
    """Another pattern fades in while the specimen is pulled."""

    def mixed(share: float, strain: float) -> np.ndarray:
        moved = Affine(x0=64, y0=48, u=100 * strain, du_dx=strain)
        one, other = (Speckle(SHAPE, radius=2.0, seed=seed).render(moved, SHAPE) for seed in (5, 6))
        return share * np.asarray(one) + (1 - share) * np.asarray(other)

    pictures = [mixed(1.0, 0.0)] * 3 + [mixed(0.96, 0.02), mixed(0.92, 0.03)]
    source = write_session(tmp_path / "run", pictures)
    task = Task(
        "0000", str(tmp_path), source, of="long", numbers=(0, 4), key="a", overrides={"measure.step": 16}
    )
    row = perform(task)
    assert (row.values["outcome"], row.values["exit_code"]) == (RENEWED, 0)
    still = dataclasses.replace(task, name="0001", numbers=(0, 2), key="b")
    assert perform(still).values["outcome"] == "done"


def test_pictures_have_no_parts(tmp_path: Path) -> None:
    request = Task("a", str(tmp_path), "files:/nowhere/*.png").request(tmp_path)
    with pytest.raises(DataError, match="pictures are not measured in parts"):
        measure_part(request, None, 0, Screen())  # type: ignore[arg-type]


def test_a_damaged_part_is_refused_and_no_reference_can_be_renewed(tmp_path: Path) -> None:
    (tmp_path / FIELDS_FILE).write_bytes(b"no array")
    nothing: Any = object()
    assert StoredResults.of((), nothing) is None
    stored = object.__new__(StoredResults)
    stored._parts, stored._ready = [tmp_path / FIELDS_FILE], nothing
    with pytest.raises(DataError, match="remove it and call again"):
        list(stored.bursts())
    with pytest.raises(ValueError, match="no reference was renewed"):
        stored.renewed()
    assert _BURST.names is not None and _BURST.names[-1] == "field_noise"


class Fails:
    """In place of a replay: raises."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def __call__(self, *_: Any) -> Any:
        raise self.error


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (DataError("STAGING/session.h5: is damaged"), 4, "FOLDER/session.h5: is damaged"),
        (OSError(28, "No space left on device", "STAGING/strain.h5"), 4,
         "FOLDER/strain.h5: cannot be written (No space left on device); make room"),
        (OSError("gone"), 4, "FOLDER: cannot be written (gone); make room"),
        (ZeroDivisionError("oh"), 1, "a defect of phasedic: ZeroDivisionError: oh"),
    ],
)  # fmt: skip
def test_a_task_that_fails_is_a_row_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, code: int, words: str
) -> None:
    task = Task("a", str(tmp_path), "session.h5", key="k")
    staging = str(module.staging_dir(task.folder))
    if isinstance(error, OSError) and error.filename:
        error.filename = error.filename.replace("STAGING", staging)
    elif isinstance(error, DataError):
        error = DataError(str(error).replace("STAGING", staging))
    monkeypatch.setattr(module, "replay", Fails(error))
    row = perform(task)
    assert (row.values["outcome"], row.values["exit_code"]) == ("failed", code)
    assert row.values["error"] == words.replace("FOLDER", str(task.folder))
    elsewhere = BatchRow.of(
        json.loads(json.dumps(row.to_json()))
    )  # an error comes from a worker as a message
    assert elsewhere.values == row.values and said(elsewhere.words, "de").startswith("a: gescheitert: ")
    if isinstance(error, OSError):
        assert "Platz schaffen" in said(elsewhere.words, "de")
    assert list(tmp_path.iterdir()) == [] and row_done(task) is None


def test_what_another_caller_has_done_meanwhile_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = Task("a", str(tmp_path), "session.h5", key="k")

    def replay(*_: Any) -> Any:
        task.folder.mkdir()
        row = {"test": "a", "outcome": "done", "exit_code": 0}
        (task.folder / ROW_FILE).write_text(json.dumps({"key": "k", "row": row}), encoding="utf-8")
        raise DataError("late")

    monkeypatch.setattr(module, "replay", replay)
    assert perform(task).is_well
    assert row_done(dataclasses.replace(task, key="other")) is None, "of other settings"


def test_progress_is_reported_four_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now, told = [100.0], list[TaskProgress]()
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    screen = module._LogScreen(None, told.append)  # type: ignore[arg-type]
    step: Any = type("Step", (), {"n_zoi": 7})()
    for k in range(5):
        now[0] = 100.0 + 0.125 * k
        screen.progress(step, k + 1, 9, 0.0)
    assert told == [TaskProgress(1, 9, 7), TaskProgress(3, 9, 21), TaskProgress(5, 9, 35)]
    assert screen.last == TaskProgress(5, 9, 35)
