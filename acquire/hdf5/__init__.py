"""HDF5 that survives a kill, a full disk and bad bytes.

``damage`` reads a file's state before the library does, ``tables`` and ``pictures`` append, ``disk`` flushes
and forecasts the free space, ``declared`` checks what a file holds.
"""

from acquire.hdf5.damage import check_size, let_go, probe, read_superblock
from acquire.hdf5.declared import (
    Declared,
    JsonField,
    check_links,
    check_object,
    open_dataset,
    open_datasets,
    open_group,
    read_attribute,
    read_object,
    read_scalar,
    stored_rows,
)
from acquire.hdf5.disk import FlushTimer, ToDisk, forecast, free_bytes, network_share
from acquire.hdf5.pictures import PictureReader, PictureStack, compile_loops
from acquire.hdf5.tables import NO_UNIT, GrowingDataset, RowTable, new_group, new_json, say, to_json, word

__all__ = [
    "NO_UNIT",
    "Declared",
    "FlushTimer",
    "GrowingDataset",
    "JsonField",
    "PictureReader",
    "PictureStack",
    "RowTable",
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
