"""The server of the page, and who may come in.

``door`` judges every request, ``server`` answers (``answers``), ``hub`` tells all open pages the newest.
"""

from live.serve.web.answers import ALONE, Answer, jpeg, of_json
from live.serve.web.door import Refused
from live.serve.web.hub import Hub
from live.serve.web.server import DEFAULT_PORT, PageServer

__all__ = ["ALONE", "DEFAULT_PORT", "Answer", "Hub", "PageServer", "Refused", "jpeg", "of_json"]
