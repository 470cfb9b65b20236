"""Is the picture good enough, before the specimen is pulled?

``shots`` takes frames of the still specimen, ``ground`` is where they are looked at, ``figures`` examines them
there: light, bits, pattern, ``stillness``, the noise ``predicted`` of ZOIs and gauges, and the strain noise
``floor``; ``judge`` says what is good enough, ``advice`` what to change, ``table`` what each ZOI and burst would
give. ``watch`` does it over and over. All are free of terminal and page, and but for ``shots`` and ``watch`` of
devices.
"""

from live.check.advice import advice, reaching
from live.check.figures import Figures, Zois, examine
from live.check.floor import Floor, Noise
from live.check.judge import WITHOUT_TARGET, Line, judge
from live.check.predicted import GaugeNoise
from live.check.shots import Shots, take
from live.check.stillness import Stillness
from live.check.table import table_lines
from live.check.watch import GLANCE, Glance, Rolling, Watch

__all__ = [
    "GLANCE",
    "WITHOUT_TARGET",
    "Figures",
    "Floor",
    "GaugeNoise",
    "Glance",
    "Line",
    "Noise",
    "Rolling",
    "Shots",
    "Stillness",
    "Watch",
    "Zois",
    "advice",
    "examine",
    "judge",
    "reaching",
    "table_lines",
    "take",
]
