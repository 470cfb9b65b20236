"""What a worker does with one test, or with a chunk of one.

``task`` replays it into a folder that takes its name when it is whole (``places``), ``keys`` says what the result
depends on, ``row`` is what it tells.
"""

from live.batch.work.keys import deciding_versions, is_session, key_of, key_of_chunk, longest_first
from live.batch.work.places import parts, remove, sweep, sweep_whole
from live.batch.work.row import COLUMNS, RENEWED, Row, Value, failed
from live.batch.work.task import Progress, Task, perform, row_done

__all__ = [
    "COLUMNS",
    "RENEWED",
    "Progress",
    "Row",
    "Task",
    "Value",
    "deciding_versions",
    "failed",
    "is_session",
    "key_of",
    "key_of_chunk",
    "longest_first",
    "parts",
    "perform",
    "remove",
    "row_done",
    "sweep",
    "sweep_whole",
]
