"""Maps of a report, each beside the picture of its instant; all maps of a name share one colour scale."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded
from acquire.frame import CameraInfo
from acquire.text import Message, about, word
from acquire.text.message import joined as texts
from live.results.maps.colours import ticks
from live.results.maps.painting import Levels, Painter, caption
from live.results.maps.scale import ColourScale, status_legend
from live.results.place_response import response_lines, response_title
from live.results.quantities import quantity_of
from live.results.report.page import Html, captioned, element, joined, paragraph, safe
from live.results.run_folder import RunFolder
from live.results.stored_response import FATE
from live.words.language import of_terminal

_QUALITY = 80
_STEPS = 48  # colours of the bar


@dataclass(frozen=True, slots=True, eq=False)
class MapPictures:
    """Pictures of the instants in the report.

    Attributes
    ----------
    images : mapping of row to (H, W) array, or None where there is no picture
    levels : Levels or None
        The same for all.
    size : (width, height), px
    camera : CameraInfo or None
        The camera that recorded them.
    """

    images: Mapping[int, NDArray[Any] | None]
    levels: Levels | None
    size: tuple[int, int]
    camera: CameraInfo | None = None


def map_pictures(run: RunFolder, rows: list[int]) -> MapPictures:
    """Read the pictures of ``rows``; where there are none, the painter uses plain grey of the extent of the ZOIs."""
    pictures = run.pictures
    if pictures is None:
        return MapPictures(dict.fromkeys(rows), None, run.picture_size)
    images: dict[int, NDArray[Any] | None] = dict.fromkeys(rows)
    images.update(zip(rows, pictures.each(rows), strict=False))
    first = next((image for image in images.values() if image is not None), None)
    levels = Levels.of(first) if first is not None else None
    return MapPictures(images, levels, run.picture_size, pictures.info)


def maps(
    run: RunFolder, name: str, time_steps: Mapping[int, str], pictures: MapPictures, longest: int
) -> Html:
    """One map at all instants, each beside its picture."""
    scale = ColourScale.of_run(run.strain, name, list(time_steps))
    painter = Painter(run.strain, name, scale, pictures.size, longest)
    pairs = []
    for row, words in time_steps.items():
        base = painter.picture(pictures.images[row], pictures.levels)
        beside = [_picture(painter.over(base, row), Message("{name}, {words}", name, words))]
        if pictures.images[row] is not None:
            beside.insert(0, _picture(base, Message("picture, {words}", words)))
        pairs.append(
            captioned(element("div", joined(beside, "")), about(words, caption(run.strain, row)), "pair")
        )
    ends = Message(
        "{words}; values beyond the ends have the colour of the end; no colour: no value",
        word(quantity_of(name).words),
    )
    bar = captioned(_bar(name, scale), ends, "bar")
    return joined(
        [element("h3", f"{name}, {scale.unit}"), bar, element("div", joined(pairs), class_="pairs")]
    )


def whole_maps(run: RunFolder, row: int, pictures: MapPictures, longest: int) -> list[Html]:
    """What each place did over all instants: its maps on the reference, over the picture of an early instant."""
    found, shown = run.strain.response, []
    for name in () if found is None else found.names:
        values = run.strain.maps(name, row)
        if name in (FATE, "instants", "sigma_poisson") or not np.isfinite(values).any():
            continue
        scale = ColourScale.of_run(run.strain, name, [row])
        painter = Painter(run.strain, name, scale, pictures.size, longest)
        base = painter.picture(pictures.images.get(row), pictures.levels)
        picture = _picture(
            painter.over(base, row, values, moved=False), Message("{name} of each place", name)
        )
        title = texts(", ", (response_title(run.strain, name), scale.unit))
        words = texts("; ", (title, quantity_of(name).words))
        shown.append(captioned(joined([picture, _bar(name, scale)], ""), words))
    lines = [paragraph(line) for line in response_lines(run.strain)]
    return [*lines, element("div", joined(shown), class_="plots")] if shown else lines


def statuses(run: RunFolder, row: int, pictures: MapPictures, longest: int) -> Html:
    """The statuses of the ZOIs at an instant: the map, and how many have each."""
    painter = Painter(run.strain, "status", None, pictures.size, longest)
    base = painter.picture(pictures.images.get(row), pictures.levels)
    picture = _picture(painter.over(base, row), Message("status of each ZOI"))
    lines = []
    for one in status_legend(run.strain.maps("status", row)[run.strain.grid.active]):
        key = Html(f'<span class="key" style="background:rgb{one.rgb}"></span>')
        lines.append(Html(f"<p>{key}{one.count} {safe(about(one.name, word(one.text)))}</p>"))
    return joined([captioned(element("div", picture), caption(run.strain, row), "pair"), *lines])


def _picture(image: NDArray[np.uint8], words: str) -> Html:
    text = base64.b64encode(encoded(".jpg", image, _QUALITY)).decode("ascii")
    height, width = image.shape[:2]
    source = f"data:image/jpeg;base64,{text}"
    return Html(f'<img src="{source}" width="{width}" height="{height}" alt="{safe(words)}">')


def _bar(name: str, scale: ColourScale) -> Html:
    """The colours from low to high with their numbers, as SVG."""
    boxes = "".join(
        f'<rect x="{10 + k * 480 / _STEPS:.1f}" y="4" width="{480 / _STEPS + 0.5:.1f}" height="14"'
        f' fill="rgb({r},{g},{b})"/>'
        for k, (r, g, b) in enumerate(scale.ramp(_STEPS).tolist())
    )
    if scale.is_diverging:
        boxes += '<path class="zero" d="M250 4v14"/>'
    words = "".join(
        f'<text class="word" text-anchor="middle" x="{10 + 480 * (v - scale.low) / (scale.high - scale.low):.1f}"'
        f' y="34">{safe(scale.mark(v, of_terminal()))}</text>'
        for v in ticks(scale.low, scale.high, about=7)
    )
    ends = Message(
        "colours of {name} from {low:g} to {high:g} {unit}", name, scale.low, scale.high, scale.unit
    )
    return Html(
        f'<svg class="plot" viewBox="0 0 500 40" role="img" aria-label="{safe(ends)}">{boxes}{words}</svg>'
    )
