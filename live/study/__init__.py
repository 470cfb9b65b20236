"""One test measured with many settings, and which to take.

``windows`` has the bursts of a still and of a loaded part, ``study`` measures them and finds the knee.
"""

from live.study.study import Advice, Found, Setting, recommended, study
from live.study.windows import NEVER, Windows, take_windows

__all__ = ["NEVER", "Advice", "Found", "Setting", "Windows", "recommended", "study", "take_windows"]
