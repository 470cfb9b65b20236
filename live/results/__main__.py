"""``python -m live.results FILE`` reads a strain.h5 once: the child of ``acquire.hdf5.probe``."""

from __future__ import annotations

import sys
from pathlib import Path

from acquire.errors import DataError
from acquire.hdf5 import still_reading
from live.results.reader import Strain

PIECE = 256  # maps that are read at once


def main(path: str) -> int:
    """The child: 0 where all can be read, else the error's words and its exit code."""
    try:
        with Strain.open(Path(path), probed=True) as strain:
            for first in range(0, strain.n, PIECE):
                strain.maps("status", slice(first, first + PIECE))
                still_reading()
            for name in (*strain.names, *strain.whole_names) if strain.n else ():
                strain.maps(name, -1)
                still_reading()
    except DataError as error:
        print(error)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
