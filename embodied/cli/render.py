"""Render the panoramas of a generated house.

Without --node, all viewpoints of the house go to DIR/panoramas.pano, one file with random access.
With --node, one panorama is drawn, as an equirectangular picture or a view out of it, perhaps photographed (--camera).
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, fetch, note, show
from embodied.cli.options import add_pictures, face, file_ending_in, house_folder, whole
from embodied.render.panorama import VFOV36
from embodied.render.photograph import CAMERAS
from embodied.render.pictures import PICTURES, PictureSettings

if TYPE_CHECKING:
    from embodied.world import World


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=house_folder, metavar="DIR", help="folder that `embodied house` wrote")
    parser.add_argument("--size", type=face, default=512, help="side of a cube face in pixels (default: %(default)s)")
    add_pictures(parser, PICTURES, "normal")
    parser.add_argument("--node", type=whole(0), help="draw only this viewpoint")
    parser.add_argument(
        "--equirect", type=file_ending_in(".png"), metavar="PNG", help="where to write the picture of --node"
    )
    parser.add_argument("--view", type=file_ending_in(".png"), metavar="PNG", help="where to write a view from --node")
    parser.add_argument("--yaw", type=float, default=0.0, help="degrees of --view, counter-clockwise (default: 0)")
    parser.add_argument(
        "--camera",
        choices=CAMERAS,
        default="ideal",
        help="camera that takes the picture of --node; panorama files are always taken by the ideal one "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--device", type=int, default=0, help="seed of the camera's imperfections (default: %(default)s)"
    )
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.world import open_folder

    if (args.node is None) != (args.equirect is None and args.view is None):
        raise ValueError("--node goes together with --equirect or --view: --node 3 --equirect node3.png")
    if args.camera != "ideal" and args.node is None:
        raise ValueError(
            "--camera takes pictures of one viewpoint: --node 3 --view node3.png --camera phone; panorama files stay "
            "ideal, and environments and training photograph what they show of them"
        )
    catalogue = catalogue_of(args)
    pictures = PictureSettings(args.size, args.pictures)
    with open_folder(args.folder, catalogue, args.cache, pictures) as world:
        fetch(catalogue, world.house)
        if args.node is not None:
            return one(args, world)
        path = world.render_all(progress=True)
        facts = {
            "nodes": len(world.graph.ids),
            "file": str(path),
            "mib": round(path.stat().st_size / 2**20, 1),
            "renderer": world.fingerprint,
        }
    show(args, facts, f"{facts['nodes']} panoramas in {path} ({facts['mib']} MiB)")
    return 0


def one(args: argparse.Namespace, world: World) -> int:
    """Draw one viewpoint as an equirectangular PNG, or a view from it, or both."""
    import cv2

    from assets.cache import write_bytes
    from embodied.render.photograph import PhotoCamera

    nodes = len(world.graph.ids)
    if not 0 <= args.node < nodes:
        raise ValueError(f"--node {args.node} does not exist; this house has the nodes 0 to {nodes - 1}")
    camera, panorama = PhotoCamera(args.camera, args.device), world.panorama(args.node)
    place = (world.name, args.node)
    dark = world.darkness(world.graph.positions[args.node]) if camera.traits else 1.0
    pictures = {}
    if args.equirect:
        pictures[args.equirect] = camera.photographed(panorama.equirect(2 * args.size), None, *place, light=dark)
    if args.view:
        rgb = panorama.view_rgb(math.radians(args.yaw), 0.0, VFOV36, (args.size, args.size * 4 // 3))
        pictures[args.view] = camera.photographed(rgb, VFOV36, *place, light=dark)
    for path, rgb in pictures.items():
        write_bytes(path, cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1].tobytes())
    note(f"node {args.node} in {world.graph.room_of_node[args.node]}, {args.camera} camera")
    words = ", ".join(map(str, pictures))
    show(args, {"node": args.node, "camera": args.camera, "pictures": list(map(str, pictures))}, f"wrote {words}")
    return 0
