"""Render the panoramas of a generated house.

Without --node, all viewpoints go to DIR/panoramas.pano, one file with random access. With --node, one panorama is
written as an equirectangular picture (--equirect), or a view of it (--view), optionally through an imperfect --camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.assets.json_file import load_json
from embodied.cli.common import Furnished, Printed, catalogue_of, check_machine, fetch, note, show
from embodied.house.moment import Moment
from embodied.options import CubeFace, InputPath, Option, OutputPng, drawn_as, house_folder, whole
from embodied.render.panorama import VFOV36
from embodied.render.photograph import CAMERAS
from embodied.render.pictures import PICTURES, parse_pictures

if TYPE_CHECKING:
    from embodied.world import World


@dataclass(frozen=True, kw_only=True)
class RenderOptions(Furnished, Printed):
    folder: Annotated[Path, Option(house_folder, "DIR", name="folder")]
    """Folder that `embodied house` wrote."""
    size: CubeFace = 512
    """Side of a cube face in pixels."""
    pictures: Annotated[str, drawn_as(PICTURES)] = "normal"
    """How the house is drawn."""
    node: Annotated[int | None, Option(whole(0), "N")] = None
    """Draw only this viewpoint."""
    equirect: OutputPng | None = None
    """Write the picture of --node here."""
    view: OutputPng | None = None
    """Write a view from --node here."""
    yaw: float = 0.0
    """Direction of --view, degrees counter-clockwise."""
    moment: InputPath | None = None
    """Draw --node with things moved, doors opened and lamps switched, as JSON (docs/moving.md)."""
    camera: Annotated[str, Option(words=CAMERAS)] = "ideal"
    """Camera that takes the picture of --node; panorama files are always taken by the ideal one."""
    device: int = 0
    """Random seed of the camera's imperfections."""


def run(args: RenderOptions) -> None:
    from embodied.world import open_folder

    if (args.node is None) != (args.equirect is None and args.view is None):
        raise ValueError("--node goes together with --equirect or --view: --node 3 --equirect node3.png")
    if args.camera != "ideal" and args.node is None:
        raise ValueError(
            "--camera takes pictures of one viewpoint: --node 3 --view node3.png --camera phone; panorama files stay "
            "ideal, and environments and training photograph what they show of them"
        )
    if args.moment is not None and args.node is None:
        raise ValueError("--moment shows one viewpoint: --node 3 --view node3.png --moment moment.json")
    check_machine("unlit")  # the house may be lit already
    catalogue = catalogue_of(args)
    drawn = parse_pictures(args.pictures, args.size)
    with open_folder(args.folder, catalogue, args.cache, drawn) as world:
        fetch(catalogue, world.house)
        if args.moment is not None:
            world.show(load_json(args.moment, Moment))
        if args.node is not None:
            one(args, args.node, world)
            return
        path = world.render_all(progress=True)
        facts = {"nodes": len(world.graph.ids), "file": str(path), "mib": round(path.stat().st_size / 2**20, 1)}
        facts["renderer"] = world.fingerprint
    show(args, facts, f"{facts['nodes']} panoramas in {path} ({facts['mib']} MiB)")


def one(args: RenderOptions, node: int, world: World) -> None:
    """Draw one viewpoint as an equirectangular PNG, or a view from it, or both."""
    import cv2

    from embodied.assets.cache import write_bytes
    from embodied.render.photograph import PhotoCamera

    nodes = len(world.graph.ids)
    if not 0 <= node < nodes:
        raise ValueError(f"--node {node} does not exist; this house has the nodes 0 to {nodes - 1}")
    camera, panorama = PhotoCamera(args.camera, args.device), world.panorama(node)
    place = (world.name, node)
    dark = world.darkness(world.graph.positions[node]) if camera.traits else 1.0
    pictures = {}
    if args.equirect:
        pictures[args.equirect] = camera.photographed(panorama.equirect(2 * args.size), None, *place, light=dark)
    if args.view:
        rgb = panorama.view_rgb(math.radians(args.yaw), 0.0, VFOV36, (args.size, args.size * 4 // 3))
        pictures[args.view] = camera.photographed(rgb, VFOV36, *place, light=dark)
    for path, rgb in pictures.items():
        write_bytes(path, cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1].tobytes())
    note(f"node {node} in {world.graph.room_of_node[node]}, {args.camera} camera")
    words = ", ".join(map(str, pictures))
    show(args, {"node": node, "camera": args.camera, "pictures": list(map(str, pictures))}, f"wrote {words}")
