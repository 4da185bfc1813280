"""The code that makes a product: the modules that a module imports, the data beside them, and the libraries they use.

Products that are kept on disk carry `code_digest` of the module that made them in their key, so that none made by
other code is believed. Comments, docstrings and formatting do not count.
"""

import ast
import functools
import importlib.metadata
import re
import sys
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.cache import digest

OURS = "embodied"
"""The package whose modules are followed; all others are libraries."""
ROOT = Path(str(sys.modules[OURS].__file__)).resolve().parent.parent
BESIDE = ("agents", "assets", "viz")
"""Parts of it that lie beside its folder in a clone, and inside it where a wheel installed them."""
INDIFFERENT = frozenset({"tqdm", "joblib", "numba", "OpenGL", "gymnasium", "rerun", "psutil", "mujoco_menagerie"})
"""Libraries that decide no byte of any product: they show, spread, hasten or hand on what others make."""


@dataclass(frozen=True)
class Closure:
    """All that some modules import, themselves included, late imports inside functions too."""

    modules: Mapping[str, Path]
    """Module to its file, sorted."""
    libraries: tuple[str, ...]
    """Top names of what is neither ours nor Python's nor INDIFFERENT, sorted."""


def closure(*makers: str, root: Path = ROOT, without: Collection[str] = ()) -> Closure:
    """The import closure of modules, read from their sources; what is imported for type checkers only is left out.

    Args:
      makers: dotted names of modules.
      root: the folder that holds our package.
      without: modules and libraries that are left out with all that they alone import: those that decide nothing about
        the product, and those of which the product's key holds what they made.

    Raises:
      ModuleNotFoundError: a maker is no module of ours.
    """
    paths: dict[str, Path] = {}
    libraries: set[str] = set()
    known = {OURS, *sys.stdlib_module_names, *without, *INDIFFERENT}
    waiting = list(makers)
    for name in makers:
        if _file_of(name, root) is None:
            raise ModuleNotFoundError(f"{name!r} is no module in {root}", name=name)
    while waiting:
        name = waiting.pop()
        path = _file_of(name, root)
        if name in paths or name in without or path is None:
            continue
        paths[name] = path
        names = _read(path.read_bytes(), name, path.name == "__init__.py").imports
        ours = [n for n in names if n.split(".")[0] == OURS]
        waiting += ours + [n.rpartition(".")[0] for n in (name, *ours) if n.count(".") > 1]  # run before their modules
        libraries.update(n.split(".")[0] for n in names if n.split(".")[0] not in known)
    return Closure(dict(sorted(paths.items())), tuple(sorted(libraries)))


def imported(tree: ast.Module, module: str, *, package: bool) -> Iterator[str]:
    """Dotted names that a module imports when it runs: modules, and what may be modules in packages."""
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and _last_name(node.test) == "TYPE_CHECKING":
            waiting += node.orelse
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, package)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and _last_name(node.func) == "import_module":
            yield from (a.value for a in node.args[:1] if isinstance(a, ast.Constant) and isinstance(a.value, str))


@functools.cache
def code_digest(*makers: str, root: Path = ROOT, without: tuple[str, ...] = ()) -> str:
    """Hex digest of what the import closure of `makers` does: its code, data files beside it, versions of libraries.

    Data files are those in a folder `data` beside a module, and tables (.toml) beside a module that names them.

    Args:
      without: as for `closure`; 'embodied.assets.data' leaves out the data files beside the modules of that package.
    """
    whole = closure(*makers, root=root, without=without)
    read = {name: _read(path.read_bytes(), name, path.name == "__init__.py") for name, path in whole.modules.items()}
    packages = {_package_of(name, path): path.parent for name, path in whole.modules.items()}
    folders = {f"{package}.data": folder / "data" for package, folder in packages.items()}
    data = {f"{n}/{f.name}": f for n, folder in folders.items() if n not in without for f in folder.glob("*")}
    for name, path in whole.modules.items():
        data |= {f"{_package_of(name, path)}/{table}": path.with_name(table) for table in read[name].tables}
    return digest(
        {name: module.digest for name, module in read.items()},
        {name: digest(f) for name, f in sorted(data.items()) if f.is_file()},
        {name: _version(name) for name in whole.libraries},
    )[:16]


@dataclass(frozen=True)
class _Read:
    """Imports, tables and digest of the source of a module."""

    imports: tuple[str, ...]
    tables: frozenset[str]
    """Strings in it that name a .toml file."""
    digest: str
    """Of its syntax tree: the same in all versions of Python."""


@functools.lru_cache(maxsize=1024)
def _read(source: bytes, module: str, package: bool) -> _Read:
    tree = ast.parse(source)
    nodes = ast.walk(tree) if b".toml" in source else ()
    texts = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    tables = frozenset(text for text in texts if re.fullmatch(r"\w+\.toml", text))
    return _Read(tuple(imported(tree, module, package=package)), tables, digest(_described(tree)))


def _last_name(node: ast.expr) -> str:
    """'b' of the expressions b and a.b; '' of others."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _file_of(module: str, root: Path) -> Path | None:
    top, *parts = module.split(".")
    if top != OURS:
        return None
    homes = (root / OURS, root) if parts and parts[0] in BESIDE else (root / OURS,)
    for path in (home.joinpath(*parts) for home in homes):
        for file in (path / "__init__.py", path.with_suffix(".py")):
            if file.is_file():
                return file
    return None


def _package_of(module: str, path: Path) -> str:
    """The dotted name of the package that a module with this file is in, or is."""
    return module if path.name == "__init__.py" else module.rpartition(".")[0]


def _absolute(node: ast.ImportFrom, module: str, package: bool) -> str:
    """The module that `from ... import` names, seen from `module`."""
    if not node.level:
        return node.module or ""
    above = module.split(".")[: None if package and node.level == 1 else (1 if package else 0) - node.level]
    return ".".join([*above, *([node.module] if node.module else [])])


def _described(value: object) -> str:
    """Syntax as text, without docstrings, positions and what is empty, in which versions of Python differ."""
    if isinstance(value, list):
        return f"[{', '.join([_described(part) for part in value if not _is_docstring(part)])}]"
    if not isinstance(value, ast.AST):
        return repr(value)
    if isinstance(value, ast.JoinedStr):
        value = ast.JoinedStr([part for part in value.values if getattr(part, "value", None) != ""])
    parts = [(name, getattr(value, name)) for name in value._fields if name != "ctx"]
    shown = [f"{name}={_described(part)}" for name, part in parts if part is not None and part != []]
    return f"{type(value).__name__}({', '.join(shown)})"


def _is_docstring(node: object) -> bool:
    """True if a statement is text alone, behind a module's, class's, function's or field's head."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


@functools.cache
def _distributions() -> Mapping[str, list[str]]:
    return importlib.metadata.packages_distributions()


def _version(library: str) -> str:
    """Version of the distributions that a top name belongs to, by whatever names; '' where none is installed."""
    names = [name for name in _distributions().get(library, ()) if name]  # None: its metadata are lost
    return " ".join(sorted({importlib.metadata.version(name) or "" for name in names}))
