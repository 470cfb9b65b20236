"""The operator's page: the rig set up, a test watched, what came out, and again; in the browser of the rig.

``desk`` leads from stage to stage. Set up: ``bench`` looks through the camera (``eye``), ``judged`` tells what a
check finds, ``region`` is what is drawn, ``changes`` what may be changed, ``draft`` the rig file in the making.
Run: ``watching`` is a consumer, ``curve`` and ``painting`` are what it shows. ``after`` has the figures. The
server is the room ``web``, the page itself lies in static.
"""

from live.serve.after import ended
from live.serve.desk import Desk
from live.serve.draft import Draft
from live.serve.web import DEFAULT_PORT

__all__ = ["DEFAULT_PORT", "Desk", "Draft", "ended"]
