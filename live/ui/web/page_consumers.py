"""The page's consumers of a run, one for each camera, and the answers to requests for their data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from live.config.loading import Config
from live.run.control import Answer, refusal
from live.ui.web.authorization import HttpError
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.server import Response, json_response

if TYPE_CHECKING:
    from live.run.live_run import LiveRun


class PageConsumers:
    """The consumers of one run; none where there are no configurations.

    Parameters
    ----------
    broadcaster : Broadcaster
    configs : mapping of str to Config
        Of the cameras, by name; the first leads.
    pictures : mapping of str to bytes
        The JPEG that each camera shows before its first frame.

    Attributes
    ----------
    by_name : dict of str to PageConsumer
    """

    def __init__(
        self, broadcaster: Broadcaster, configs: Mapping[str, Config], pictures: Mapping[str, bytes]
    ) -> None:
        self.by_name = {
            name: PageConsumer(
                broadcaster, config, picture=pictures.get(name, b""), side=name, cameras=len(configs)
            )
            for name, config in configs.items()
        }

    @property
    def first(self) -> PageConsumer | None:
        """The consumer of the first camera."""
        return next(iter(self.by_name.values()), None)

    def attach(self, live: LiveRun) -> None:
        """Show the state of ``live``, and of each of its cameras, from now on."""
        for name, consumer in self.by_name.items():
            leads = consumer is self.first
            consumer.attach(live if leads else live.cameras[name], live.states if leads else {})

    def points(self, query: Mapping[str, str]) -> Response:
        """The points of the curve that a page lacks.

        Raises
        ------
        HttpError
        """
        consumer = self._of("")
        edition, count = (query.get(key, "") for key in ("edition", "count"))
        if not all(word.isascii() and word.isdigit() and len(word) < 10 for word in (edition, count)):
            raise HttpError(400, "edition and count are whole numbers")
        return json_response(consumer.curve.since(int(edition), int(count)))

    def value(self, query: Mapping[str, str]) -> Response:
        """The value of the map at a place of the picture, px.

        Raises
        ------
        HttpError
        """
        consumer = self._of(query.get("side", ""))
        try:
            x, y = (float(query.get(key, "")) for key in ("x", "y"))
        except ValueError:
            raise HttpError(400, "x and y are numbers, in px") from None
        if not (abs(x) < 1e6 and abs(y) < 1e6):
            raise HttpError(400, "x and y are numbers, in px")
        return json_response(consumer.map.value_at(x, y))

    def picture(self, query: Mapping[str, str]) -> bytes:
        """The newest picture of a camera, as JPEG, or a ``layer`` that belongs to it; empty where there is none."""
        if not self.by_name:
            return b""
        consumer = self._of(query.get("side", ""))
        layer = query.get("layer", "")
        return consumer.layers.get(layer, b"") if layer != "picture" and layer else consumer.picture

    def select_map(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Show another map, on the pictures of all cameras."""
        if not self.by_name:
            return refusal("nothing is measured")._asdict()
        why = next(filter(None, [one.select_map(request) for one in self.by_name.values()]), "")
        return Answer(why, refused=bool(why))._asdict()

    def _of(self, side: str) -> PageConsumer:
        """The consumer of the camera that a request names, else the first."""
        consumer = self.by_name.get(side, self.first)
        if consumer is None:
            raise HttpError(404, "nothing has been measured")
        return consumer
