"""PhotoCamera: what a phone or a robot makes of a picture: exposure, balance, bloom, lens, noise, JPEG.

Pictures of the renderers are those of an ideal camera. A real one measures each view anew, scatters light, darkens
corners, bends lines, adds noise where light lacks, and compresses. What differs from one device to the next is drawn
once (`camera_traits`); what differs from one picture to the next, the noise, is drawn for each. Depth and ids follow
the lens (`PhotoCamera.bent`) and nothing else.
"""

import functools
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.decoding import jpeg
from embodied.assets.json_file import from_plain, read_toml
from embodied.seeds import stream

CAMERAS = ("ideal", "phone", "robot")
"""The renderers' own picture; a phone held by a person; a robot's small camera, which streams."""
MIDDLE = 0.18
"""Linear value that a meter brings the middle of a picture to (Reinhard et al. 2002, sec. 3.1)."""
KNEE, ROOM = 0.7, 0.9
"""Linear value above which renderers' pictures count as compressed, and how far: full white stands for
KNEE + (1 - KNEE) / (1 - ROOM), about two stops more, as in inverse tone mapping (Banterle et al. 2006)."""
BLOOM = ((0.55, 0.006), (0.3, 0.025), (0.15, 0.1))
"""Share and deviation, in heights of the picture, of the Gaussians that scattered light is spread by: a narrow core
and wide skirts stand for the 1/angle^2 of glare (Spencer et al. 1995, eq. 2 to 4)."""
FULL_WELL = 6000.0
"""Electrons of a full pixel at ISO 100: that of small sensors with pixels of 1.4 to 3 um."""


@dataclass(frozen=True)
class CameraTraits:
    """One device. What is drawn, and from where to where, stands in RANGES."""

    metering: float
    """Share of the stops between the view and MIDDLE that exposure takes out: meters that weigh whole scenes leave
    dark rooms darker and bright ones brighter."""
    bias: float
    """Stops that it exposes too much."""
    most: float
    """Most stops that exposure changes, either way: the pictures are exposed for their rooms already."""
    balancing: float
    """Share of a picture's mean colour that white balance takes out (the grey world of Buchsbaum 1980)."""
    warmth: float
    """Logarithm of red over blue that balance is off by."""
    latitude: float
    """How gently highlights end: 0.9 undoes the renderers' own curve, less burns windows out sooner."""
    veil: float
    """Share of the light that the lens scatters: 0.5 % of clean good lenses to 5 % and more of small plastic or greasy
    ones (McCann and Rizzi 2007, veiling glare of cameras)."""
    falloff: float
    """Power of the cosine by which corners darken: 4 is the natural law (Kingslake 1983, ch. 6), phones correct most
    of it."""
    radial: tuple[float, float]
    """k1 and k2 of the lens (Brown 1966; OpenCV's calibration): below zero bends lines outwards."""
    rows: int
    """Rows of the sensor: a smaller picture averages pixels, so that noise falls."""
    iso: float
    """ISO at which white paper of 100 cd/m2 is white."""
    read_noise: float
    """Electrons of deviation without light: 2 to 4 of today's small sensors."""
    jpeg: int
    """Quality of the JPEG that is stored or streamed."""


RANGES = from_plain(dict[str, dict[str, tuple[float, float]]], read_toml(Path(__file__).with_name("cameras.toml")))
"""From where to where the traits of devices of a kind lie; all are drawn evenly."""


def check_camera(name: str) -> str:
    """`name`, if it is one of CAMERAS.

    Raises:
      ValueError: it is not.
    """
    if name not in CAMERAS:
        raise ValueError(f"camera {name!r} is unknown; use one of {CAMERAS}")
    return name


def camera_traits(name: str, *, rng: np.random.Generator) -> CameraTraits | None:
    """A device of the kind `name`; None for the ideal one, which has no traits.

    Raises:
      ValueError: no such kind.
    """
    if check_camera(name) == "ideal":
        return None
    of = {trait: float(rng.uniform(*ends)) for trait, ends in RANGES[name].items()}
    radial = of.pop("k1"), of.pop("k2")
    whole = {trait: round(of.pop(trait)) for trait in ("rows", "jpeg")}
    return CameraTraits(radial=radial, **whole, **of)  # type: ignore[arg-type]


class PhotoCamera:
    """One device, which photographs what renderers draw; the same picture of the same place, every time."""

    def __init__(self, name: str = "ideal", seed: int = 0) -> None:
        """
        Args:
          name: one of CAMERAS.
          seed: which device of that kind, and its noise.

        Raises:
          ValueError: no such kind.
        """
        self.name, self.seed = name, seed
        self.traits = camera_traits(name, rng=stream(seed, "camera", name))

    def photographed(self, rgb: np.ndarray, vfov: float | None, *place: str | int, light: float = 1.0) -> np.ndarray:
        """The photograph of an ideal picture; `rgb` itself from the ideal camera.

        Args:
          rgb: (h, w, 3) uint8 sRGB.
          vfov: vertical field of view, radians; None for pictures of all directions, which no lens takes: they are
            stitched, so that neither corners darken nor lines bend.
          place: whatever tells this picture from others, for the noise.
          light: how much more sensitive the sensor is than in a room where white paper has 100 cd/m2.
        """
        if self.traits is None:
            return rgb
        return photograph(rgb, self.traits, vfov, light=light, rng=stream(self.seed, "camera", self.name, *place))

    def bent(self, channel: np.ndarray, vfov: float | None) -> np.ndarray:
        """Depth or ids (h, w) where the lens puts them; `channel` itself from the ideal camera."""
        if self.traits is None or vfov is None or not any(self.traits.radial):
            return channel
        x, y = lens_map(self.traits.radial, vfov, *channel.shape)
        bits = np.ascontiguousarray(channel).view(np.float32)
        return cv2.remap(bits, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE).view(channel.dtype)


def photograph(
    rgb: np.ndarray, traits: CameraTraits, vfov: float | None, *, rng: np.random.Generator, light: float = 1.0
) -> np.ndarray:
    """(h, w, 3) uint8: what a device makes of an ideal picture; see PhotoCamera.photographed."""
    seen = expanded(rgb)
    if vfov is not None:
        if any(traits.radial):
            x, y = lens_map(traits.radial, vfov, *rgb.shape[:2])
            seen = cv2.remap(seen, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        seen *= corners(traits.falloff, vfov, *rgb.shape[:2])[..., None]
    seen = bloomed(seen, traits.veil)
    gains = exposure(seen, traits) * balance(seen, traits)
    seen = noisy(seen, float(gains[1]), traits, light, rng=rng) * gains
    return compressed(shown(seen, traits.latitude), traits.jpeg)


def expanded(rgb: np.ndarray) -> np.ndarray:
    """(h, w, 3) float32 linear light of a shown picture: what was bent into the last values is straightened."""
    return _light_of_values()[rgb]


def shown(light: np.ndarray, latitude: float) -> np.ndarray:
    """(h, w, 3) uint8 of linear light; with a latitude of ROOM the inverse of `expanded`."""
    over = np.maximum(light - KNEE, 0) / (1 - KNEE)
    y = np.minimum(light, KNEE) + (1 - KNEE) * over / (1 + latitude * over)
    codes = (np.clip(y, 0, 1) * (len(_values_of_light()) - 1) + 0.5).astype(np.uint16)
    return _values_of_light()[codes]


def exposure(light: np.ndarray, traits: CameraTraits) -> float:
    """The gain that the meter chooses: it weighs the middle of the picture more, and logarithms of light.

    Centre-weighted, as in Reinhard et al. 2002 eq. 1 with weights that fall to the edges.
    """
    small = cv2.resize(light, (24, 16), interpolation=cv2.INTER_AREA) @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    y, x = (np.arange(16) - 7.5) / 8, (np.arange(24) - 11.5) / 12
    weight = np.exp(-(y[:, None] ** 2 + x[None] ** 2))
    mean = float(np.exp((np.log(small + 1e-3) * weight).sum() / weight.sum()))
    stops = traits.metering * math.log2(MIDDLE / mean) + traits.bias
    return 2.0 ** float(np.clip(stops, -traits.most, traits.most))


def balance(light: np.ndarray, traits: CameraTraits) -> np.ndarray:
    """(3,) float32 gains that take out some of the mean colour; green's is 1. What is burnt out does not count."""
    flat = light.reshape(-1, 3)
    counted = flat[flat.max(1) < 1.0] if (flat.max(1) < 1.0).mean() > 0.1 else flat
    mean = counted.mean(0) + 1e-3
    gains = (mean[1] / mean) ** traits.balancing * np.exp([traits.warmth / 2, 0.0, -traits.warmth / 2])
    return gains.astype(np.float32)


def bloomed(light: np.ndarray, veil: float) -> np.ndarray:
    """The share `veil` of all light spread around where it fell; no light is lost."""
    h, w = light.shape[:2]
    out = light * (1 - veil)
    for share, width in BLOOM:
        step = max(int(width * h / 2), 1)  # wide skirts are spread in a small picture
        small = cv2.resize(light, (max(w // step, 1), max(h // step, 1)), interpolation=cv2.INTER_AREA)
        spread = cv2.GaussianBlur(small, (0, 0), max(width * h / step, 0.3), borderType=cv2.BORDER_REPLICATE)
        out += veil * share * cv2.resize(spread, (w, h), interpolation=cv2.INTER_LINEAR)
    return out


def noisy(light: np.ndarray, gain: float, traits: CameraTraits, dark: float, *, rng: np.random.Generator) -> np.ndarray:
    """Light with the noise of photons and of reading them out, before the gain is applied to both.

    Deviation sqrt(a x + b), the Poissonian-Gaussian model of Foi et al. 2008 (eq. 2 and 3): with N electrons at full
    white, a = 1 / N and b = (read noise / N)^2.

    Args:
      gain: of exposure; ISO follows it, but not below 100, where exposure is shortened instead.
      dark: how much darker the room is than one where white paper has 100 cd/m2.
    """
    binned = max(traits.rows / light.shape[0], 1.0) ** 2
    iso = max(traits.iso * dark * gain, 100.0)
    electrons = FULL_WELL * 100.0 / iso * gain * binned  # at light = 1; light = 1 / gain is shown as white
    deviation = np.sqrt(np.maximum(light, 0) / electrons + binned * (traits.read_noise / electrons) ** 2)
    grain = rng.standard_normal(light.shape, np.float32)
    return np.maximum(light + deviation.astype(np.float32) * grain, 0)


def compressed(rgb: np.ndarray, quality: int) -> np.ndarray:
    """The picture after JPEG, chroma halved as cameras do."""
    data = jpeg(rgb, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420)
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


@functools.lru_cache(maxsize=16)
def lens_map(radial: tuple[float, float], vfov: float, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of the photograph's pixels in the ideal picture: two (h, w) float32 maps of cv2.remap.

    The lens is zoomed so that nothing is missing: the corners stay where they are when lines bend outwards, the
    nearest edges when they bend inwards.

    Source: Brown 1966; r' = r (1 + k1 r^2 + k2 r^4) with r in focal lengths, solved for r by Newton's method.
    """
    k1, k2 = radial
    focal = height / 2 / math.tan(vfov / 2)
    x, y = (np.arange(width) - (width - 1) / 2) / focal, (np.arange(height) - (height - 1) / 2) / focal
    x, y = np.meshgrid(x, y)
    r = np.hypot(x, y)
    pinned = float(r.max()) if k1 < 0 else float(min(np.abs(x).max(), np.abs(y).max()))
    wanted = r * (1 + k1 * pinned**2 + k2 * pinned**4)
    radius = r.copy()
    for _ in range(8):
        off = radius * (1 + k1 * radius**2 + k2 * radius**4) - wanted
        radius -= off / np.maximum(1 + 3 * k1 * radius**2 + 5 * k2 * radius**4, 0.1)
    scale = radius / np.maximum(r, 1e-9) * focal
    return (
        np.ascontiguousarray(x * scale + (width - 1) / 2, np.float32),
        np.ascontiguousarray(y * scale + (height - 1) / 2, np.float32),
    )


@functools.lru_cache(maxsize=16)
def corners(power: float, vfov: float, height: int, width: int) -> np.ndarray:
    """(h, w) float32: share of the light that reaches each pixel, the cosine of its angle to the axis to `power`."""
    focal = height / 2 / math.tan(vfov / 2)
    x, y = (np.arange(width) - (width - 1) / 2) / focal, (np.arange(height) - (height - 1) / 2) / focal
    return (1 / np.sqrt(1 + x[None] ** 2 + y[:, None] ** 2)).astype(np.float32) ** np.float32(power)


@functools.cache
def _light_of_values() -> np.ndarray:
    """(256,) float32: `expanded` for every value; sRGB decoded by IEC 61966-2-1."""
    v = np.arange(256) / 255
    y = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    over = np.maximum(y - KNEE, 0) / (1 - KNEE)
    return (np.minimum(y, KNEE) + (1 - KNEE) * over / (1 - ROOM * over)).astype(np.float32)


@functools.cache
def _values_of_light() -> np.ndarray:
    """(16384,) uint8 sRGB of linear values from 0 to 1, evenly."""
    y = np.arange(16384) / 16383
    v = np.where(y <= 0.0031308, y * 12.92, 1.055 * y ** (1 / 2.4) - 0.055)
    return (v * 255 + 0.5).astype(np.uint8)
