"""Let people take part in a browser: as assistant, agent, rater or describer.

STUDY.toml says who does what, with whom and how often; examples/study.toml is an example. Prints the links for
participants and serves until Ctrl-C; rerun the command to continue. The answers are in OUT: episodes*.jsonl for
`embodied view`, judgements.jsonl, and the log people.db, from which both are made. `embodied dataset from-people` makes
a data set of them.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents.language_models.client import WithModel, client_of
from embodied.cli.common import Furnished, Printed, catalogue_of, note, show
from embodied.errors import UnableError
from embodied.options import Count, Option, OutputFolder, any_path, whole
from embodied.render.pictures import PictureSettings, Traced, parse_pictures
from embodied.serve.study import page_address
from embodied.software import DISTRIBUTION

if TYPE_CHECKING:
    from embodied.agents.language_models.client import Client
    from embodied.datasets.store import Dataset, SplitData
    from embodied.interface import Agent
    from embodied.serve.game import AgentMaker
    from embodied.serve.study import Study
    from embodied.world import World

LOOPBACK = "127.0.0.1"
LOOPBACKS = (LOOPBACK, "localhost", "::1")


def any_address(text: str) -> str:
    """The address of a page."""
    try:
        return page_address(text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from e


@dataclass(frozen=True, kw_only=True)
class PeopleStudyOptions(WithModel, Furnished, Printed):
    study: Annotated[Path, Option(any_path, "STUDY.toml", name="study")]
    """The study."""
    out: OutputFolder | None = None
    """Folder that keeps the answers (default: STUDY.people beside the study)."""
    host: Annotated[str, Option(metavar="ADDRESS")] = LOOPBACK
    """Address to listen on; the default is this machine only. Put a proxy with TLS in front of it rather than listen on
    0.0.0.0."""
    port: Annotated[int, Option(whole(1, 65535), "N")] = 8080
    """Port to listen on."""
    address: Annotated[str | None, Option(any_address, "URL")] = None
    """Address of the page as people see it, such as https://study.example.org or https://example.org/study; links are
    made with it and connections from it are accepted."""
    invitations: Count | None = None
    """Make N single-use links instead of one for everybody."""
    summary: bool = False
    """Print the summary of what was done so far, and end."""


NEEDED = ("starlette", "uvicorn", "websockets")


def run(args: PeopleStudyOptions) -> None:
    if missing := [n for n in NEEDED if importlib.util.find_spec(n) is None]:
        raise UnableError(f"the server needs {', '.join(missing)}; run: pip install '{DISTRIBUTION}[serve]'")
    from embodied.agents.language_models.agent import assistant_maker
    from embodied.serve.run import open_study, serve
    from embodied.serve.study import load_study

    study = load_study(args.study)
    out = args.out or args.study.with_suffix(".people")
    address = args.address or listening_at(args.host, args.port)
    client = functools.cache(lambda: client_of(args))
    draw = None if args.summary else functools.partial(drawn, study=study, args=args)
    live = functools.partial(live_world, study=study, args=args)
    agents = agents_of(args.study.parent / study.data, client)
    assistants = {"llm": assistant_maker("llm", client, args.prompts)}
    opened = open_study(args.study, out, draw, agents, assistants, addresses_of(args), live)
    if args.summary:
        from embodied.serve.results import as_text, summary

        facts = summary(opened.server.sessions)
        show(args, facts, as_text(facts))
        return
    links = opened.links(address, args.invitations or 0)
    secrets = out / "links.json"
    secrets.unlink(missing_ok=True)
    secrets.touch(0o600)  # only its owner can read it
    secrets.write_text(json.dumps(links, indent=1) + "\n", encoding="utf-8")
    if args.host not in LOOPBACKS:
        note(f"listening on {args.host}: whoever reaches this machine can connect; without TLS, answers can be read")
    few = {k: v if len(v) <= 3 else [*v[:3], f"... {len(v)} in {out / 'links.json'}"] for k, v in links.items() if v}
    show(args, links, "\n".join(f"{name}: {link}" for name, many in few.items() for link in many))
    sys.stdout.flush()
    serve(opened, args.host, args.port)


def drawn(data: Dataset, name: str, study: Study, args: PeopleStudyOptions) -> Path:
    """The panoramas of a house: the data set's where they are sharp enough for the study, else drawn into the cache."""
    stored = data.drawn_pictures(name)
    if stored is not None and stored.size >= study.size:
        return data.panoramas(name)
    if isinstance(stored, Traced):
        note(f"panoramas of {name}: {stored.size} pixels are blurred on a page; trace them with --size {study.size}")
        return data.panoramas(name)
    note(f"panoramas of {name}: drawn with faces of {study.size} pixels")
    if stored is not None:
        note(f"  (the data set's {stored.size} are blurred on a page; `size = {stored.size}` in the study keeps them)")
    try:
        with world_of(data, name, parse_pictures(stored or study.pictures, study.size), args) as world:
            return world.render_all(progress=True)
    except UnableError as e:
        if stored is None:
            raise
        note(f"  (the data set's are used, for this machine draws none: {e})")
        return data.panoramas(name)


def live_world(data: Dataset, name: str, study: Study, args: PeopleStudyOptions) -> World:
    """A house to be drawn for people who drive."""
    from embodied.serve.run import live_pictures

    return world_of(data, name, live_pictures(study, data, name), args)


def world_of(data: Dataset, name: str, pictures: PictureSettings, args: PeopleStudyOptions) -> World:
    """A house of the data set, to be drawn so."""
    from embodied.world import open_world

    place = data.place(name)
    return open_world(place.house, catalogue_of(args), args.cache, pictures, graph=place.graph)


def listening_at(host: str, port: int) -> str:
    """The address of the page without a proxy in front."""
    return page_address(f"http://{f'[{host}]' if ':' in host else host}:{port}")


def addresses_of(args: PeopleStudyOptions) -> tuple[str, ...] | None:
    """Addresses of the page; None where the server listens to all and nobody said its address."""
    own = tuple(listening_at(name, args.port) for name in LOOPBACKS)
    if args.address:
        return (args.address, *own)
    return own if args.host in LOOPBACKS else None


def agents_of(folder: Path, client: Callable[[], Client]) -> Mapping[str, AgentMaker]:
    """The policies that a study may name: those without learning, the agent that ships, and a language model."""
    from embodied.datasets.store import Dataset
    from embodied.serve.game import POLICIES

    data = Dataset(folder)

    def shipped(split: SplitData) -> Agent:
        from embodied.agents.learner import PlaySettings, playing_learner

        learner = playing_learner(data.kind)
        if learner is None or learner.players is None or learner.shipped is None:
            raise ValueError(f"no trained agent comes with the program for tasks of kind {data.kind!r}")
        _, agent = learner.players(learner.shipped, data, PlaySettings())(split.name).agents["learned"]
        return agent

    def model(split: SplitData) -> Agent:
        from embodied.agents.language_models.agent import LanguageModelAgent

        return LanguageModelAgent(client())

    return {**POLICIES, "shipped": shipped, "llm": model}
