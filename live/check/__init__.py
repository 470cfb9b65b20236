"""Is the picture good enough, before the specimen is pulled?

``shots`` takes frames of the still specimen, ``figures`` examines them within the region: light, bits,
pattern, ``stillness`` and the strain noise ``floor``; ``judge`` says what is good enough, ``advice`` what to
change, ``table`` what each ZOI and burst would give. All but ``shots`` are free of devices, terminal and page.
"""

from live.check.advice import advice, reaching
from live.check.figures import Figures, GaugeNoise, Zois, examine
from live.check.floor import Floor, Noise
from live.check.judge import WITHOUT_TARGET, Line, judge
from live.check.shots import Shots, take
from live.check.stillness import Stillness
from live.check.table import table_lines

__all__ = [
    "WITHOUT_TARGET",
    "Figures",
    "Floor",
    "GaugeNoise",
    "Line",
    "Noise",
    "Shots",
    "Stillness",
    "Zois",
    "advice",
    "examine",
    "judge",
    "reaching",
    "table_lines",
    "take",
]
