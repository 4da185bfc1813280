"""The one place where JSON and TOML that come from a file are read: strictly, and as the records they should hold.

What is read has the types of its fields, finite numbers, no unknown, missing or repeated fields, and keeps the ranges
of RECORD_RULES. Every failure is a RecordError, which names the file.
"""

import dataclasses
import enum
import functools
import json
import math
import tomllib
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

T = typing.TypeVar("T")
MOST_NESTED = 40
"""Most lists and objects inside each other; nothing here needs ten."""
LARGEST_NUMBER = 1e12
"""No measure of anything here is beyond this; whole numbers, such as seeds, may be."""
MOST_DIGITS = 40
"""Most digits of a whole number."""
TYPE_WORDS = {float: "a number", int: "an integer", str: "a text", bool: "true or false"}
"""Types as people call them."""
RECORD_RULES: dict[type, Callable[[typing.Any], str | None]] = {}
"""Functions that say in words what is wrong with a record whose fields have the right types; None for nothing. Whoever
defines records adds theirs."""


class RecordError(ValueError):
    """JSON that is not what it should be: says what was expected and what came."""


def parse(text: str | bytes, what: str = "a record") -> object:
    """`text` as JSON, strictly: finite numbers, no field twice, not deep, only text that can be written again.

    Raises:
      RecordError: says what was expected.
    """
    try:
        value = json.loads(
            text, object_pairs_hook=_object, parse_constant=_no_number, parse_float=_finite, parse_int=_whole
        )
        _refuse_deep(value)
        if "\\u" in (text if isinstance(text, str) else text.decode()):  # half a pair of surrogates is no text
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except (ValueError, RecursionError) as e:
        start = text[:60].decode(errors="replace") if isinstance(text, bytes) else text[:60]
        raise RecordError(f"expected {what} as JSON, got {start!r} ({e})") from e


def parse_file(path: Path, what: str = "a file") -> object:
    """The content of a JSON file, whatever it is; raises RecordError with the file's name."""
    try:
        return parse(Path(path).read_bytes(), what)
    except RecordError as e:
        raise RecordError(f"{path}: {e}") from e


def read_text(path: Path) -> str:
    """The text of a file, with or without a byte order mark; raises RecordError with file and line if not UTF-8."""
    data = Path(path).read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        line = data[: e.start].count(b"\n") + 1
        raise RecordError(f"{path}:{line}: not UTF-8 ({e.reason}); save it as UTF-8") from e


def read_toml(path: Path) -> dict[str, typing.Any]:
    """The tables of a TOML file, unchecked but for depth; raises RecordError with the file's name."""
    try:
        value = tomllib.loads(read_text(path))
        _refuse_deep(value)
        return value
    except RecordError:
        raise
    except (ValueError, RecursionError) as e:
        raise RecordError(f"{path}: expected TOML ({e})") from e


def read_json(path: Path) -> dict[str, typing.Any]:
    """The object of a JSON file, its fields unchecked.

    Raises:
      RecordError: names the file.
    """
    value = parse_file(path)
    if not isinstance(value, dict):
        raise RecordError(f"{path} should hold one JSON object, got {shown(value)}")
    return value


def load_json(path: Path, kind: type[T]) -> T:
    """The record of a JSON file; `kind` may be a tuple of records, too.

    Raises:
      RecordError: names the file.
    """
    try:
        return from_plain(kind, parse(Path(path).read_bytes(), f"a {_name(kind)}"))
    except RecordError as e:
        raise RecordError(f"{path}: {e}") from e


def from_json(kind: type[T], text: str | bytes) -> T:
    """The record that a line of JSON describes.

    Raises:
      RecordError: not JSON, or not such a record; says where.
    """
    return from_plain(kind, parse(text, f"a {_name(kind)}"))


def from_plain(kind: type[T], value: object, where: str | None = None) -> T:
    """The record of type `kind` that `value`, as JSON gives it, describes.

    Raises:
      RecordError: it is none; says which field, what was expected and what came.
    """
    return _build(kind, value, where or _name(kind))


def shown(value: object) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an int of thousands of digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def _name(kind: typing.Any) -> str:
    return kind.__name__ if isinstance(kind, type) else str(kind)


def _object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    value = dict(pairs)
    if len(value) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the field {next(n for n in names if names.count(n) > 1)!r} stands there twice")
    return value


def _no_number(text: str) -> typing.NoReturn:
    raise ValueError(f"{text} is no JSON")


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError(f"{text[:20]} is too large")
    return value


def _whole(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _refuse_deep(value: object) -> None:
    level = [value]
    for _ in range(MOST_NESTED):
        level = [
            child for v in level if isinstance(v, (dict, list)) for child in (v.values() if isinstance(v, dict) else v)
        ]
        if not level:
            return
    raise ValueError(f"lists and objects are nested more than {MOST_NESTED} deep")


_hints = functools.cache(typing.get_type_hints)


def _build(kind: typing.Any, value: object, where: str) -> typing.Any:
    if kind in TYPE_WORDS:
        return _build_plain(kind, value, where)
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind in (object, typing.Any):
        return value
    if origin in (types.UnionType, typing.Union):
        return _build_choice(args, value, where)
    if origin is tuple:
        return _build_tuple(args, value, where)
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise RecordError(f"{where} should be an object, got {shown(value)}")
        return {k: _build(args[1], v, f"{where}.{k}") for k, v in value.items()}
    if kind is np.ndarray:
        return _build_array(value, where)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        try:
            return kind(value)
        except ValueError as e:
            raise RecordError(f"{where} should be one of {[m.value for m in kind]}, got {shown(value)}") from e
    if dataclasses.is_dataclass(kind):
        return _build_record(typing.cast(type, kind), value, where)
    return _build_plain(kind, value, where)


def _build_plain(kind: typing.Any, value: typing.Any, where: str) -> typing.Any:
    if kind is float and type(value) in (int, float):
        if not abs(value) <= LARGEST_NUMBER:  # NaN too
            raise RecordError(f"{where} should be a finite number of at most {LARGEST_NUMBER:g}, got {shown(value)}")
        value = float(value)
    if type(value) is not kind:
        raise RecordError(f"{where} should be {TYPE_WORDS.get(kind) or _name(kind)}, got {shown(value)}")
    return value


def _build_tuple(args: tuple[typing.Any, ...], value: object, where: str) -> tuple:
    if not isinstance(value, list):
        raise RecordError(f"{where} should be a list, got {shown(value)}")
    kinds = args[:1] * len(value) if len(args) == 2 and args[1] is Ellipsis else args
    if len(kinds) != len(value):
        raise RecordError(f"{where} should be a list of {len(kinds)}, got {shown(value)}")
    return tuple(_build(k, v, f"{where}[{i}]") for i, (k, v) in enumerate(zip(kinds, value, strict=True)))


def _build_array(value: object, where: str) -> np.ndarray:
    try:
        array = np.array(value, dtype=np.float32)
    except (ValueError, TypeError, OverflowError) as e:
        raise RecordError(f"{where} should be an array of numbers, got {shown(value)}") from e
    if not isinstance(value, list) or not np.isfinite(array).all():
        raise RecordError(f"{where} should be an array of finite numbers, got {shown(value)}")
    return array


def _build_choice(args: tuple[typing.Any, ...], value: object, where: str) -> typing.Any:
    if value is None and type(None) in args:
        return None
    some = [a for a in args if a is not type(None)]
    records: list[type] = [a for a in some if isinstance(a, type) and dataclasses.is_dataclass(a)]
    if len(records) < 2:
        fits = [a for a in some if type(value) is a or (a is float and type(value) is int)]
        return _build((fits or some)[0], value, where)
    named = value.get("is") if isinstance(value, dict) else None
    for a in records:
        if a.__name__ == named:
            return _build(a, value, where)
    raise RecordError(f"{where} should be one of {[a.__name__ for a in records]} by its 'is', got {shown(value)}")


def _build_record(kind: type, value: object, where: str) -> typing.Any:
    if not isinstance(value, dict):
        raise RecordError(f"{where} should be an object, got {shown(value)}")
    names = {f.name: f for f in dataclasses.fields(kind)}
    if isinstance(value.get("id"), str):
        where = f"{where} ({shown(value['id'])})"
    unknown = sorted(set(value) - set(names) - {"is"})
    missing = sorted(
        n
        for n, f in names.items()
        if n not in value and f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
    )
    if unknown or missing:
        faults = [f"lacks the fields {missing}"] * bool(missing) + [f"has the unknown fields {unknown}"] * bool(unknown)
        raise RecordError(f"{where} {' and '.join(faults)}; it may hold {list(names)}")
    if "is" in value and value["is"] != kind.__name__:
        raise RecordError(f"{where} should be a {kind.__name__}, it says that it is {shown(value['is'])}")
    hints = _hints(kind)
    try:
        record = kind(**{n: _build(hints[n], value[n], f"{where}.{n}") for n in names if n in value})
    except RecordError:
        raise
    except ValueError as e:  # of a record that checks itself
        raise RecordError(f"{where}: {e}") from e
    if kind in RECORD_RULES and (wrong := RECORD_RULES[kind](record)):
        raise RecordError(f"{where}: {wrong}")
    return record
