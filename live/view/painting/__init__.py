"""What the view shows as pictures of our own making: ``board`` has the large figures, ``field_maps`` the maps."""

from live.view.painting.board import HEIGHT, WIDTH, paint
from live.view.painting.field_maps import FieldMaps, Painted

__all__ = ["HEIGHT", "WIDTH", "FieldMaps", "Painted", "paint"]
