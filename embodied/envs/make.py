"""Which environment and assistant belong to which kind of task."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.advisor import Advisor
from embodied.assistants.anna import Anna
from embodied.assistants.descriptions import Describer, frequent_classes
from embodied.assistants.hari import HariAssistant, Uncooperative
from embodied.envs.base import HelpEnv
from embodied.envs.hanna import HannaEnv
from embodied.envs.hari import AS_PRINTED, HariEnv, HariRules
from embodied.envs.vnla import VnlaEnv
from embodied.interface import Language, Place, Route
from embodied.language.plain import PlainLanguage
from embodied.teachers.vnla import VnlaTeacher


def environment_maker(
    kind: str,
    worlds: Mapping[str, Place],
    *,
    routes: Mapping[str, Sequence[Route]] | None = None,
    wording: str = "test",
    describer: Describer | None = None,
    language: Language | None = None,
    hari: HariRules = AS_PRINTED,
) -> Callable[[], HelpEnv]:
    """A maker of environments for a kind of task; all it makes share assistant and caches.

    Args:
      routes: HANNA's, by world; `wording` is the split of them that is spoken.
      describer: HARI's; frequent objects are counted over `worlds` where not given.
      language: of VNLA's advisor.
      hari: variants of HARI.

    Raises:
      ValueError: an unknown kind.
    """
    if kind in ("find", "vln"):
        moves = PanoramicMoves()
        return lambda: HelpEnv(worlds, moves=moves)
    if kind == "hanna":
        anna = Anna({name: w.graph for name, w in worlds.items()}, routes or {}, split=wording)
        moves = PanoramicMoves()
        return lambda: HannaEnv(worlds, anna, moves)
    if kind == "vnla":
        teacher = VnlaTeacher()
        advisor = Advisor(teacher, language or PlainLanguage())
        return lambda: VnlaEnv(worlds, advisor, teacher.moves)
    if kind == "hari":
        say = describer or Describer(frequent_classes(worlds.values()))
        willing = HariAssistant(say, stack=hari.stack, longest=hari.longest)
        assistant = willing if hari.cooperative else Uncooperative(willing)
        moves = PanoramicMoves()
        return lambda: HariEnv(worlds, assistant, say, costs=hari.costs, moves=moves, dense_states=hari.dense_states)
    raise ValueError(f"unknown kind of task {kind!r}")
