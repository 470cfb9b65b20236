"""HDF5 that survives a kill, a full disk and bad bytes.

``superblock`` reads a file's state without the library, ``child`` lets another process read it first,
``failure`` lets go of a file that can no longer be written, ``tables`` grow row by row, ``pictures`` chunk by
chunk with a checksum of our own, ``pace`` says when to flush and brings files to their disk, ``nexus`` has the
words of NeXus, ``disk`` forecasts the room, ``declared`` and ``json_form`` check what stands in a file against
what must.
"""

from acquire.hdf5.child import probe
from acquire.hdf5.declared import (
    Declared,
    check_links,
    open_dataset,
    open_datasets,
    open_group,
    read_attribute,
    read_scalar,
    stored_rows,
)
from acquire.hdf5.disk import forecast, free_bytes, network_share
from acquire.hdf5.failure import let_go
from acquire.hdf5.json_form import Said, check_object, read_object
from acquire.hdf5.nexus import NO_UNIT, new_group, new_json, say, to_json, word
from acquire.hdf5.pace import Pace, ToDisk
from acquire.hdf5.pictures import PictureReader, PictureStack, compile_loops
from acquire.hdf5.superblock import check_size, read_superblock
from acquire.hdf5.tables import GrowingDataset, Table

__all__ = [
    "NO_UNIT",
    "Declared",
    "GrowingDataset",
    "Pace",
    "PictureReader",
    "PictureStack",
    "Said",
    "Table",
    "ToDisk",
    "check_links",
    "check_object",
    "check_size",
    "compile_loops",
    "forecast",
    "free_bytes",
    "let_go",
    "network_share",
    "new_group",
    "new_json",
    "open_dataset",
    "open_datasets",
    "open_group",
    "probe",
    "read_attribute",
    "read_object",
    "read_scalar",
    "read_superblock",
    "say",
    "stored_rows",
    "to_json",
    "word",
]
