"""The set-up of all cameras of a test, which are checked, saved and started together."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from live.config.cameras import BACK
from live.config.loading import Config
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.setup.config_draft import ConfigDraft
from live.ui.web.setup.drawn_region import DrawnRegion
from live.ui.web.setup.setup_session import SetupSession


class SetupSessions:
    """One session for each camera, from ``with`` to its end.

    Parameters
    ----------
    drafts : mapping of str to ConfigDraft
        Of each camera by its name, the first one first.
    broadcaster : Broadcaster
    drawn : mapping of str to DrawnRegion
        The regions of the last specimen, by the names of the cameras; "" of a single one.

    Attributes
    ----------
    first : SetupSession
    by_name : dict of str to SetupSession
    """

    def __init__(
        self, drafts: Mapping[str, ConfigDraft], broadcaster: Broadcaster, drawn: Mapping[str, DrawnRegion]
    ) -> None:
        (name, draft), *others = drafts.items()
        self.first = SetupSession(draft, broadcaster, drawn.get(name), name)
        self.by_name = {name: self.first}
        for name, draft in others:
            self.by_name[name] = SetupSession(draft, broadcaster, drawn.get(name), name, self.first)
        self._open = ExitStack()

    def __enter__(self) -> SetupSessions:
        with ExitStack() as opened:
            for session in self.by_name.values():
                opened.enter_context(session)
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def of(self, name: object) -> SetupSession:
        """The session of a camera; the first for any other name."""
        return self.by_name.get(name, self.first) if isinstance(name, str) else self.first

    @property
    def drawn(self) -> dict[str, DrawnRegion]:
        """The regions by the names of the cameras."""
        found = {name: session.region.drawn for name, session in self.by_name.items()}
        return {name: drawn for name, drawn in found.items() if drawn is not None}

    @property
    def pictures(self) -> dict[str, bytes]:
        """The newest picture of each, as JPEG."""
        return {name: session.picture for name, session in self.by_name.items()}

    def check(self) -> None:
        """Check all cameras; raises DataError where one has given no picture."""
        for session in self.by_name.values():
            session.check.begin()

    def save(self) -> None:
        """Write each rig file, that of the first last; raises ConfigError where one cannot be written."""
        paths = []
        for session in list(self.by_name.values())[1:]:
            session.region.save()
            paths.append(str(session.draft.path))
        if paths:
            further = {"camera.back": paths[0]} if BACK in self.by_name else {"camera.beside": paths}
            self.first.draft.change_all(further)
        self.first.region.save()

    def ready(self, folder: Path) -> list[Config]:
        """The configuration of each camera for a test; raises DataError or ConfigError where one cannot begin."""
        return [session.ready(folder) for session in self.by_name.values()]

    def configs(self, folder: Path) -> list[Config]:
        """The configuration of each camera; raises DataError or ConfigError."""
        return [session.region.config(folder) for session in self.by_name.values()]

    def refresh(self) -> None:
        """Send the state of each to the pages."""
        for session in self.by_name.values():
            session.refresh()
