"""``make bench``: throughput of the kernel beside other engines on the same pictures, in one run.

1024 x 1024 px, 8 bit, 1 % noise, r = 2 px. Tracking: 0.23 px and 1e-4 strain a frame; every figure includes the
prefilter of the frame, sigma, residual and status. OpenCV's engines run beside it always, pyvale and SUN-DIC where
installed (the extra ``peers``). The tables are printed and written to docs/data/bench.md, with ``--live`` to
docs/data/live.md. ``--json`` prints one JSON object instead; it and ``--only`` write nothing.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.kernel.warm_up import warm_up
from tests.accuracy.truth import Speckle, affine, digitise
from tests.bench import gauges as gauge_case
from tests.bench import live, machine
from tests.bench.peers import HOW_TO_ADD, Peer, missing, peers
from tests.paper.others import Points

DATA = Path(__file__).parents[2] / "docs" / "data"
SHAPE = (1024, 1024)
NOISE = 0.01
FRAMES = 12
STEP = {"u": 0.2, "v": -0.11, "du_dx": 1e-4, "dv_dy": -3e-5, "du_dy": 2e-5}


@lru_cache(maxsize=2)
def sequence(rotation: float = 0.0) -> list[NDArray[np.uint8]]:
    """Reference and frames; ``rotation`` in degrees is there from the first frame on."""
    rng = np.random.default_rng(1)
    pattern = Speckle(2.0, 3)
    frames = [digitise(pattern.at(*affine(SHAPE)), 8, NOISE, rng)]
    a = np.deg2rad(rotation)
    for i in range(1, FRAMES + 1):
        m = {k: i * v for k, v in STEP.items()}
        m["du_dx"] += np.cos(a) - 1
        m["dv_dy"] += np.cos(a) - 1
        m["du_dy"] -= np.sin(a)
        m["dv_dx"] = np.sin(a)
        frames.append(digitise(pattern.at(*affine(SHAPE, **m)), 8, NOISE, rng))
    return frames


@dataclass
class Report:
    """Lines for people and the same values for machines."""

    quiet: bool
    values: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def emit(self, *lines: str) -> None:
        """Keep lines for the page, and print them unless quiet."""
        self.lines += lines
        if not self.quiet:
            print(*lines, sep="\n", flush=True)

    def add(self, section: str, row: dict[str, Any]) -> None:
        rows = self.values.setdefault(section, [])
        if not rows:
            self.emit("", f"## {section}", "", "| " + " | ".join(row) + " |", "|" + "---|" * len(row))
        self.emit("| " + " | ".join(_shown(v) for v in row.values()) + " |")
        rows.append(row)


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def zois(size: int, step: int = 8, margin: int = 8, every: int = 1) -> ZoiGrid:
    side = SHAPE[0] - 2 * margin
    return ZoiGrid.cover(Roi(margin, margin, side, side), size, step).subset(every=every)


SIGMA = float(np.hypot(NOISE * 255, 0.29))


def track(kernel: PhaseKernel, frames: list[NDArray]) -> tuple[float, StrainField, StrainField]:
    """Shortest time a frame once the sequence runs, its field, and the one before."""
    before = kernel.measure(frames[1], noise=SIGMA)
    now = kernel.measure(frames[2], start=before, noise=SIGMA)
    shortest = np.inf
    for frame in frames[3:]:
        for _ in range(3):  # the same frame again: the shortest counts
            begin = time.perf_counter()
            later = kernel.measure(frame, start=now, noise=SIGMA)
            shortest = min(shortest, time.perf_counter() - begin)
        before, now = now, later
    return shortest, now, before


def unsettled(size: int, frames: list[NDArray], found: StrainField, before: StrainField) -> float:
    """Share of ZOIs further than max(0.001 px, 5 um/m, 0.05 sigma) from the fully iterated answer, %."""
    exact = KernelSettings(tolerance_px=1e-7, tolerance_strain=1e-9, tolerance_sigma=0, max_iterations=30)
    full = PhaseKernel(frames[0], found.grid, exact, SIGMA).measure(frames[-1], start=before, noise=SIGMA)
    beyond = np.zeros(found.grid.shape, bool)
    for name in ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy"):
        floor = 1e-3 if name in ("u", "v") else 5e-6
        limit = np.maximum(floor, 0.05 * full.sigma(name))
        beyond |= np.abs(found.value(name) - full.value(name)) > limit
    return float(100 * beyond[found.ok].mean())


def throughput(report: Report) -> None:
    frames, turned = sequence(), sequence(5.0)
    most = numba.get_num_threads()
    for size, order, threads, images in (
        (32, 1, most, frames), (32, 1, 1, frames), (32, 1, most, turned), (32, 2, most, frames),
        (57, 1, most, frames), (64, 1, most, frames), (64, 1, 1, frames), (64, 1, most, turned),
    ):  # fmt: skip
        grid = zois(size, margin=64 if images is turned else 8)
        numba.set_num_threads(threads)
        kernel = PhaseKernel(images[0], grid, KernelSettings(order=order), SIGMA)
        seconds, now, before = track(kernel, images)
        numba.set_num_threads(most)
        report.add("Tracking a sequence", {
            "ZOI": size, "order": order, "threads": threads, "rotation deg": 5 if images is turned else 0,
            "ZOIs": grid.n_active, "ZOI/s": grid.n_active / seconds, "iterations": float(now.iterations.mean()),
            "valid %": 100 * now.n_valid / grid.n_active,
            "not settled %": unsettled(size, images, now, before) if order == 1 else "",
            "error of mean u px": float(np.nanmean(now.u) - _true_u(now.grid, images is turned)),
        })  # fmt: skip


def _true_u(grid: ZoiGrid, turned: bool) -> float:
    a = np.deg2rad(5.0) if turned else 0.0
    x, y = grid.x.mean() - (SHAPE[1] - 1) / 2, grid.y.mean() - (SHAPE[0] - 1) / 2
    gradient = (FRAMES * STEP["du_dx"] + np.cos(a) - 1, FRAMES * STEP["du_dy"] - np.sin(a))
    return float(FRAMES * STEP["u"] + gradient[0] * x + gradient[1] * y)


def counts(report: Report) -> None:
    frames = sequence()
    for step, every in ((8, 12), (8, 4), (8, 1), (4, 1), (3, 1)):
        grid = zois(32, step, every=every)
        kernel = PhaseKernel(frames[0], grid, None, SIGMA)
        seconds, _, _ = track(kernel, frames)
        report.add("Cost against the number of ZOIs (32 px)", {
            "ZOIs": grid.n_active, "ms a frame": 1e3 * seconds, "us a ZOI": 1e6 * seconds / grid.n_active,
        })  # fmt: skip


def first_frame(report: Report) -> None:
    frames = sequence()
    for size, order in ((32, 1), (64, 1), (32, 2)):
        grid = zois(size)
        settings = KernelSettings(order=order)
        prepare = machine.best(lambda g=grid, s=settings: PhaseKernel(frames[0], g, s, SIGMA), repeats=3)
        kernel = PhaseKernel(frames[0], grid, settings, SIGMA)
        scratch = machine.best(lambda k=kernel: k.measure(frames[3], noise=SIGMA), repeats=3)
        ready = kernel.reference.prepared
        own = sum(
            a.nbytes
            for a in (
                ready.inverse,
                ready.cross,
                ready.covariance,
                ready.freedom,
                ready.signal,
                ready.level,
                ready.energy,
            )
        )
        shared = ready.images.nbytes
        report.add("Reference and first frame", {
            "ZOI": size, "order": order, "prepare ZOI/s": grid.n_active / prepare,
            "first frame with search ZOI/s": grid.n_active / scratch, "bytes a ZOI": own / grid.n_active,
            "bytes a ZOI with its share of the images": (own + shared) / grid.n_active,
        })  # fmt: skip


def other_engines(report: Report) -> None:
    frames = sequence()
    tracking = "tracking, reference prepared before"
    for size, note in ((32, tracking), (57, f"{tracking}; equal l_10% (130 px) to the 33 px engines")):
        grid = zois(size, margin=32)
        kernel = PhaseKernel(frames[0], grid, None, SIGMA)
        seconds, now, before = track(kernel, frames)
        cpu = machine.processor_s(lambda k=kernel, b=before: k.measure(frames[-1], start=b, noise=SIGMA), 9)  # type: ignore[misc]
        _engine(
            report, f"phasedic, ZOI {size}", note, (seconds, cpu), Points(*np.meshgrid(grid.x, grid.y), now.u)
        )
    for peer in peers(frames[0], frames[-1], zois(33, margin=32)):
        _peer(report, peer)
    if missing():
        report.values["not installed"] = missing()
        report.emit("", f"Not installed here, so not run: {', '.join(missing())}. {HOW_TO_ADD}")


def _peer(report: Report, peer: Peer) -> None:
    found: list[Points] = []
    try:
        seconds = machine.best(lambda: found.append(peer.run()), repeats=peer.repeats)
        cpu = machine.processor_s(peer.run, peer.repeats)
    except Exception as error:
        if not peer.optional:
            raise
        said = " ".join(f"failed: {type(error).__name__}: {error}".split()).replace("|", "/")
        _engine(report, peer.name, said[:200])
        return
    _engine(report, peer.name, peer.note, (seconds, cpu), found[-1])


def _engine(
    report: Report,
    name: str,
    note: str,
    seconds: tuple[float, float] = (np.nan, np.nan),
    found: Points | None = None,
) -> None:
    """One row, ``seconds`` by the clock and of the processors; empty but for the note where nothing was found."""
    empty = dict.fromkeys(("points/s", "points a processor second", "mean error px", "scatter px"), "")
    row: dict[str, Any] = {"engine": name, "points": 0, **empty, "note": note}
    n = 0 if found is None else int(np.isfinite(found.u).sum())
    if found is not None and n:
        error = found.u - _true_map(found.x, found.y)
        row |= {"points": n, "points/s": n / seconds[0], "points a processor second": n / seconds[1]}
        row |= {"mean error px": float(np.nanmean(error)), "scatter px": float(np.nanstd(error))}
    report.add("Beside other engines, on the same pair", row)


def _true_map(x: NDArray, y: NDArray) -> NDArray:
    """u of the last frame at columns x and rows y, px."""
    along, across = x - (SHAPE[1] - 1) / 2, y - (SHAPE[0] - 1) / 2
    return FRAMES * (STEP["u"] + STEP["du_dx"] * along + STEP["du_dy"] * across)


def scaling(report: Report) -> None:
    most = numba.get_num_threads()
    if most < 2:
        return
    frames = sequence()
    rates: dict[str, list[float]] = {"memory stream": [], "multiply-add": [], "ZOI 32": [], "ZOI 64": []}
    for threads in (1, 2):
        numba.set_num_threads(threads)
        rates["memory stream"].append(machine.bandwidth())
        rates["multiply-add"].append(machine.arithmetic())
        for size in (32, 64):
            grid = zois(size)
            seconds, _, _ = track(PhaseKernel(frames[0], grid, None, SIGMA), frames)
            rates[f"ZOI {size}"].append(grid.n_active / seconds)
    numba.set_num_threads(most)
    for name, (one, two) in rates.items():
        report.add("Two threads over one", {"loop": name, "one": one, "two": two, "ratio": two / one})


def bursts(report: Report) -> None:
    from acquire.burst.accumulate import burst_of
    from acquire.frame import Frame

    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (1024, 1280), dtype=np.uint8) for _ in range(8)]
    frames = [Frame(im, i, i / 60, "nominal", 0, 8, i / 60) for i, im in enumerate(images)]
    report.add("Burst averaging, 8 x 1280x1024 uint8", {"ms a burst": 1e3 * machine.best(burst_of, frames)})


def gauges(report: Report) -> None:
    for step, flicker in ((32, False), (16, False), (32, True)):
        report.add("Virtual gauges, processor time", gauge_case.table(step, flicker))


def start_up(report: Report) -> None:
    code = (
        "import time; t = time.perf_counter()\n"
        "import numpy as np, analysis\n"
        "a = time.perf_counter()\n"
        "from analysis import PhaseKernel, Roi, ZoiGrid\n"
        "y, x = np.mgrid[:256, :256]\n"
        "im = (100 + 40 * np.sin(1.3 * x + 0.2 * y) * np.cos(0.9 * y - 0.35 * x)).astype(np.uint8)\n"
        "PhaseKernel(im, ZoiGrid.cover(Roi(0, 0, 256, 256), 32, 16)).measure(im)\n"
        "print(a - t, time.perf_counter() - t)"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    report.add(
        "Start-up, once compiled",
        {"import s": float(out[0]), "import and first measurement s": float(out[1])},
    )
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "live.cli", "--help"], capture_output=True, check=False)
    report.add("Command line", {"phasedic --help s": time.perf_counter() - begin})


def running(report: Report) -> None:
    """The program itself with a camera from memory (``--live``, four minutes)."""
    for name, words in live.CASES.items():
        report.add("The running program", {"case": name} | live.shown(live.case(words)))


SECTIONS = (throughput, counts, first_frame, scaling, bursts, gauges, start_up, other_engines)
"""Other people's programs last: the threads and processes they start disturb no other row."""


def write(report: Report, live: bool, folder: Path = DATA) -> None:
    """The tables as a page of docs/data."""
    name, title, command = (
        ("live.md", "Speed of the running program", "python -m tests.bench --live")
        if live
        else ("bench.md", "Speed of the kernel", "make bench")
    )
    text = "\n".join([f"# {title}", "", f"Written by `{command}`.", "", *report.lines, ""])
    (folder / name).write_text(text, encoding="utf-8")
    print(f"written: {folder / name}")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    parser.add_argument("--live", action="store_true", help="the running program alone, four minutes")
    parser.add_argument("--only", nargs="+", default=[], choices=[s.__name__ for s in SECTIONS])
    options = parser.parse_args()
    warm_up()
    report = Report(quiet=options.json)
    report.values["machine"] = machine.describe()
    report.values["date"] = f"{datetime.now(UTC):%Y-%m-%d}"
    report.emit(f"{report.values['machine']}; {report.values['date']}")
    for section in (running,) if options.live else SECTIONS:
        if not options.only or section.__name__ in options.only:
            section(report)
    if options.json:
        print(json.dumps(report.values, indent=1))
    elif not options.only:
        write(report, options.live)


if __name__ == "__main__":
    main()
