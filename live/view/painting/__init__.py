"""What the view shows as pictures of our own making: ``board`` has the large figures."""

from live.view.painting.board import HEIGHT, WIDTH, paint

__all__ = ["HEIGHT", "WIDTH", "paint"]
