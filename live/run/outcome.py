"""What a run leaves behind."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.load_cell import LoadLog
from live.outputs import Outputs
from live.setup import Rig
from live.tell import Ledger

if TYPE_CHECKING:
    from analysis import ZoiGrid
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run leaves behind.

    Attributes
    ----------
    folder : Path
    ledger : Ledger
    outputs : Outputs
        Its ``history`` holds the means of every measured instant.
    loads : LoadLog
    rig : Rig
        Closed; its specimen tells the truth of a simulated test.
    grid : ZoiGrid
    exit_code : int
    """

    folder: Path
    ledger: Ledger
    outputs: Outputs
    loads: LoadLog
    rig: Rig
    grid: ZoiGrid
    exit_code: int
