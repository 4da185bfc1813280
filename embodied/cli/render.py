"""Render the panoramas of a generated house.

Without --node, all viewpoints of the house go to DIR/panoramas.pano, one file with random access.
With --node, one panorama is drawn, as an equirectangular picture.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, fetch, note, show
from embodied.cli.options import any_path, face, file_to_write, whole
from embodied.render.pictures import BACKENDS, QUALITIES

if TYPE_CHECKING:
    from embodied.world import World


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=any_path, metavar="DIR", help="folder that `embodied house` wrote")
    parser.add_argument("--size", type=face, default=512, help="side of a cube face in pixels (default: %(default)s)")
    parser.add_argument(
        "--quality",
        choices=QUALITIES[1:],
        default="normal",
        help="unlit: at once; fast, normal: global illumination, normal is the default; glossy: traced from it; "
        "reference: path-traced, slow",
    )
    parser.add_argument(
        "--backend", choices=BACKENDS, default="classic", help="classic: OpenGL through EGL; filament: Vulkan"
    )
    parser.add_argument("--node", type=whole(0), help="draw only this viewpoint")
    parser.add_argument("--equirect", type=file_to_write, metavar="PNG", help="where to write the picture of --node")
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.world import open_folder

    if (args.node is None) != (args.equirect is None):
        raise ValueError("--node and --equirect go together: --node 3 --equirect node3.png")
    catalogue = catalogue_of(args)
    with open_folder(
        args.folder, catalogue, args.cache, size=args.size, quality=args.quality, backend=args.backend
    ) as world:
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
    """Draw one viewpoint as an equirectangular PNG."""
    import cv2

    from assets.cache import write_bytes

    nodes = len(world.graph.ids)
    if not 0 <= args.node < nodes:
        raise ValueError(f"--node {args.node} does not exist; this house has the nodes 0 to {nodes - 1}")
    picture = world.panorama(args.node).equirect(2 * args.size)
    write_bytes(args.equirect, cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes())
    note(f"node {args.node} in {world.graph.room_of_node[args.node]}")
    show(args, {"node": args.node, "picture": str(args.equirect)}, f"wrote {args.equirect}")
    return 0
