"""Many sessions with the same settings: replayed one after the other, then compared on one page.

``python -m examples.batch RUNS OUT --zoi 32 --step 8`` takes every session.h5 below RUNS. What lies in OUT already is
not measured again, so that it can be interrupted and gone on with.
"""

from __future__ import annotations

import sys
from pathlib import Path

from live.cli import main as phasedic

MEASURED = (0, 5)  # well, or with loss


def measured(session: Path, out: Path, settings: list[str]) -> bool:
    """Replay one; whether there are results."""
    if (out / "strain.h5").exists():
        print(f"{session}: is there already, in {out}")
        return True
    code = phasedic(["replay", str(session), "--out", str(out), "--no-view", "--no-rrd", *settings])
    print(f"{session}: {'measured' if code in MEASURED else 'failed'} (exit code {code})")
    return code in MEASURED


def main(runs: str, out: str, *settings: str) -> int:
    """All sessions below ``runs`` into folders below ``out``; the worst that happened."""
    sessions = sorted(Path(runs).rglob("session.h5"))
    folders = [Path(out) / session.parent.relative_to(runs) for session in sessions]
    well = [
        measured(session, folder, list(settings)) for session, folder in zip(sessions, folders, strict=True)
    ]
    good = [str(folder) for folder, is_well in zip(folders, well, strict=True) if is_well]
    page = Path(out) / "all.html"
    if len(good) > 1 and not page.exists():
        phasedic(["report", "--compare", *good, "--out", str(page)])
    return 0 if all(well) and sessions else 4


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
