"""A recorded session, or any folder of pictures, through the same measuring path.

``replay`` runs it (``opened`` before the first burst, ``parts`` of a long session); ``session`` and ``pictures``
make the ``material`` (reference, bursts, loads), ``store`` finds the bursts of a session whatever it holds, and
``places`` tells where they lie.
"""

from live.replay.material import Material, ReplayRequest
from live.replay.opened import open_material
from live.replay.parts import measure_part
from live.replay.replay import Replayed, replay

__all__ = ["Material", "ReplayRequest", "Replayed", "measure_part", "open_material", "replay"]
