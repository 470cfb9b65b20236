"""A real tension test that necks, replayed as a user starts it: ZOIs with a value by picture (needs PHASEDIC_DATA)."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

from live.cli import main
from live.results.reader import Strain

SET = "planar_tension"
LEAST, ZOIS = 1984, 2126
"""Valid in the last of five pictures, which moved by -27 px, of those asked for: as many as from nothing."""


def valid_by_picture(folder: Path) -> tuple[list[int], int]:
    """ZOIs with a value in each picture after the reference, and those asked for; all by default."""
    said = io.StringIO()
    quiet = contextlib.redirect_stdout(said), contextlib.redirect_stderr(said)
    with tempfile.TemporaryDirectory() as out, quiet[0], quiet[1]:
        code = main(["replay", str(folder / SET), "--out", f"{out}/run", "--no-view", "--no-rrd"])
        if code:
            raise RuntimeError(f"the replay of {SET} ended with exit code {code}: {said.getvalue()}")
        with Strain.open(Path(out) / "run" / "strain.h5") as strain:
            valid, asked = strain.values["n_valid"], strain.values["n_zoi"]
    return [int(n) for n in valid], int(asked[-1])
