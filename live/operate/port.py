"""The port for orders: a line in, an answer out (``orders`` has the words)."""

from __future__ import annotations

from live.lines import LineServer, Place, read_token
from live.measure import Screen
from live.operate.orders import Orders, answer

WHAT = "the port for orders"


class OrderPort:
    """Takes orders over TCP, from ``open`` to ``close``.

    Parameters
    ----------
    where : str
        ``PORT`` or ``HOST:PORT``.
    token_file : str or None
        Holds what a client must say first; needed beyond this machine.
    screen : Screen
        Told where it listens.

    Raises
    ------
    ConfigError
        The port is taken, or a token is missing.
    """

    def __init__(self, where: str, token_file: str | None, screen: Screen) -> None:
        place = Place.parse(where)
        self._token, self._screen = read_token(place, token_file, WHAT), screen
        self._host, self._listening = place.host, place.listen(WHAT)
        self._server: LineServer | None = None

    def open(self, orders: Orders) -> int:
        """Begin to take orders; the port."""
        self._server = LineServer(self._listening, self._token, lambda line: answer(line, orders))
        self._server.start()
        token = " (with a token)" if self._token else ""
        self._screen.say(f"orders are taken at {self._host}:{self._server.port}{token}")
        return self._server.port

    def close(self) -> None:
        """Take no more orders; again without effect."""
        if self._server is not None:
            self._server.close()
            self._server = None
        self._listening.close()
