"""``python -m acquire.session FILE`` reads a session once: the child of ``acquire.hdf5.probe``."""

from __future__ import annotations

import sys

from acquire.errors import DataError
from acquire.hdf5 import still_reading


def main(path: str, salvage: str = "") -> int:
    """The child: 0 where all is readable, or with ``salvage`` a part; else the error's words and its exit code."""
    from acquire.session.part import SessionPart

    try:
        with SessionPart(path, probed=True, salvage=bool(salvage)) as part:
            part.walk_pictures()
            for _ in part.load_pieces():
                still_reading()
            for read in (part.events, part.clock_pairs, part.frame_counts):
                read()
    except DataError as error:
        if salvage:
            return 0  # what cannot be read does not hang the library
        print(error)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
