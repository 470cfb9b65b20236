"""The tests of this folder run through ``make genicam-test`` alone: in a network of their own, with fake cameras."""

from __future__ import annotations

import os

collect_ignore = [] if os.environ.get("PHASEDIC_IN_NAMESPACE") else ["inside"]
