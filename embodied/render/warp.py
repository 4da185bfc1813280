"""Batches of pictures of a lit house by MuJoCo Warp, on a CUDA device, or slowly on the CPU.

MuJoCo Warp casts rays and shades what they meet with its base colour times its emission, so the baked pages come out
as they are. A batch is one launch: every view is a world of its own with the house's one camera in it. Pictures stay on
the device as Warp arrays, which other libraries read without a copy through DLPack (torch.from_dlpack, jax.dlpack).

Differs from the classic renderer: a pixel is one ray, so edges are not smoothed and textures have no smaller copies,
and of several panes of glass behind each other the first alone is tinted.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from embodied import gl

gl.prepare()

import mujoco
import numpy as np

from embodied.errors import UnableError
from embodied.house.house import House
from embodied.render.camera import FAR_PLANE, NEAR_PLANE, View
from embodied.render.panorama import Panorama
from embodied.render.pictures import check_size
from embodied.render.sampling import FACES
from embodied.scene.house_meshes import owners
from embodied.scene.lit_pages import LitPages, glass_surfaces
from embodied.scene.model import VISUAL, build_spec, compile_spec, owner_of_name

try:
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING  # else it tells of devices and compilers on standard output
    import mujoco_warp as mjw
except ImportError as e:
    raise UnableError(
        f"the back end 'warp' needs mujoco-warp ({e}); pip install 'embodied-houses[warp]', or use backend 'classic'"
    ) from e

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

SEEN = ("rgb", "depth", "ids")
FACE_GAP = 5e-4
"""How far the two faces of a thin thing are moved apart, metres: of two faces in one place a ray meets either."""
FACE_YAWS = tuple(math.atan2(f[1], f[0]) if f[2] == 0 else 0.0 for f, _ in FACES)
FACE_PITCHES = tuple(math.asin(f[2]) for f, _ in FACES)
"""Directions of a panorama's faces, radians."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Pictures on the device. The next batch of the same renderer is drawn into the same memory."""

    rgb: Any
    """Warp array (n, h, w, 3) uint8 sRGB, top row first."""
    depth: Any
    """Warp array (n, h, w) float32 metres along the optical axis; inf where nothing is (the sky)."""
    ids: Any
    """Warp array (n, h, w) int32: i + 1 for house_meshes.owners(house)[i], 0 where nothing is."""


class WarpRenderer:
    """Draws up to `worlds` pictures of one lit house at once, all of one size and field of view."""

    def __init__(
        self,
        house: House,
        catalogue: Catalogue,
        lit: LitPages,
        *,
        worlds: int = 6,
        size: tuple[int, int] = (128, 128),
        vfov: float = math.pi / 2,
        device: str | None = None,
    ) -> None:
        """Compile `house` and upload it.

        Args:
          lit: the baked pages to show.
          worlds: the most views of one batch.
          size: (height, width) of a picture, pixels.
          vfov: vertical field of view, radians.
          device: Warp's name of a device, 'cuda:0' or 'cpu'; None is a GPU where one is.

        Raises:
          ValueError: impossible size, or no worlds.
          UnableError: `device` is not here.
        """
        for side in size:
            check_size(side)
        if worlds < 1:
            raise ValueError(f"worlds is {worlds}; a renderer needs at least one")
        self.house, self.size, self.vfov, self.worlds = house, size, vfov, worlds
        self.device = device_of(device)
        model, opacities, owned = _compiled(house, catalogue, lit, vfov)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        height, width = size
        with wp.ScopedDevice(self.device):
            self._model = mjw.put_model(model)
            self._data = mjw.put_data(model, data, nworld=worlds)
            self._context = context = _context(model, worlds, size)
            flag = lambda on: wp.array([on], dtype=bool)
            self._passes = {
                (rgb, rest): dataclasses.replace(
                    context, render_rgb=flag(rgb), render_depth=flag(rest), render_seg=flag(rest)
                )
                for rgb, rest in ((True, True), (True, False), (False, True))
            }
            self._behind = self._pass_behind(model.geom_rgba, opacities) if (opacities < 1).any() else None
            self._opacities, self._owned = wp.array(opacities, dtype=float), wp.array(owned, dtype=int)
            self._batch = Batch(
                wp.zeros((worlds, height, width, 3), dtype=wp.uint8),
                wp.zeros((worlds, height, width), dtype=float),
                wp.zeros((worlds, height, width), dtype=int),
            )

    def _pass_behind(self, colours: np.ndarray, opacities: np.ndarray) -> tuple[Any, Any]:
        """Model and context of what is seen through glass: all that is opaque, in pictures of its own."""
        clear = colours.copy()
        clear[opacities < 1, 3] = 0
        rgb, seg = wp.zeros_like(self._context.rgb_data), wp.zeros_like(self._context.seg_data)
        return (
            dataclasses.replace(self._model, geom_rgba=wp.array(clear[None], dtype=wp.vec4)),
            dataclasses.replace(self._passes[True, False], rgb_data=rgb, seg_data=seg),
        )

    def views(
        self,
        positions: np.ndarray | Sequence | Any,
        yaws: np.ndarray | Sequence | Any,
        pitches: np.ndarray | Sequence | Any | None = None,
        *,
        sees: Collection[str] = SEEN,
    ) -> Batch:
        """Pictures from `positions` along (yaws, pitches), upright.

        Args:
          positions: (n, 3) metres; n at most `worlds`. NumPy or Warp arrays (wp.from_torch makes those of tensors).
          yaws: (n,) radians counter-clockwise from +x.
          pitches: (n,) radians, up is positive; level if None.
          sees: of SEEN; the others hold what they held before.
        """
        n = len(positions)
        if not 0 < n <= self.worlds:
            raise ValueError(f"a batch has {n} views; this renderer was made for 1 to {self.worlds} (worlds=)")
        if not sees or (unknown := sorted(set(sees) - set(SEEN))):
            raise ValueError(f"sees is {tuple(sees)}; name some of {SEEN}" + (f", not {unknown}" if sees else ""))
        colours, rest = "rgb" in sees, "depth" in sees or "ids" in sees
        with wp.ScopedDevice(self.device):
            poses = (positions, wp.vec3), (yaws, float), (np.zeros(n) if pitches is None else pitches, float)
            given = [
                x if isinstance(x, wp.array) else wp.array(np.asarray(x, np.float32), dtype=kind) for x, kind in poses
            ]
            wp.launch(_aim, n, inputs=given, outputs=[self._data.cam_xpos, self._data.cam_xmat])
            self._data.nworld = n
            through = colours and self._behind is not None
            mjw.render(self._model, self._data, self._passes[colours, rest or through])
            if self._behind is not None and through:
                mjw.render(self._behind[0], self._data, self._behind[1])
            batch = Batch(*(a[:n] for a in (self._batch.rgb, self._batch.depth, self._batch.ids)))
            context = self._context
            wp.launch(
                _finish,
                (n, *self.size),
                inputs=[
                    context.rgb_data,
                    context.rgb_data if self._behind is None else self._behind[1].rgb_data,
                    context.depth_data,
                    context.seg_data,
                    self._opacities,
                    self._owned,
                    self.size[1],
                    colours,
                    through,
                    rest,
                ],
                outputs=[batch.rgb, batch.depth, batch.ids],
            )
        return batch

    def view(self, position: Sequence[float] | np.ndarray, yaw: float, pitch: float = 0.0) -> View:
        """The picture from `position` (x, y, z) along (yaw, pitch), radians."""
        batch = self.views([position], [yaw], [pitch])
        return View(*(a.numpy()[0].copy() for a in (batch.rgb, batch.depth, batch.ids)))

    def panorama(self, position: Sequence[float] | np.ndarray) -> Panorama:
        """Six cube faces of rgb, depth and ids around `position` (x, y, z).

        Raises:
          ValueError: the pictures of this renderer are no faces of a cube.
        """
        if self.size[0] != self.size[1] or not math.isclose(self.vfov, math.pi / 2):
            raise ValueError(
                f"faces of a panorama are square and see 90 degrees, not {self.size} and {math.degrees(self.vfov):g}"
            )
        batch = self.views([position] * 6, FACE_YAWS, FACE_PITCHES)
        return Panorama(*(a.numpy().copy() for a in (batch.rgb, batch.depth, batch.ids)))

    def wait(self) -> None:
        """Return when the device has drawn what was asked for; `views` only asks."""
        wp.synchronize_device(self.device)

    def close(self) -> None:
        """Free what lies on the device; the renderer cannot be used afterwards."""
        vars(self).clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def device_of(name: str | None) -> Any:
    """Warp's device of that name; of None a GPU where one is, else the CPU.

    Raises:
      UnableError: it is not here.
    """
    try:
        return wp.get_preferred_device() if name is None else wp.get_device(name)
    except (ValueError, RuntimeError) as e:
        raise UnableError(
            f"Warp has no device {name!r} here ({e}); use one of {[str(d) for d in wp.get_devices()]}"
        ) from e


def _context(model: mujoco.MjModel, worlds: int, size: tuple[int, int]) -> Any:
    """Context that MuJoCo Warp draws colour, depth and ids of every world with."""
    context = mjw.create_render_context(
        model,
        worlds,
        cam_res=size[::-1],
        render_rgb=True,
        render_depth=True,
        render_seg=True,
        use_textures=False,  # it would upload them as floats
        use_ambient_lighting=False,
        enabled_geom_groups=[VISUAL],
        enable_vertex_normals=False,
        enable_specular=False,
    )
    context.use_textures, context.textures_registry = True, [_texture(model, t) for t in range(model.ntex)]
    context.textures = wp.array(context.textures_registry, dtype=wp.Texture2D)
    context.znear, context.zfar = NEAR_PLANE, FAR_PLANE  # part of the compiled kernel, so one for all houses
    return context


def _compiled(
    house: House, catalogue: Catalogue, lit: LitPages, vfov: float
) -> tuple[mujoco.MjModel, np.ndarray, np.ndarray]:
    """The lit house with one camera, and of every geom its opacity (float32) and its instance id (int32)."""
    spec = build_spec(house, catalogue, collisions=False, lit=lit)
    spec.worldbody.add_camera(name="eye", fovy=math.degrees(vfov))
    model = compile_spec(spec)
    _part_faces(model)
    number = {name: i + 1 for i, name in enumerate(owners(house))}
    layers = {g.name: glass_surfaces(lit.meshes[int(g.meshname.partition("_")[0])]) // 2 for g in spec.geoms}
    names = [model.geom(g).name for g in range(model.ngeom)]
    opacities = 1 - (1 - model.geom_rgba[:, 3]) ** np.array([max(1, layers[name]) for name in names])
    owned = np.array([number.get(owner_of_name(name), 0) for name in names], np.int32)
    return model, opacities.astype(np.float32), owned


def _part_faces(model: mujoco.MjModel) -> None:
    """Move faces of one mesh that lie in one place apart, each along its normal."""
    mesh = np.repeat(np.arange(model.nmesh), model.mesh_facenum)
    faces = model.mesh_face + model.mesh_vertadr[mesh][:, None]
    corners = model.mesh_vert[faces].astype(np.float64)
    place = np.column_stack([mesh, np.rint(corners.mean(axis=1) * 1e4)]).astype(np.int64)
    _, which, count = np.unique(place, axis=0, return_inverse=True, return_counts=True)
    twins = count[which.reshape(-1)] > 1
    normals = np.cross(corners[twins, 1] - corners[twins, 0], corners[twins, 2] - corners[twins, 0])
    shift = np.zeros(model.mesh_vert.shape)
    np.add.at(shift, faces[twins].reshape(-1), np.repeat(normals, 3, axis=0))
    shift /= np.maximum(np.linalg.norm(shift, axis=1, keepdims=True), 1e-12)
    model.mesh_vert[:] += FACE_GAP * shift


def _texture(model: mujoco.MjModel, index: int) -> Any:
    """A texture of `model` on the device, of four bytes a texel."""
    height, width, channels = (int(a[index]) for a in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[index])
    texels = np.full((height, width, 4), 255, np.uint8)
    texels[..., :channels] = model.tex_data[start : start + height * width * channels].reshape(height, width, channels)
    return wp.Texture2D(texels, filter_mode=wp.TextureFilterMode.LINEAR)


@wp.kernel
def _aim(
    positions: wp.array[wp.vec3],
    yaws: wp.array[float],
    pitches: wp.array[float],
    xpos: wp.array2d[wp.vec3],
    xmat: wp.array2d[wp.mat33],
) -> None:
    """The camera of every world as in embodied.render.camera.camera_at; it looks along its -z, with y up."""
    i = wp.tid()
    cy, sy, cp, sp = wp.cos(yaws[i]), wp.sin(yaws[i]), wp.cos(pitches[i]), wp.sin(pitches[i])
    xpos[i, 0] = positions[i]
    xmat[i, 0] = wp.mat33(sy, -cy * sp, -cy * cp, -cy, -sy * sp, -sy * cp, 0.0, cp, -sp)


@wp.func
def _channel(packed: wp.uint32, shift: int) -> float:
    return float((packed >> wp.uint32(shift)) & wp.uint32(255))


@wp.kernel
def _finish(
    rgb: wp.array2d[wp.uint32],
    behind: wp.array2d[wp.uint32],
    depth: wp.array2d[float],
    seg: wp.array2d[wp.vec2i],
    opacities: wp.array[float],
    owned: wp.array[int],
    width: int,
    colours: bool,
    through: bool,
    rest: bool,
    rgb_out: wp.array4d[wp.uint8],
    depth_out: wp.array3d[float],
    ids_out: wp.array3d[int],
) -> None:
    """Bytes of packed colours, with what stands behind glass; depth and owners of what was met."""
    i, row, column = wp.tid()
    pixel = row * width + column
    geom = seg[i, pixel][0]
    if colours:
        share = wp.where(through and geom >= 0, opacities[wp.max(geom, 0)], 1.0)
        for c in range(3):
            value = _channel(rgb[i, pixel], 16 - 8 * c)
            if share < 1.0:
                value = share * value + (1.0 - share) * _channel(behind[i, pixel], 16 - 8 * c)
            rgb_out[i, row, column, c] = wp.uint8(int(value + 0.5))
    if rest:
        owner = wp.where(geom >= 0, owned[wp.max(geom, 0)], 0)
        ids_out[i, row, column] = owner
        depth_out[i, row, column] = wp.where(owner > 0, depth[i, pixel], wp.inf)
