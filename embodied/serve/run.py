"""Opening a study: its data, panoramas and log; and serving it."""

import functools
import hashlib
import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from embodied.datasets.store import Dataset
from embodied.interface import Episode
from embodied.records import load_lines, to_json
from embodied.render.panorama_file import PanoramaFile
from embodied.render.pictures import Baked, PictureSettings, Traced, matte, parse_pictures
from embodied.serve.app import Server, key_of
from embodied.serve.driving import BrowserBody, EncodedPanoramas, Live
from embodied.serve.game import POLICIES, AgentMaker, AssistantMaker, set_table
from embodied.serve.results import ResultsWriter
from embodied.serve.sessions import Sessions
from embodied.serve.store import Store
from embodied.serve.study import Study, StudyError, load_study
from embodied.world import World

PanoramaDrawer = Callable[[Dataset, str], Path]
"""Gives the file with a house's panoramas; draws it where it is not there."""


@dataclass(frozen=True, eq=False)
class Opened:
    """A study that can be served."""

    study: Study
    folder: Path
    server: Server

    def links(self, address: str, invitations: int = 0) -> dict[str, list[str]]:
        """The links to give away: for everybody, single-use ones, and the results; asked again, the same ones.

        Args:
          address: of the page, 'https://study.example.org/kitchen'.
        """
        words = [self.server.token("invitation", str(i)) for i in range(invitations)]
        self.server.invitations |= {key_of(w) for w in words}
        return {
            "join": [] if invitations else [f"{address}/#join={self.server.token('join')}"],
            "invitations": [f"{address}/#join={w}" for w in words],
            "results": [f"{address}/#results={self.server.token('results')}"],
        }


def open_study(
    path: Path,
    folder: Path,
    draw: PanoramaDrawer | None,
    agents: Mapping[str, AgentMaker] = POLICIES,
    assistants: Mapping[str, AssistantMaker] = MappingProxyType({}),
    addresses: Iterable[str] | None = None,
    open_world: Callable[[Dataset, str], World] | None = None,
) -> Opened:
    """Open a study and read what people did before.

    Args:
      folder: where the log and the results are kept.
      draw: see PanoramaDrawer; None where nobody is served, and only the log is read.
      agents, assistants: by name, see `set_table`.
      addresses: see Server.
      open_world: gives a house that can be drawn, for people who drive.

    Raises:
      StudyError: not a study, or its log is another's.
      UnableError: people should drive, and this machine cannot draw fast enough.
    """
    path = Path(path)
    study, data_path = load_study(path), path.parent
    data = Dataset(data_path / study.data)
    tables = {p.name: set_table(p, data, agents, assistants) for p in study.parts if p.kind == "play"}
    for table in (t for t in tables.values() if t.part.figure):
        for house in sorted({t.world for t in (table.practice, *table.tasks.values())}):
            if live_pictures(study, data, house).quality is None:
                raise StudyError(
                    f"{path}: part {table.part.name!r}: figure = {table.part.figure!r} needs lit pictures, but "
                    f"{house} is drawn unlit; use a data set with --pictures fast, or with none and pictures = 'fast'"
                )
    folder.mkdir(parents=True, exist_ok=True)
    viewed = {p.name: tuple(load_lines(data_path / p.episodes, Episode)) for p in study.parts if p.episodes}
    worlds = {w for t in tables.values() for w in t.places} | {e.task.world for v in viewed.values() for e in v}
    for world in sorted(worlds):
        data.place(world)  # refuses houses that the data set has not
    files = {} if draw is None else {w: PanoramaFile(draw(data, w)) for w in sorted(worlds)}
    store = Store(folder / "people.db")
    secret = store.about("secret", secrets.token_hex(32))
    digest = hashlib.sha256((to_json(study) + data.digest).encode()).hexdigest()
    if store.about("study", digest) != digest:
        raise StudyError(
            f"{folder} holds what people did in another study, or in this one before {path.name} or its data set were "
            "changed; give another --out"
        )
    live = None
    if draw is not None and (driven := [t for t in tables.values() if t.part.moves == "drive"]):
        if open_world is None:
            raise StudyError(f"{path.name}: nobody can drive here, for nothing draws live pictures")
        live = Live(functools.partial(open_world, data))
        for table in driven:
            for task in {t.world: t for t in (table.practice, *table.tasks.values())}.values():
                where = table.places[task.world], task.start, table.grounds
                live.prepare(BrowserBody(*where, table.part.figure).eye)
    sessions = Sessions(study, tables, viewed)
    for event in store.events():
        sessions.apply(event)
    writer = ResultsWriter(folder, sessions)
    sessions.finished, sessions.judged = writer.game, writer.judged
    pictures = EncodedPanoramas(files, secret, open_world and functools.partial(open_world, data))
    return Opened(study, folder, Server(sessions, store, pictures, secret, addresses, live))


def live_pictures(study: Study, data: Dataset, house: str) -> PictureSettings:
    """How a house is drawn for people who drive: as its panoramas are, as far as that is quick."""
    pictures = data.drawn_pictures(house) or parse_pictures(study.pictures, study.size)
    return Baked("fast", gloss=False) if isinstance(pictures, Traced) else matte(pictures)


def serve(opened: Opened, host: str, port: int) -> None:
    """Serve until interrupted."""
    import uvicorn

    from embodied.serve.app import LONGEST_MESSAGE, app_of

    sockets = {"ws": "websockets-sansio", "ws_max_size": 4 * LONGEST_MESSAGE, "ws_ping_interval": 15}
    limits = {"ws_ping_timeout": 20, "limit_concurrency": 2500, "timeout_graceful_shutdown": 2}
    quiet = {"log_level": "warning", "access_log": False, "server_header": False}
    how: dict[str, Any] = {**sockets, **limits, **quiet}
    uvicorn.run(app_of(opened.server), host=host, port=port, **how)
