"""A first reading of a file in a child process.

HDF5 waits and waits on a truncated file in SWMR mode, and may crash on damaged bytes; a child
process with a time limit takes that in our place.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from acquire.errors import DataError

PROBE_S = 30.0  # HDF5 retries a bad checksum of an unfinished file for ever


def probe(path: Path, package: str, timeout_s: float | None = None) -> None:
    """Read ``path`` by ``python -m package path`` first.

    Parameters
    ----------
    package : str
        Its ``__main__`` reads the file and prints what is wrong with it, exit code 4.

    Raises
    ------
    DataError
        The child crashed, did not end in time, or refused the file itself.
    """
    command = [sys.executable, "-m", package, str(path)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=timeout_s or PROBE_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise DataError(f"{path} is damaged: reading it does not come to an end") from error
    if done.returncode != 0:
        said = done.stdout.strip() if done.returncode == DataError.exit_code else ""
        raise DataError(said or f"{path} is damaged: the HDF5 library fails on it ({done.returncode})")
