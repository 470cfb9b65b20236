"""Requests of a page: their camera, points and places, and the rows it gets."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from analysis.field import Status
from live.config.loading import load_config
from live.ui.web.authorization import HttpError
from live.ui.web.broadcaster import Broadcaster, plain
from live.ui.web.map_view import MapView
from live.ui.web.page_consumers import PageConsumers
from tests.live.made_up import make_grid
from tests.live.ui.web.test_page_values import Run, pictured


def consumers() -> PageConsumers:
    config = load_config(None, {"specimen.axis": "y"})
    return PageConsumers(Broadcaster(), {"front": config, "back": config}, {"back": b"a picture"})


def answered(response: Any) -> Mapping[str, Any]:
    return dict(json.loads(response.content))


def test_requests_name_their_camera() -> None:
    both = consumers()
    front, back = both.by_name.values()
    for consumer, strain in ((front, 1e-3), (back, 2e-3)):
        consumer.map.draw(pictured(strain=strain))
        consumer.matched(pictured(strain=strain, force=1.0))
    assert (both.picture({"side": "front"}), both.picture({"side": "back"})) == (b"", b"a picture")
    grid = make_grid()
    place = {"x": str(grid.x[2]), "y": str(grid.y[2])}
    for side, value in (("front", 1e-3), ("back", 2e-3), ("nothing", 1e-3)):
        assert answered(both.value({"side": side, **place}))["value"] == pytest.approx(value)
    rows = answered(both.points({"edition": "0", "count": "0"}))["rows"]
    assert rows[0][2] == pytest.approx(1e-3) and len(rows) == 1
    assert answered(both.points({"edition": "0", "count": "1"}))["rows"] == []
    assert not both.select_map({"of": "exx"})["refused"]
    assert (front.map.choice.name, back.map.choice.name) == ("exx", "exx")
    assert both.select_map({"of": "ezz"})["text"].startswith("there is no map")
    config, states = load_config(None, {}), {}
    runs = {name: Run(config) for name in both.by_name}
    states = {name: run.run_state for name, run in runs.items()}
    test: Any = runs["front"]
    test.cameras, test.states = runs, states
    both.attach(test)
    assert back.state()["sides"] is None and front.state()["sides"] is not None
    states["back"].history.add(pictured(strain=4e-3).time_step)
    assert back.state()["figures"]["axial"]["value"] == pytest.approx(4e-3) and "axial" not in front.state()


@pytest.mark.parametrize(
    "query", [{}, {"edition": "0"}, {"edition": "-1", "count": "0"}, {"edition": "0", "count": "1e3"},
              {"edition": "0", "count": "1" * 10}, {"edition": "²", "count": "0"}]
)  # fmt: skip
def test_points_are_asked_for_in_whole_numbers(query: dict[str, str]) -> None:
    with pytest.raises(HttpError, match="whole numbers") as refused:
        consumers().points(query)
    assert refused.value.status == 400


@pytest.mark.parametrize("query", [{}, {"x": "1"}, {"x": "a", "y": "1"}, {"x": "nan", "y": "1"},
                                   {"x": "1e6", "y": "1"}, {"x": "1", "y": "-1e6"}])  # fmt: skip
def test_a_place_is_two_numbers(query: dict[str, str]) -> None:
    with pytest.raises(HttpError, match="x and y are numbers") as refused:
        consumers().value(query)
    assert refused.value.status == 400


def test_without_a_run_there_is_nothing_to_ask_for() -> None:
    nothing = PageConsumers(Broadcaster(), {}, {})
    assert nothing.picture({}) == b"" and nothing.select_map({})["text"] == "nothing is measured"
    for ask in (nothing.points, nothing.value):
        with pytest.raises(HttpError) as refused:
            ask({})
        assert refused.value.status == 404


def test_a_place_without_a_value_says_why() -> None:
    m, view = pictured(u=0.0, v=0.0), MapView(load_config(None, {"specimen.axis": "y"}))
    view.draw(m)
    grid = make_grid()
    assert view.value_at(grid.x[-1], grid.y[-1]) == {"value": None, "status": Status(7).text}
    assert view.value_at(grid.x[0], grid.y[0]) == {"value": None, "status": "no ZOI is here"}
    view.choose("status", "automatic", None)
    _, shown = view.draw(m)
    assert view.value_at(grid.x[2], grid.y[2]) == {"value": None, "status": Status.OK.text}
    assert {one["text"]: one["count"] for one in shown["legend"]} == {Status.OK.text: 33, Status(7).text: 1}
    assert all(one["colour"].startswith("rgb(") for one in shown["legend"])
    view.choose("residual", "automatic", None)
    _, shown = view.draw(m)
    assert not shown["strain"] and shown["unit"] == "chi²" and sum(shown["histogram"]) == 33
    assert (
        "sigma" in view.value_at(grid.x[2], grid.y[2])
        and view.value_at(grid.x[2], grid.y[2])["sigma"] is None
    )


def test_strains_reach_the_page_without_a_unit() -> None:
    """Whether they are drawn in um/m or in %."""
    view = MapView(load_config(None, {"specimen.axis": "y", "view.strain_range": 0.05}))
    assert (view.choice.name, view.choice.span, view.choice.limit) == ("eyy", "fixed", 0.05)
    for limit in (0.05, 0.001):
        assert view.choose("eyy", "fixed", limit) == ""
        _, shown = view.draw(pictured(strain=0.3 * limit))
        assert (shown["low"], shown["high"]) == (pytest.approx(-limit), pytest.approx(limit))
        assert (shown["strain"], shown["unit"], len(shown["histogram"])) == (True, "", 24)
        assert np.flatnonzero(shown["histogram"]).tolist() == [15]  # 0.65 of the range, of 24 bars


def test_numbers_that_json_has_not_are_none() -> None:
    assert plain({"a": (math.nan, np.float32(0.5)), 2: [math.inf, True, np.int64(3)]}) == {
        "a": [None, 0.5], "2": [None, True, 3],
    }  # fmt: skip


def test_pages_are_limited_and_a_closed_broadcaster_takes_none() -> None:
    broadcaster = Broadcaster()
    pages = [broadcaster.open() for _ in range(8)]
    assert all(pages) and broadcaster.open() is None and broadcaster.open_pages == 8
    broadcaster.publish("a", 1)
    broadcaster.publish("a", 2)
    broadcaster.publish("b", 3)
    assert pages[0] is not None and pages[1] is not None
    assert pages[0].take(0) == {"a": b"2", "b": b"3"} and pages[0].take(0) == {}
    broadcaster.remove(pages[0])
    late = broadcaster.open()
    assert late is not None and late.take(0) == {"a": b"2", "b": b"3"}
    broadcaster.close()
    assert pages[1].take(0) == {"a": b"2", "b": b"3"} and pages[1].take(0) is None
    broadcaster.remove(pages[1])
    assert broadcaster.open() is None
