"""Letting go of an HDF5 file whose disk takes no more.

HDF5 tries to write once more while closing; when that fails too it crashes the process, at once or
at its end. So the file is first swapped for one that takes everything: what stands on the disk
stays as the last complete flush left it.
"""

from __future__ import annotations

import logging
import os

import h5py

log = logging.getLogger(__name__)


def let_go(file: h5py.File) -> None:
    """Close a file that cannot be written any more, without touching it and without an error."""
    try:
        nowhere = os.open(os.devnull, os.O_RDWR)
        try:
            os.dup2(nowhere, file.id.get_vfd_handle())
        finally:
            os.close(nowhere)
        file.close()
    except (OSError, RuntimeError) as error:
        log.debug("letting go of a file: %s", error)
