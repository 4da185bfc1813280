"""Weights on disk, one format for all that is trained: tensors, what is needed to use them, and what they came from, in
one .safetensors file that notices when a byte of it was changed.

The one checkpoint format: what decides how a run goes on, with the identity of the run, refused if it is another's. A
checkpoint is a PyTorch file of tensors, numbers and texts; nothing is unpickled.
"""

import hashlib
import io
import json
import struct
import zipfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

import safetensors
import safetensors.torch
import torch
from torch import Tensor, nn

from embodied.assets.cache import write_bytes
from embodied.records import CODE, MAKERS, Identity, differences, from_plain, parse, to_json

CHECKSUM = "checksum"
"""Name of the entry that holds `checksum_of` all else."""


def save_tensors(path: Path, tensors: Mapping[str, Tensor], about: Mapping[str, str]) -> None:
    """Write `tensors` and what they are, atomically.

    Raises:
      OSError: the disk is full, ...; names `path`.
    """
    whole = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    metadata = {**about, CHECKSUM: checksum_of(whole, about)}
    write_bytes(Path(path), _sorted(safetensors.torch.save(whole, metadata=metadata)))


def _sorted(file: bytes) -> bytes:
    """A .safetensors file with its metadata in order, so that equal tensors are equal files."""
    (size,) = struct.unpack("<Q", file[:8])
    header = json.loads(file[8 : 8 + size])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + file[8 + size :]


def load_tensors(path: Path, form: str, remedy: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """The contents that `save_tensors` wrote.

    Args:
      form: which about["format"] can be read.
      remedy: how such a file is made, for messages.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, of another format, or changed since it was written.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; name another file, or {remedy}")
    tensors = read_weights(path)
    with safetensors.safe_open(path, "pt") as f:
        about = dict(f.metadata() or {})
    if about.get("format") != form:
        raise ValueError(f"{path}: format {about.get('format')!r}, this version reads {form!r}; {remedy}")
    if about.pop(CHECKSUM, None) != checksum_of(tensors, about):
        raise ValueError(f"{path}: its contents do not fit its checksum, somebody or something changed it; {remedy}")
    return tensors, about


def read_weights(path: Path) -> dict[str, Tensor]:
    """Tensors of a .safetensors file.

    Raises:
      ValueError: the file is truncated, or of another kind.
    """
    try:
        return safetensors.torch.load_file(path)
    except safetensors.SafetensorError as e:
        raise ValueError(f"{path}: cannot be read as weights ({e}); train it again") from e


def checksum_of(tensors: Mapping[str, Tensor], about: Mapping[str, str]) -> str:
    """Hex SHA-256 over names, types, shapes and bytes of tensors and over `about`."""
    h = hashlib.sha256(json.dumps(dict(about), sort_keys=True).encode())
    for name, tensor in sorted(tensors.items()):
        h.update(json.dumps([name, str(tensor.dtype), list(tensor.shape)]).encode())
        h.update(tensor.cpu().contiguous().numpy().tobytes())
    return h.hexdigest()


def load_into(network: nn.Module, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Give `network` the weights `tensors`, which were read from `path`.

    Raises:
      ValueError: they are another network's.
    """
    try:
        network.load_state_dict(tensors)
    except RuntimeError as e:
        what = " ".join(str(e).split())
        raise ValueError(f"{path}: these are not the weights of its settings ({what:.200}); make it again") from e


WEIGHTS_FORMAT = "embodied-weights-1"
RETIRED = ("varied_words", "word_vectors", "ask_rules", "asker", "turn_to_agent")
"""Settings of earlier versions that files may hold and that change nothing."""
T = TypeVar("T")


def save_weights(
    path: Path, kind: str, tensors: Mapping[str, Tensor], about: object, identity: Identity | None = None
) -> None:
    """Write weights, atomically; equal weights are equal files.

    Args:
      kind: what it is, 'hanna' or 'encoder'.
      about: a record of what is needed to use them: settings, words, whose features they know.
      identity: what they were trained with.
    """
    body = {"format": WEIGHTS_FORMAT, "kind": kind, "about": to_json(about)}
    save_tensors(path, tensors, body | ({"identity": to_json(identity)} if identity else {}))


def load_weights(path: Path, kind: str, about: type[T], remedy: str) -> tuple[dict[str, Tensor], T]:
    """The contents that `save_weights` wrote: the tensors, and the record of type `about`.

    Args:
      remedy: how such a file is made, for messages.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, of another format or kind.
    """
    tensors, metadata = load_tensors(Path(path), WEIGHTS_FORMAT, remedy)
    if metadata.get("kind") != kind:
        raise ValueError(f"{path}: holds {metadata.get('kind')!r}, {kind!r} is wanted; {remedy}")
    try:
        value = parse(metadata.get("about", ""), f"a {about.__name__}")
        if isinstance(value, dict) and isinstance(config := value.get("config"), dict):
            value["config"] = {name: x for name, x in config.items() if name not in RETIRED}
        return tensors, from_plain(about, value)
    except ValueError as e:
        raise ValueError(f"{path}: {e}; {remedy}") from e


def origin_of(path: Path) -> dict[str, Any] | None:
    """The identity of what a file of weights was trained with; None where that was not written down."""
    text = _read(path)[1].get("identity")
    identity = None if text is None else parse(text, "an identity")
    return identity if isinstance(identity, dict) else None


def weights_digest(path: Path) -> str:
    """Of the weights in a file and of what is needed to use them; not of what they were trained with."""
    tensors, metadata = _read(path)
    return checksum_of(tensors, {k: v for k, v in metadata.items() if k != "identity"})


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """The tensors of a file of weights, and what stands beside them."""
    return load_tensors(Path(path), WEIGHTS_FORMAT, "train it again")


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """PyTorch's draws on the CPU, such as of first weights, follow from `seed` inside, and are as before outside."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


def half_precision(network: nn.Module) -> dict[str, Tensor]:
    """The weights of a network in half precision; whole numbers, such as counters, as they are."""
    return {k: v.half() if v.is_floating_point() else v for k, v in network.state_dict().items()}


def check_features(encoder: str, learned_from: str) -> None:
    """Raises ValueError where features come from another encoder than the one that an agent was trained on."""
    if encoder != learned_from:
        raise ValueError(
            f"the features come from encoder {encoder[:12]}, the agent learned from {learned_from[:12]}; "
            "make features with its encoder (`embodied features --data DATA --encoder FILE`) or train a new agent"
        )


CHECKPOINT_FORMAT = "embodied-checkpoint-3"
FIELDS = ("identity", "progress", "sums", "history", "parts")


class CheckpointError(ValueError):
    """A checkpoint that cannot be continued: says what was expected, what came and what to do."""


class Stateful(Protocol):
    """A network, an optimizer or a schedule."""

    def state_dict(self) -> dict[str, Any]: ...
    def load_state_dict(self, state_dict: Any, /) -> Any: ...


def write_checkpoint(path: Path, body: Mapping[str, object]) -> None:
    """Write the FIELDS of a run atomically; an interruption leaves the checkpoint before it."""
    whole = io.BytesIO()
    torch.save({"format": CHECKPOINT_FORMAT, **body}, whole)
    write_bytes(Path(path), whole.getvalue())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The contents that `write_checkpoint` wrote.

    Raises:
      CheckpointError: truncated, changed, or of another format.
    """
    try:
        with zipfile.ZipFile(path) as z:  # torch does not look at the checksums itself
            if (damaged := z.testzip()) is not None:
                raise ValueError(f"{damaged} does not fit its checksum")
        body = torch.load(path, map_location="cpu", weights_only=True)
    except OSError:
        raise
    except Exception as e:  # a damaged file raises one of half a dozen kinds
        raise CheckpointError(
            f"{path}: cannot be read ({e}); it was changed or cut short, delete it to begin again"
        ) from e
    if not isinstance(body, dict) or body.pop("format", None) != CHECKPOINT_FORMAT or set(body) != set(FIELDS):
        raise CheckpointError(f"{path}: not a checkpoint of format {CHECKPOINT_FORMAT!r}; begin a new run")
    return body


def restore(
    path: Path, identity: Identity, parts: Mapping[str, Stateful], may_change: Collection[str] = ()
) -> dict[str, Any]:
    """Put the checkpoint of a run into its `parts`, and return its FIELDS.

    Args:
      may_change: names of settings that may differ without changing what was learned so far.

    Raises:
      CheckpointError: damaged, of a run of another identity (other code is no reason), or of other parts.
    """
    body = read_checkpoint(path)
    if changed := differences(body["identity"], identity, (*may_change, CODE, MAKERS)):
        raise CheckpointError(
            f"{path}: settings changed since this run began ({', '.join(changed)}); restore them or use another "
            "run folder"
        )
    if set(body["parts"]) != set(parts):
        raise CheckpointError(f"{path}: holds {sorted(body['parts'])}, this run has {sorted(parts)}; begin a new run")
    for name, part in parts.items():
        try:
            part.load_state_dict(body["parts"][name])
        except (RuntimeError, ValueError, KeyError, TypeError) as e:
            what = " ".join(str(e).split())
            raise CheckpointError(f"{path}: {name} is another's ({what:.200}); begin a new run") from e
    return body
