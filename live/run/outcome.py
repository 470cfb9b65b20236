"""What a run leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from live.outputs import Outputs
from live.setup import Config, Rig
from live.tell import Books

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import ZoiGrid


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run leaves behind.

    Attributes
    ----------
    folder : Path
    config : Config
        As it was in force.
    books : Books
        Events, ledger, loads, and the means of every measured instant.
    outputs : Outputs
    rig : Rig
        Closed; its specimen tells the truth of a simulated test.
    grid : ZoiGrid
    exit_code : int
    """

    folder: Path
    config: Config
    books: Books
    outputs: Outputs
    rig: Rig
    grid: ZoiGrid
    exit_code: int
