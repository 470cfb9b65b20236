"""HDF5 that survives a kill, a full disk and bad bytes.

``damage`` reads a file's state before the library does, ``tables`` and ``pictures`` append, ``disk`` flushes
and forecasts the free space, ``declared`` checks what a file holds.
"""

from acquire.hdf5.damage import (
    PaddedFile,
    abandon_file,
    check_size,
    create_file,
    open_file,
    probe,
    read_superblock,
    reason,
    still_reading,
)
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
from acquire.hdf5.disk import (
    DiskSync,
    FileWatch,
    FlushTimer,
    FolderWatch,
    forecast,
    free_bytes,
    network_share,
)
from acquire.hdf5.pictures import COMPRESSED, PictureReader, PictureStack, compile_loops
from acquire.hdf5.tables import (
    NO_UNIT,
    GrowingDataset,
    RowTable,
    as_text,
    new_group,
    new_json,
    set_attributes,
    storable,
    to_json,
)

__all__ = [
    "COMPRESSED",
    "NO_UNIT",
    "Declared",
    "DiskSync",
    "FileWatch",
    "FlushTimer",
    "FolderWatch",
    "GrowingDataset",
    "JsonField",
    "PaddedFile",
    "PictureReader",
    "PictureStack",
    "RowTable",
    "abandon_file",
    "as_text",
    "check_links",
    "check_object",
    "check_size",
    "compile_loops",
    "create_file",
    "forecast",
    "free_bytes",
    "network_share",
    "new_group",
    "new_json",
    "open_dataset",
    "open_datasets",
    "open_file",
    "open_group",
    "probe",
    "read_attribute",
    "read_object",
    "read_scalar",
    "read_superblock",
    "reason",
    "set_attributes",
    "still_reading",
    "storable",
    "stored_rows",
    "to_json",
]
