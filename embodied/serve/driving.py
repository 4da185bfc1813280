"""Pictures that people see in the browser: stored panoramas, and live ones of a body that goes ahead or turns.

The episode stays one of viewpoints: somebody who drives has moved to a viewpoint once it is the nearest that they could
go straight to. Assistants, measures and learners need not know how people moved.
"""

import asyncio
import functools
import hashlib
import hmac
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cv2
import numpy as np

from embodied.assets.decoding import jpeg
from embodied.assets.people import people
from embodied.envs.continuous import Body, NavMeshCache
from embodied.errors import UnableError
from embodied.house.moment import Moment, MovingPerson
from embodied.interface import Place, Pose
from embodied.navigation.doors import MARK, place_named
from embodied.navigation.free_space import EYE
from embodied.people.gait import STRIDE, Limbs, solved, walk
from embodied.render.camera import camera_at
from embodied.render.panorama_file import PanoramaFile, beside
from embodied.world import World

ACTIONS = ("Go ahead", "Turn left", "Turn right")
"""Actions of somebody who drives, by number."""
BODY = Body()
"""VLN-CE's: steps of 0.25 m, turns of 15 degrees."""
LIVE_SIZE = (240, 320)
"""Height and width of a live picture, pixels."""
LIVE_VFOV = math.radians(62.0)
LIVE_QUALITY = 70
SLOWEST = 2.0
"""Seconds for a picture from which on a machine is too slow to drive on."""
LIVE_KEPT = 64
"""Live pictures in memory."""
BEHIND, CLOSE, DOWN = 2.2, 1.4, -0.2
"""Metres of the camera behind who is steered, and up to which it would rather look from aside or from before; radians
that it looks up."""
Eye = tuple[str, float, float, float, float, MovingPerson | None]
"""World, x, y, z of the camera in metres, yaw in radians, and who is steered."""


class BrowserBody:
    """The body of somebody who drives, in one episode. Where it is follows from the order of its actions."""

    def __init__(self, place: Place, pose: Pose, grounds: NavMeshCache, figure: str = "") -> None:
        """`figure`: somebody of the pack who is steered, and seen from behind; nobody where empty."""
        self._limbs, self._walked, self._steps = Limbs(people()[figure]) if figure else None, 0.0, False
        self._who, self._graph, self._ground = figure, place.graph, grounds.of(place.house)
        nodes = np.asarray(place.graph.positions)
        self._nodes = self._ground.plane(nodes - [0.0, 0.0, EYE])
        self._world, self.yaw, self._here = place.name, pose.yaw, pose.node
        self.position = self._ground.nearest_free(self._nodes[pose.node])
        """(2,) metres, in the plane of the ways."""

    def act(self, action: int) -> int:
        """Do one of ACTIONS; the viewpoint where the body is now: the nearest that it could go straight to."""
        if action == 0:
            before, ahead = self.position, BODY.forward * np.array([math.cos(self.yaw), math.sin(self.yaw)])
            self.position = self._ground.moved(self.position, self.position + ahead, sliding=True)
            self._walked += math.dist(before, self.position)
        else:
            self.yaw += math.radians(BODY.turn) * (1 if action == 1 else -1)
        self._steps = action == 0
        away = np.linalg.norm(self._ground.world(self._nodes) - self._ground.world(self.position), axis=1)
        straight = self._ground.is_free(self.position, self._nodes)
        straight[self._here] = True
        self._here = int(np.argmin(np.where(straight, away, np.inf)))
        return self._here

    @property
    def eye(self) -> Eye:
        x, y, z = self._ground.world(self.position).tolist()
        if self._limbs is None:
            return self._world, x, y, z + BODY.eye, self.yaw, None
        sides = [self.yaw + turn for turn in (math.pi, 2.4, 3.9, 1.6, 4.7, 0.8, 5.5, 0.0)]
        far = (self.position + BEHIND * np.array([math.cos(s), math.sin(s)]) for s in sides)
        ends = (self._ground.moved(self.position, p, sliding=False) for p in far)
        at = max(ends, key=lambda p: min(math.dist(p, self.position), CLOSE))
        seen = self._ground.world(at).tolist()
        return self._world, *seen[:2], seen[2] + EYE, math.atan2(y - seen[1], x - seen[0]), self._figure(self._limbs)

    def _figure(self, limbs: Limbs) -> MovingPerson:
        """Who is steered: in the middle of a walk, or standing."""
        here, yaw = self._ground.world(self.position), self.yaw
        if not self._steps:
            return MovingPerson(self._who, *solved(limbs, limbs.standing(here, yaw)))
        since, ahead = 1.0 + self._walked % (STRIDE * limbs.leg), np.array([math.cos(yaw), math.sin(yaw), 0.0])
        course = walk(limbs, here + np.outer((-since, 2.0), ahead), np.full(2, yaw))
        times = np.linspace(0.0, course.seconds, 99)
        return MovingPerson(self._who, *solved(limbs, course.at(np.interp(since, [*map(course.walked, times)], times))))


class Live:
    """Draws what people see who drive, one picture at a time in a thread of its own; owns the renderers."""

    def __init__(self, open_world: Callable[[str], World]) -> None:
        """`open_world`: gives a house that can be drawn, by name."""
        self._world = functools.cache(open_world)
        self._thread = ThreadPoolExecutor(1, "live")
        self._drawn: OrderedDict[str, asyncio.Future[bytes]] = OrderedDict()

    def prepare(self, eye: Eye) -> None:
        """Draw a first picture of a house.

        Raises:
          UnableError: this machine cannot draw, or is too slow.
        """
        self._thread.submit(self._draw, eye).result()  # opens and uploads
        begun = time.monotonic()
        self._thread.submit(self._draw, eye).result()
        if (took := time.monotonic() - begun) > SLOWEST:
            raise UnableError(
                f"a live picture takes {took:.1f} s on this machine, which is too slow to drive by; leave out "
                'moves = "drive", so that people go from viewpoint to viewpoint'
            )

    async def picture(self, name: str, eye: Eye) -> bytes:
        """A JPEG of what is seen; one that is asked for again under the same name is not drawn again."""
        if name not in self._drawn:
            self._drawn[name] = asyncio.get_running_loop().run_in_executor(self._thread, self._draw, eye)
            if len(self._drawn) > LIVE_KEPT:
                self._drawn.popitem(last=False)
        return await asyncio.shield(self._drawn[name])

    def _draw(self, eye: Eye) -> bytes:
        name, x, y, z, yaw, figure = eye
        if figure is not None:
            self._world(name).show(Moment(people={figure.person: figure}))
        camera = camera_at((x, y, z), yaw, DOWN if figure else 0.0, LIVE_VFOV)
        rgb = self._world(name).renderer.rgb(camera, LIVE_SIZE)
        return jpeg(rgb, LIVE_QUALITY)


FACE_SIZES = {"small": 128, "large": 768}
"""Name to the largest side of a face, pixels."""
QUALITY = {"small": 60, "large": 82}
ENCODED_KEPT = 600
"""Encoded panoramas held in memory: some 100 MB."""


class EncodedPanoramas:
    """The panoramas of the study's houses, six faces side by side; nothing else can be asked for."""

    def __init__(self, files: Mapping[str, PanoramaFile], secret: str, open_world: Any = None) -> None:
        """
        Args:
          files: by house.
          secret: makes the names; only who was shown a viewpoint knows that of its panorama.
          open_world: as of Live, for what differs from the files: doors and furniture.
        """
        self._files, self._secret, self._lock = files, secret.encode(), threading.Lock()
        self._open = open_world and functools.cache(open_world)
        self._place = {self.name(w, n): (w, n) for w, file in files.items() for n in range(len(file))}
        self.encoded = functools.lru_cache(maxsize=ENCODED_KEPT)(self._encode)

    def name(self, world: str, node: int) -> str:
        """Of the panorama of a viewpoint, in addresses; `world` as Viewpoint has it."""
        name = hmac.new(self._secret, f"{world}/{node}".encode(), hashlib.sha256).hexdigest()[:24]
        if MARK in world:
            self._place[name] = world, node
        return name

    def has(self, name: str, size: str) -> bool:
        return name in self._place and size in FACE_SIZES

    def _encode(self, name: str, size: str) -> bytes:
        """A JPEG of the faces in the order of embodied.render.panorama.FACES."""
        world, node = self._place[name]
        if (house := world.partition(MARK)[0]) == world:
            faces = self._files[world].read(node).rgb
        else:
            with self._lock:  # one thread at a time may draw
                faces = place_named({house: self._open(house)}, world).panorama(node).rgb
        side = min(FACE_SIZES[size], faces.shape[1])
        if side != faces.shape[1]:
            faces = np.stack([cv2.resize(f, (side, side), interpolation=cv2.INTER_AREA) for f in faces])
        return jpeg(beside(faces), QUALITY[size], cv2.IMWRITE_JPEG_OPTIMIZE, 1)
