"""Part: one visible mesh of the house, who owns it and where it stands."""

from dataclasses import dataclass

from embodied.assets.records import MeshPart


@dataclass(frozen=True, eq=False)
class Part:
    owner: str
    """Placement id, or a shell id: '<room>/floor', '<room>/wall_<i>', '<opening>/leaf', 'outdoor/ground'."""
    kind: str
    """'object', 'wall', 'floor', 'ceiling', 'outdoor' or 'opening': all joinery (frames, leaves, panes, sills) and
    stairs."""
    room: str
    """The room it is seen from first; '' for the outdoors."""
    mesh: MeshPart
    mesh_key: str
    """Parts with equal keys have equal meshes and may share geometry."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Position of the mesh's origin, world, metres."""
    yaw: float = 0.0
    """Turn about z, radians counter-clockwise."""
    detail: int = 0
    """Of people: 0, or of copies that are drawn where they are small in a picture, 1 and 2 (`posed`)."""
