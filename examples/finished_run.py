"""A finished run from Python, step by step: curve, maps, pictures, export, report.

``python finished_run.py RUN_DIR`` prints figures of the run and writes into ``RUN_DIR/from_python``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from phasedic import (
    Display,
    ExportRequest,
    ReportRequest,
    TerminalScreen,
    export,
    make_report,
    open_run,
    save_page,
)


def main(folder: str) -> int:
    out = Path(folder) / "from_python"
    with open_run(folder) as run:
        # The curve: one number a measurement.
        strain, force = run.strain.values[run.axial], run.force
        most = f"force up to {np.nanmax(force):.0f} N" if np.isfinite(force).any() else "no force"
        print(f"{run.title}: {run.strain.n} measurements, {most}")

        # Maps: (T, R, C), NaN where a ZOI has no value; each with its standard uncertainty.
        last, sigma = run.strain.maps(run.axial, -1), run.strain.maps(f"sigma_{run.axial}", -1)
        print(
            f"last {run.axial}: {np.nanmean(last) * 1e6:.0f} um/m, one ZOI +- {np.nanmedian(sigma) * 1e6:.0f}"
        )

        # Other units and axes: mm, y upwards.
        display = Display(mm_per_px=0.02, y_up=True)
        v = display.shown("v", run.strain.maps("v", -1))
        print(f"last v: {np.nanmin(v):.4f} to {np.nanmax(v):.4f} mm, upwards")

        # The pictures of the first and the last instant, if they were recorded.
        if run.pictures is not None:
            first, final = run.pictures.each([0, run.strain.n - 1])
            print(
                f"pictures: {first.shape[1]} x {first.shape[0]} px, mean {first.mean():.0f} and {final.mean():.0f} GL"
            )

        export(run, ExportRequest("npz", out / "strain.npz", display=display), TerminalScreen(quiet=True))
        save_page(make_report(run, ReportRequest(), TerminalScreen(quiet=True)), out / "report.html")
        print(f"largest mean strain {np.nanmax(np.abs(strain)) * 1e6:.0f} um/m; files in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
