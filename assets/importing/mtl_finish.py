"""Imported materials as a physically based renderer needs them: guesses from names and numbers."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np

from embodied.assets.importing.obj import MtlMaterial
from embodied.assets.json_file import read_toml
from embodied.assets.records import Finish

MIRROR = re.compile(r"mirror|espejo|miroir|spiegel|reflejo", re.IGNORECASE)
METAL_NAMES = re.compile(
    r"metal|chrom|steel|inox|alumin|\balu\b|brass|bronze|copper|gold|silver|iron|nickel|acero|laton|hierro|"
    r"cromo|zinc|platin",
    re.IGNORECASE,
)
CLOTH = re.compile(
    r"cloth|fabric|tissu|tela|textil|cushion|pillow|almohad|coj[ií]n|sheet|sabana|blanket|towel|toalla|carpet|"
    r"wool|cotton|mattress|colch|coussin|drap|matelas|rug|felt|velvet|shirt|pants|jean|hair|skin|curtain",
    re.IGNORECASE,
)
GLASS_NAMES = re.compile(r"glass|vidrio|cristal|verre|glas\b|crystal", re.IGNORECASE)
SHINY = re.compile(r"ceramic|porcelain|enamel|lacquer|varnish|gloss|plastic|acryl|leather|cuero|cuir", re.IGNORECASE)
WHITEST = 0.92
"""Largest sRGB value kept: white paint reflects about 0.83 of the light, never all of it."""


def finish_of(material: MtlMaterial, has_texture: bool) -> Finish:
    """The Finish of an MTL material, its texture apart.

    Roughness follows Blinn-Phong's exponent n by alpha = sqrt(2 / (n + 2)) (Walter et al. 2007,
    section 5.2: Phong lobes match a Beckmann lobe of that width), faded to matt where Ks is dark;
    exporters' default of Ns 96, Ks 0.5 thereby comes out as satin.
    """
    name = material.name
    color = np.minimum(np.array(material.diffuse), WHITEST)
    strength = float(max(material.specular)) if material.illum >= 2 else 0.0
    lobe = float(np.sqrt(np.sqrt(2.0 / (max(material.shininess, 0.0) + 2.0))))
    roughness = float(np.clip(0.88 + min(1.0, strength) * (lobe - 0.88), 0.12, 0.95))
    specular, metallic, alpha = 0.5, 0.0, material.opacity
    if MIRROR.search(name) and not has_texture:
        return Finish((0.9, 0.9, 0.9, 1.0), roughness=0.03, metallic=1.0, mirror=True)
    if CLOTH.search(name):
        roughness, specular = max(roughness, 0.9), 0.1
    elif METAL_NAMES.search(name) and not has_texture:
        if color.max() > 0.3:
            metallic, roughness = 1.0, min(max(roughness, 0.2), 0.4)
            color = np.maximum(color, 0.45 * color / color.max())
        else:
            roughness = min(roughness, 0.45)
    elif alpha < 0.95 and not has_texture:
        roughness, alpha = min(roughness, 0.08), max(alpha, 0.12)
        if GLASS_NAMES.search(name):
            alpha = min(alpha, 0.35)
    elif SHINY.search(name):
        roughness = min(roughness, 0.4)
    roughness = roughness if material.roughness is None else material.roughness
    metallic = metallic if material.metallic is None else material.metallic
    red, green, blue = (round(float(c), 4) for c in color)
    return Finish(
        (red, green, blue, round(max(alpha, 0.1), 3)),
        roughness=round(roughness, 3),
        metallic=metallic,
        specular=specular,
    )


LOOK_WORDS = {
    word: {name: tuple(value) if name == "color" else value for name, value in row.items()}
    for word, row in read_toml(Path(__file__).with_name("looks.toml")).items()
}
"""Words by which a reviewer corrects a material in catalogue.json."""


def corrected(finish: Finish, look: str) -> tuple[Finish, bool]:
    """`finish` after a reviewer's words, and whether its texture stays.

    Args:
      look: words of LOOK_WORDS, '#rrggbb' (sRGB; drops the texture), 'alpha=0.3', in any order.

    Raises:
      ValueError: an unknown word.
    """
    keep = True
    for word in look.split():
        if word in LOOK_WORDS:
            change = LOOK_WORDS[word]
            keep = keep and "color" not in change
        elif re.fullmatch(r"#[0-9a-fA-F]{6}", word):
            rgb = [int(word[i : i + 2], 16) / 255 for i in (1, 3, 5)]
            change = {"color": (*(round(min(c, WHITEST), 4) for c in rgb), finish.color[3])}
            keep = False
        elif re.fullmatch(r"alpha=(0?\.[0-9]+|[01](\.0*)?)", word):
            change = {"color": (*finish.color[:3], float(word[6:]))}
        else:
            raise ValueError(f"unknown look {word!r}; use {sorted(LOOK_WORDS)}, '#rrggbb' or 'alpha=0.3'")
        finish = dataclasses.replace(finish, **change)
    return finish, keep
