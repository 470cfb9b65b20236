"""Configuration files of any shape give a configuration or a ``ConfigError``, and nothing else.

By hand for longer: ``python -m tests.adversary.test_fuzz_config 600``.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

from acquire.errors import ConfigError
from live.config.loading import Config, from_dict, load_config

VALUES = [
    "0", "-1", "1", "64", "1e999", "nan", "-inf", "0x40", "9" * 400, "9" * 5000, "1_000", "0.5", "true", "false",
    '""', '"x"', '"every=5"', '"every=\u00b2"', '"every=-1"', '"\\u0000"', '"\\u001b[2J"', '"""a\nb"""', "'''x'''",
    "[]", "[0,0,64,64]", "[1,2,3]", "[nan,0,0,0]", '["a",1,2,3]', "[[0],[0],[1],[1]]", "{}", "{zoi=32}",
    "2020-01-01", "12:00:00", "2020-01-01T00:00:00Z", "[" * 1500 + "]" * 1500, "\u00e9", "", "=", '"unended',
]  # fmt: skip
FIELDS = {part.name: part.default_factory for part in dataclasses.fields(Config) if part.name != "metadata"}
NAMES = ["", "a.b", '"quoted key"', '"\\u001b"', "zoii", "q" * 500, "__class__", "address", "1"]


def made_up(chance: random.Random) -> str:
    """A file whose sections and keys are mostly ours, and whose values are of any kind."""
    lines = []
    for _ in range(chance.randint(0, 5)):
        section = chance.choice([*FIELDS, *FIELDS, "metadata", chance.choice(NAMES)])
        head = chance.choice(["[{}]", "[{}]", "[{}]", "[[{}]]", "{} = 3", "[{}.more]"])
        lines.append(head.format(section))
        kind: Any = FIELDS.get(section)
        known = [part.name for part in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else NAMES
        for _ in range(chance.randint(0, 3)):
            key = chance.choice(known if chance.random() < 0.9 else NAMES)
            lines.append(f"{key} = {chance.choice(VALUES)}")
    text = "\n".join(lines)
    if text and chance.random() < 0.2:
        place = chance.randrange(len(text))
        text = text[:place] + chance.choice(["\x00", "]", '"', "\ufeff", "#", ""]) + text[place + 1 :]
    return text


def fuzz(seconds: float, seed: int, folder: Path, most: float = math.inf) -> tuple[int, int]:
    """How many files were taken, and how many refused; raises what is neither."""
    end, chance, counts = time.monotonic() + seconds, random.Random(seed), [0, 0]
    path = folder / "fuzz.toml"
    while time.monotonic() < end and sum(counts) < most:
        text = made_up(chance)
        path.write_bytes(text.encode("utf-8" if chance.random() < 0.95 else "utf-16"))
        try:
            taken = load_config(path, {})
        except ConfigError as error:
            assert str(path) in str(error)
            assert len(str(error)) < 2000 + len(str(path))
            counts[1] += 1
        else:
            assert from_dict(json.loads(json.dumps(taken.as_dict())), {}, "stored") == taken
            counts[0] += 1
    return counts[0], counts[1]


def test_any_configuration_is_taken_or_refused(tmp_path: Path) -> None:
    taken, refused = fuzz(math.inf, 1, tmp_path, 4000)
    assert taken > 50
    assert refused > 50


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[mesure]\nzoi=3", "did you mean measure"),
        ("[qqqqqqqq]\nzoi=3", "unknown section"),
        ("[measure]\nqqqqqqqq=3", "unknown key measure.qqqqqqqq;"),
        ("[measure]\nzoo=3", "did you mean zoi"),
        ("x = " + "[" * 3000, "not valid TOML"),
        (f"[measure]\nbending_px = {'9' * 400}", "fewer digits"),
        (f"[measure]\nzoi = {'9' * 5000}", "not valid TOML"),
        ('[record]\nmode = "every=\u00b2"', "every=K"),
        ("[metadata]\nx = nan", "must be a text or a number"),
        ('[camera]\naddress = "a\\u0000b"', "zero byte"),
        ("x" * 2_000_000, "MB"),
    ],
)
def test_what_was_found(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=f"a.toml: .*{message}"):
        load_config(path, {})


def test_a_byte_order_mark_is_no_error(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("\ufeff[measure]\nzoi = 32\n", encoding="utf-8")
    assert load_config(path, {}).measure.zoi == 32


def test_a_pipe_as_configuration_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(ConfigError, match="it is a pipe"):
        load_config(tmp_path / "a.toml", {})


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        print(fuzz(float(sys.argv[1]), int(time.time()), Path(made)), "taken, refused")
