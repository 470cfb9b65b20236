"""Many sessions with the same settings: replayed one after the other, then compared on one page.

``python batch.py RUNS OUT --zoi 32 --step 8`` replays every session.h5 below RUNS. Results that exist in OUT
are not made again, so an interrupted batch can be continued.
"""

from __future__ import annotations

import sys
from pathlib import Path

from phasedic import main as phasedic

MEASURED = (0, 5)  # exit codes: all well, or finished with loss


def measured(session: Path, out: Path, settings: list[str]) -> bool:
    """Replay one session; return whether there are results."""
    if (out / "strain.h5").exists():
        print(f"{session}: measured already, in {out}")
        return True
    code = phasedic(["replay", str(session), "--out", str(out), "--no-view", "--no-rrd", *settings])
    print(f"{session}: {'measured' if code in MEASURED else 'failed'} (exit code {code})")
    return code in MEASURED


def main(runs: str, out: str, *settings: str) -> int:
    """Replay all sessions below ``runs`` into folders below ``out``; return 4 if one failed."""
    sessions = sorted(Path(runs).rglob("session.h5"))
    folders = [Path(out) / session.parent.relative_to(runs) for session in sessions]
    pairs = zip(sessions, folders, strict=True)
    good = [str(folder) for session, folder in pairs if measured(session, folder, list(settings))]
    page = Path(out) / "all.html"
    if len(good) > 1 and not page.exists():
        phasedic(["report", "--compare", *good, "--out", str(page)])
    return 0 if sessions and len(good) == len(sessions) else 4


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
