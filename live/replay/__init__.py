"""A recorded session, or any folder of pictures, through the same measuring path.

``replay`` runs it; ``session`` and ``pictures`` make the ``material`` (reference, bursts, loads), ``store``
finds the bursts of a session whatever it holds.
"""

from live.replay.material import Material, ReplayRequest
from live.replay.opened import open_material
from live.replay.replay import Replayed, replay

__all__ = ["Material", "ReplayRequest", "Replayed", "open_material", "replay"]
