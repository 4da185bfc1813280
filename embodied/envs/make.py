"""Which environment and assistant belong to which kind of task."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.advisor import Advisor
from embodied.assistants.anna import Anna
from embodied.assistants.ask import AskAssistant
from embodied.assistants.descriptions import Describer, frequent_classes
from embodied.assistants.hari import HariAssistant, Uncooperative
from embodied.envs.ask import AskEnv, AskSettings
from embodied.envs.base import HelpEnv
from embodied.envs.hanna import HannaEnv
from embodied.envs.hari import AS_PRINTED, HariEnv, HariRules
from embodied.envs.vnla import RULES, check_rules, fitted
from embodied.interface import Assistant, Language, Place, Route, Task
from embodied.language.plain import PlainLanguage
from embodied.teachers.vnla import VnlaTeacher

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import Placement
    from embodied.tasks.ask import Look

ASK_SETTINGS = AskSettings()
AS_PUBLISHED = "indirect"
"""VNLA as its program plays it: help is put into words."""


def environment_maker(
    kind: str,
    worlds: Mapping[str, Place],
    *,
    routes: Mapping[str, Sequence[Route]] | None = None,
    wording: str = "test",
    describer: Describer | None = None,
    language: Language | None = None,
    hari: HariRules = AS_PRINTED,
    vnla: str = AS_PUBLISHED,
    assistant: Assistant | None = None,
) -> Callable[[], HelpEnv]:
    """A maker of environments for a kind of task; all it makes share assistant and caches.

    Args:
      routes: HANNA's, by world; `wording` is the split of them that is spoken.
      describer: HARI's; frequent objects are counted over `worlds` where not given.
      language: of VNLA's advisor.
      hari: variants of HARI.
      vnla: one of embodied.envs.vnla.RULES.
      assistant: who answers, instead of the kind's own assistant.

    Raises:
      ValueError: an unknown kind or rule of play, a rule of VNLA for another kind, or an assistant where nobody is
        asked.
    """
    refuse_rules(kind, vnla, hari)
    if kind in ("find", "vln"):
        if assistant is not None:
            raise ValueError(f"nobody is asked in tasks of kind {kind!r}; give an assistant to vnla, hanna or hari")
        moves = PanoramicMoves()
        return lambda: HelpEnv(worlds, moves=moves)
    if kind == "hanna":
        anna = assistant or Anna({name: w.graph for name, w in worlds.items()}, routes or {}, split=wording)
        moves = PanoramicMoves()
        return lambda: HannaEnv(worlds, anna, moves)
    if kind == "vnla":
        teacher, rule = VnlaTeacher(), RULES[vnla]
        advisor = assistant or Advisor(teacher, language or PlainLanguage())
        return lambda: rule(worlds, advisor, teacher.moves)
    if kind == "hari":
        say = describer or Describer(frequent_classes(worlds.values(), hari.kept))
        willing = HariAssistant(say, stack=hari.stack, longest=hari.longest)
        asked = assistant or (willing if hari.cooperative else Uncooperative(willing))
        moves = PanoramicMoves()
        return lambda: HariEnv(worlds, asked, say, costs=hari.costs, moves=moves)
    if kind == "ask":
        catalogues = (getattr(w, "catalogue", None) for w in worlds.values())
        return ask_environment_maker(worlds, look_of(next(catalogues, None)), assistant=assistant)
    raise ValueError(f"unknown kind of task {kind!r}")


def ask_environment_maker(
    worlds: Mapping[str, Place], look: Look, rules: AskSettings = ASK_SETTINGS, assistant: Assistant | None = None
) -> Callable[[], HelpEnv]:
    """A maker of Ask-v0's environments.

    Args:
      look: words of colour and material of things.
      assistant: who answers, instead of AskAssistant.
    """
    answering, moves, describer = assistant or AskAssistant(look), PanoramicMoves(), Describer(())
    return lambda: AskEnv(worlds, answering, moves, rules, describer)


def look_of(catalogue: Catalogue | None) -> Look:
    """The first word of colour and of material that a catalogue has for a thing; none without a catalogue."""
    assets = {} if catalogue is None else catalogue.assets

    def look(p: Placement) -> tuple[str, ...]:
        asset = assets.get(p.asset)
        return () if asset is None else (*asset.colours[:1], *asset.materials[:1])

    return look


def assistant_of(named: Assistant | str | None) -> Assistant | None:
    """An assistant as it is, or made by what 'module:Class' names, without arguments.

    Raises:
      ValueError: no such class, or what it makes is no Assistant.
    """
    if not isinstance(named, str):
        return named
    found = made_by_name(named)
    if not (hasattr(found, "intentions") and hasattr(found, "answer")):
        raise ValueError(f"{named!r} is no Assistant; it needs intentions() and answer() (embodied/interface.py)")
    return found


def made_by_name(name: str) -> Any:
    """What the class that 'module:Class' names makes, without arguments.

    Raises:
      ValueError: no such module or class.
    """
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError, ValueError) as e:
        raise ValueError(f"expected 'module:Class' with an importable module, got {name!r} ({e})") from e


def refuse_rules(kind: str, vnla: str, hari: HariRules = AS_PRINTED) -> None:
    """Raises ValueError for an unknown rule of VNLA, or variants of VNLA or HARI for another kind of task."""
    check_rules(vnla)
    if kind != "hari" and hari != AS_PRINTED:
        raise ValueError(f"{hari} are HARI's, these tasks are of kind {kind!r}; leave them out")
    if kind != "vnla" and vnla != AS_PUBLISHED:
        raise ValueError(f"rules {vnla!r} are VNLA's, these tasks are of kind {kind!r}; leave the rules out")


def tasks_under(
    kind: str, tasks: Sequence[Task], worlds: Mapping[str, Place], vnla: str, hari: HariRules = AS_PRINTED
) -> tuple[Task, ...]:
    """The tasks with time enough under a rule of VNLA, or with HARI's horizon; else as they are."""
    if kind == "hari" and hari.horizon is not None:
        return tuple(dataclasses.replace(t, horizon=hari.horizon) for t in tasks)
    if kind != "vnla" or vnla == AS_PUBLISHED:
        return tuple(tasks)
    return tuple(fitted(t, vnla) for t in tasks)
