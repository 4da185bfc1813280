"""The server: pages, panoramas, and one WebSocket per browser that carries screens out and actions in."""

import asyncio
import functools
import hashlib
import hmac
import json
import logging
import secrets
import time
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware, RequestResponseEndpoint
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from embodied.envs.base import ActionError
from embodied.records import parse, to_json
from embodied.serve.driving import EncodedPanoramas, Live
from embodied.serve.game import ACTS, Game
from embodied.serve.results import summary
from embodied.serve.screens import live_name, next_part, plan_of, screen_of
from embodied.serve.sessions import Person, Sessions
from embodied.serve.store import Event, Store
from embodied.serve.study import LONGEST_TEXT, origin_of, page_address
from embodied.serve.talk import spoken_reply

STATIC = Path(__file__).parent / "static"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
LONGEST_MESSAGE = 16_384
"""Bytes of a message from a browser; longer ones close the connection."""
MESSAGE_PAUSE = 0.05
"""Seconds between two messages of a browser; who sends faster waits, and nothing is lost."""
HELLO_SECONDS = 30.0
"""Seconds that a new connection has to say who it is."""
SAFE = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' ws: wss:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
}
LOGGED_STRANGERS = 50
"""Addresses of other pages that are logged, each once."""
log = logging.getLogger(__name__)


class Refused(Exception):
    """Why a connection is closed, in words for whoever reads the page."""


class Server:
    """Owns the connections; everything else is in the sessions and in the store."""

    def __init__(
        self,
        sessions: Sessions,
        store: Store,
        pictures: EncodedPanoramas,
        secret: str,
        addresses: Iterable[str] | None = None,
        live: Live | None = None,
    ) -> None:
        """
        Args:
          secret: makes links and completion codes.
          live: draws what people see who drive.
          addresses: of the page, 'https://study.example.org/kitchen'; pages at others may not connect. None for the one
            that the browser asked for, whatever its name is.

        Raises:
          ValueError: not the address of a page.
        """
        self.sessions, self.store, self.pictures, self.live = sessions, store, pictures, live
        addresses = None if addresses is None else tuple(addresses)
        self.origins = None if addresses is None else tuple(origin_of(a) for a in addresses)
        self.paths = frozenset(urlsplit(page_address(a)).path for a in addresses or ()) - {""}
        """Under which a proxy may pass requests on; others are as at the root."""
        self._secret = secret.encode()
        self._sockets: dict[str, WebSocket] = {}
        self._bots: dict[str, asyncio.Task[None]] = {}
        houses = {name: place for table in sessions.tables.values() for name, place in table.places.items()}
        self._strangers: set[str] = set()
        self._plan = functools.cache(lambda house: plan_of(houses[house], pictures))
        self.failed = False
        """Something could not be written down; nothing is acknowledged any more."""

    # Links and codes -----------------------------------------------------------------------------

    def token(self, *names: str) -> str:
        """The secret word of a link, the same after a restart."""
        return hmac.new(self._secret, "/".join(names).encode(), hashlib.sha256).hexdigest()[:32]

    def code(self, person: Person) -> str:
        """Their completion code."""
        return self.token("code", person.id)[:8].upper()

    # What happens --------------------------------------------------------------------------------

    async def apply_event(self, event: Event) -> None:
        """Take in an event and write it down; returns when it is on disk.

        Raises:
          ActionError: not possible now.
        """
        if self.failed:
            raise Refused("The server cannot store answers now. Please tell the people who run the study.")
        self.sessions.apply(event)
        try:
            await self.store.append(event)
        except Exception:
            self.failed = True
            log.exception("an event could not be written; the server accepts nothing more until it is started again")
            raise

    async def advance(self, *people: Person) -> None:
        """Begin what can begin for these people, and show everybody concerned what they now see."""
        seen = {p.id: p for p in people}
        for person in people:
            while events := self.sessions.next(person, time.time()):
                for event in events:
                    await self.apply_event(event)
                if person.game:
                    seen |= {p: self.sessions.people[p] for p in self.sessions.games[person.game].people.values()}
        for person in seen.values():
            await self.show(person)
            if person.game:
                self.start_bot(self.sessions.games[person.game])

    async def show(self, person: Person) -> None:
        """Send somebody their screen."""
        socket = self._sockets.get(person.id)
        if socket is not None:
            screen = screen_of(self.sessions, person, self.pictures, self.code(person))
            with suppress(RuntimeError, WebSocketDisconnect):
                await socket.send_text(json.dumps(screen))

    def start_bot(self, game: Game) -> None:
        """Let the machine move whose turn it is, in a task of its own."""
        if game.bot_moves and game.id not in self._bots:
            task = asyncio.create_task(self._run_bot(game))
            self._bots[game.id] = task
            task.add_done_callback(lambda t: self._bots.pop(game.id, None))

    async def _run_bot(self, game: Game) -> None:
        people = [self.sessions.people[p] for p in game.people.values()]
        while game.bot_moves:
            if game.mover == "agent":
                await asyncio.sleep(self.sessions.study.pace)
            try:
                kind, body = await asyncio.to_thread(game.think)
                if game.over:
                    return
                await self.apply_event(Event(kind, time.time(), body={"game": game.id, **body}))
            except Exception as e:  # of anybody's policy or assistant: the episode ends, the study goes on
                log.exception("the bot of game %s failed", game.id)
                if not game.over and not self.failed:
                    body = {"game": game.id, "why": f"bot: {e!r:.200}"}
                    await self.apply_event(Event("broken", time.time(), body=body))
            for person in people:
                await self.show(person)

    # One browser ---------------------------------------------------------------------------------

    async def connect(self, socket: WebSocket) -> None:
        """Serve one WebSocket until it closes."""
        if socket.headers.get("origin") is None:  # no page of a browser
            await socket.close(4403)
            return
        await socket.accept()
        if refusal := self.refusal(socket):
            await self._refuse(socket, refusal)
            return
        person: Person | None = None
        try:
            hello = read_message(await asyncio.wait_for(socket.receive_text(), HELLO_SECONDS))
            if hello.get("admin") is not None:
                await self._admin(socket, str(hello["admin"]))
                return
            person = await self._enter(socket, hello)
            await self._serve(socket, person)
        except Refused as e:
            await self._refuse(socket, str(e))
        except (WebSocketDisconnect, TimeoutError, RuntimeError, KeyError):
            # it has gone, also while something was sent; KeyError: a binary message
            pass
        finally:
            if person is not None and self._sockets.get(person.id) is socket:
                del self._sockets[person.id]
                person.connected, person.away_since, person.waiting = 0, time.time(), None
                await self._tell_partners(person)
            with suppress(RuntimeError, WebSocketDisconnect):
                await socket.close()

    async def _refuse(self, socket: WebSocket, text: str) -> None:
        with suppress(RuntimeError, WebSocketDisconnect):
            await socket.send_text(json.dumps({"screen": "refused", "text": text}))
            await socket.close(4400)

    def refusal(self, socket: WebSocket) -> str | None:
        """The reason why a page may not connect, in words for who reads it; browsers always say which page it is."""
        page = socket.headers["origin"]
        try:
            page = origin_of(page)
            wanted = self.origins or (origin_of(f"{page.split(':')[0]}://{socket.headers.get('host')}"),)
        except ValueError:  # 'null': a file, or a frame without rights
            wanted = self.origins or ()
        if page in wanted:
            return None
        text = f"This page was opened at {page}, but the study is at {' or '.join(wanted[:1]) or 'another address'}. "
        text += f"Please open the link that you were given. (The server admits {page} if it is started with --address.)"
        if page not in self._strangers and len(self._strangers) < LOGGED_STRANGERS:
            self._strangers.add(page)
            log.warning("refused the page at %s: the study is at %s; see --address", page, ", ".join(wanted))
        return text

    async def _enter(self, socket: WebSocket, hello: dict[str, Any]) -> Person:
        """Whoever connects: somebody known by their token, or somebody new by a link."""
        person = self.sessions.by_key.get(key_of(hello.get("token")))
        token = str(hello.get("token"))
        if person is None:
            person, token = await self._join(str(hello.get("join")))
        older = self._sockets.get(person.id)
        self._sockets[person.id] = socket
        person.connected = 1
        if older is not None:
            with suppress(RuntimeError, WebSocketDisconnect):
                text = "This study is open in another window."
                await older.send_text(json.dumps({"screen": "refused", "text": text, "elsewhere": True}))
                await older.close(4409)
        await socket.send_text(json.dumps({"token": token}))
        await self.advance(person)
        await self._tell_partners(person)
        return person

    async def _join(self, link: str) -> tuple[Person, str]:
        invitation = key_of(link)
        single = invitation in self.invitations
        if not hmac.compare_digest(link, self.token("join")) and not single:
            raise Refused("This link is not valid. Please use the link that you were given.")
        if single and invitation in self.sessions.used:
            raise Refused("This link was used before, in another browser.")
        if len(self.sessions.people) >= self.sessions.study.people:
            raise Refused("Too many people want to take part just now. Please try again later.")
        token, name = secrets.token_urlsafe(24), secrets.token_hex(4)
        body = {"person": name, "key": key_of(token), "invitation": invitation if single else None}
        await self.apply_event(Event("joined", time.time(), body=body))
        return self.sessions.people[name], token

    invitations: frozenset[str] = frozenset()
    """Digests of the words of single-use links."""

    async def _serve(self, socket: WebSocket, person: Person) -> None:
        while True:
            text = await socket.receive_text()
            message = read_message(text)
            answer: dict[str, Any] = {"ack": message.get("id")}
            concerned: Iterable[Person] = ()
            try:
                concerned = await self.receive(person, message)
            except (ActionError, ValueError, KeyError, TypeError) as e:
                answer["error"] = str(e)[:200]
                await self.show(person)  # the browser may show what is no longer so
            await socket.send_text(json.dumps(answer))
            await self.advance(*concerned)
            await asyncio.sleep(MESSAGE_PAUSE)

    async def receive(self, person: Person, message: dict[str, Any]) -> Iterable[Person]:
        """Do what a browser says, until it is on disk; returns who is concerned.

        Raises:
          ActionError, ValueError, KeyError, TypeError: not possible now, or no such message.
        """
        name, do, now = str(message["id"])[:40], message["do"], time.time()
        if name in person.messages:  # sent again, because its acknowledgement was lost
            await self.store.flush()
            return ()
        if do == "house":
            await self._send_house(person)
            return ()
        if do == "ready":
            person.ready = True
        elif do == "consent":
            await self.apply_event(Event("consented", now, person.id, name))
            person.ready = next_part(self.sessions, person) is None  # else they read first what to do
        elif do == "leave":
            await self.apply_event(Event("ended", now, person.id, name, {"person": person.id, "why": "left"}))
            await self.late()
        elif do == "judge":
            text = words(message["text"]) if message.get("text") else ""
            body = {"stars": message.get("stars"), "text": text, "seconds": message.get("seconds")}
            if message["unit"] != "/".join(person.viewing or ()):
                raise ActionError("this was judged already")
            await self.apply_event(Event("judged", now, person.id, name, body))
        else:
            return await self._play(person, do, message, Event(str(do), now, person.id, name))
        return (person,)

    async def _play(self, person: Person, do: object, message: dict[str, Any], event: Event) -> Iterable[Person]:
        game = self.sessions.games[str(person.game)] if person.game else None
        if game is None or game.id != message["game"] or game.turn != message["turn"]:
            raise ActionError("this has changed in the meantime")
        role = next(r for r, p in game.people.items() if p == person.id)
        if do not in (*ACTS, "stopped", "asked", "answered") or role != game.mover:
            raise ActionError("it is not your turn")
        event.body.update(game=game.id)
        if do in ACTS:
            event.body["candidate"] = int(message["candidate"])
        elif do == "asked":
            text, part = words(message["text"]), game.table.part
            if not (part.free_question or game.practice) and text not in [q.text for q in part.questions]:
                raise ActionError("choose one of the questions")
            event.body["question"] = text
        elif do == "answered":
            part, picture = game.table.part, message.get("picture")
            if picture is not None:
                if not part.send_pictures:
                    raise ActionError("no pictures are sent here")
                if type(picture) is not int or picture not in range(len(game.situation.world.graph.positions)):
                    raise ActionError("there is no such viewpoint")
            reply = spoken_reply(game.situation, words(message["text"]), picture, len(game.said), part.way)
            event.body["reply"] = parse(to_json(reply))
        await self.apply_event(event)
        return [self.sessions.people[p] for p in game.people.values()]

    async def _send_house(self, person: Person) -> None:
        if person.game is None:
            raise ActionError("there is no plan to see now")
        game = self.sessions.games[person.game]
        if game.people.get("assistant") != person.id:
            raise ActionError("only the assistant sees the plan")
        socket = self._sockets.get(person.id)
        if socket is not None:
            await socket.send_text(json.dumps({"plan": self._plan(game.task.world)}))

    async def _admin(self, socket: WebSocket, word: str) -> None:
        if not hmac.compare_digest(word.encode(), self.token("results").encode()):
            raise Refused("This link is not valid.")
        while True:
            await socket.send_text(json.dumps({"screen": "results", **summary(self.sessions)}))
            await asyncio.sleep(5)

    async def _tell_partners(self, person: Person) -> None:
        if person.game:
            for other in self.sessions.games[person.game].people.values():
                if other != person.id:
                    await self.show(self.sessions.people[other])

    # What time brings ----------------------------------------------------------------------------

    async def late(self) -> None:
        """End what nobody goes on with."""
        for event in self.sessions.late(time.time()):
            game = self.sessions.games.get(event.body.get("game", ""))
            await self.apply_event(event)
            if game is not None:
                await self.advance(*(self.sessions.people[p] for p in game.people.values()))

    async def tick(self) -> None:
        """Once a second: time-outs, and those who wait."""
        while True:
            await asyncio.sleep(1)
            with suppress(Refused):
                await self.late()
                for person in [p for p in self.sessions.people.values() if p.waiting]:
                    await self.advance(person)


def app_of(server: Server) -> Starlette:
    """The ASGI application."""
    static = {p.name: (p.read_bytes(), TYPES[p.suffix]) for p in sorted(STATIC.iterdir()) if p.suffix in TYPES}

    async def page(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in static:
            return PlainTextResponse("There is no such page.", 404)
        body, kind = static[name]
        return Response(body, media_type=kind, headers={"cache-control": "no-cache"})

    async def panorama(request: Request) -> Response:
        name, size = request.path_params["name"], request.path_params["size"]
        if not server.pictures.has(name, size):
            return PlainTextResponse("There is no such picture.", 404)
        data = await asyncio.to_thread(server.pictures.encoded, name, size)
        return Response(data, media_type="image/jpeg", headers={"cache-control": "private, max-age=604800, immutable"})

    async def live(request: Request) -> Response:
        game = server.sessions.games.get(request.path_params["game"])
        name = f"{request.path_params['game']}/{request.path_params['name']}"
        if server.live is None or game is None or game.drive is None or name != live_name(game, server.pictures):
            return PlainTextResponse("There is no such picture now.", 404)
        data = await server.live.picture(name, game.drive.eye)
        return Response(data, media_type="image/jpeg", headers={"cache-control": "private, max-age=60, immutable"})

    async def health(request: Request) -> Response:
        return PlainTextResponse("failed" if server.failed else "ok", 503 if server.failed else 200)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        ticking = asyncio.create_task(server.tick())
        for game in server.sessions.games.values():
            server.start_bot(game)
        yield
        ticking.cancel()

    async def enter(request: Request) -> Response:  # else the page's relative links would miss the path
        return RedirectResponse(request.url.path + "/")

    async def safe(request: Request, call_next: RequestResponseEndpoint) -> Response:
        response = await call_next(request)
        response.headers.update(SAFE)
        return response

    pages: list[BaseRoute] = [
        Route("/", page),
        Route("/health", health),
        Route("/static/{name}", page),
        Route("/pano/{name}/{size}.jpg", panorama),
        Route("/live/{game}/{name}.jpg", live),
        WebSocketRoute("/ws", server.connect),
    ]
    routes = [*pages]
    for path in sorted(server.paths):  # a proxy may pass requests on that keep its path
        routes[:0] = [Route(path, enter), Mount(path, routes=pages)]
    return Starlette(routes=routes, lifespan=lifespan, middleware=[Middleware(BaseHTTPMiddleware, dispatch=safe)])


def read_message(text: str) -> dict[str, Any]:
    """The JSON object that a browser sent.

    Raises:
      Refused: something else.
    """
    try:
        value = parse(text) if len(text) <= LONGEST_MESSAGE else None
    except ValueError:
        value = None
    if not isinstance(value, dict):
        raise Refused("The server did not understand this browser. Please reload the page.")
    return value


def words(text: object) -> str:
    """The text that somebody wrote, without blanks around it.

    Raises:
      ActionError: nothing, or too much.
    """
    if not isinstance(text, str) or not 0 < len(text.strip()) <= LONGEST_TEXT:
        raise ActionError(f"please write 1 to {LONGEST_TEXT} characters")
    return "".join(c for c in text.strip() if c.isprintable() or c == "\n")


def key_of(token: object) -> str:
    """The digest that is stored of a secret word."""
    return hashlib.sha256(str(token).encode()).hexdigest()
