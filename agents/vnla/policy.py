"""VnlaPolicy: the networks as a Policy of embodied.interface, batched over episodes.

A step has two passes, as in the program: one considers whether to ask, and nothing of it is kept; the other acts, with
the text that is there after asking. Asking is an action of its own, so the second pass may belong to the next call.
"""

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.action_spaces import WORDS
from embodied.agents.common.imitation import Supervised
from embodied.agents.common.tensors import Chooser, RunningRows, choose_greedily, choose_sampled
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.find.policy import WORDS as REQUEST
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vnla import network as networks
from embodied.interface import (
    TURNS,
    Actions,
    Ask,
    Mode,
    Move,
    Observation,
    Observations,
    Rngs,
    Situation,
    Situations,
    Stop,
    Thought,
)
from embodied.policies.baselines import asking_times
from embodied.teachers.vnla import VnlaTeacher, ask_reason

SURE = 0.6
"""Chance from which on it stops in evaluation."""
UNDOES = {1: 2, 2: 1, 3: 4, 4: 3}
"""Number of the move of WORDS that undoes another."""


@dataclass(frozen=True, eq=False)
class VnlaMoment:
    """Outputs of the networks in one call, for the episodes that were asked, and the teacher's labels."""

    asks: Tensor
    """(m, 2) logits of the episodes that could ask."""
    ask_labels: Tensor
    """(m,) int64."""
    moves: Tensor
    """(n, 6) logits of the episodes that acted."""
    move_labels: Tensor
    """(n,) int64."""


@dataclass(frozen=True, eq=False)
class VnlaMemory(RunningRows):
    """The policy's state between steps; rows belong to the episodes that still run."""

    state: Tensor
    """(k, 2, h) of the decoder."""
    text: networks.ReadText
    previous_move: Tensor
    """(k,) int64."""
    previous_ask: Tensor
    """(k,) int64."""
    before: tuple[Observation | None, ...]
    """The last view of each, from which the executed action is inferred; None before, and after asking."""
    times: tuple[frozenset[int], ...]
    """When the asker 'random' asks."""
    request: Tensor
    """(k, L) int64 words of the request."""
    read: Tensor
    """(k, READ) what was read of this place."""
    came: Tensor
    """(k,) int64 turn that leads back where it came from; -1 for none."""


@dataclass(frozen=True, eq=False)
class VnlaPolicy:
    """A trained (or training) network that acts, and asks by a rule that needs no privilege."""

    network: networks.VnlaNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    asker: str = "learned"
    """'learned', 'none' or 'first'; 'random' and 'teacher' need to be shown the situations (Supervised)."""
    ask_threshold: float = 0.5
    choose: Chooser = choose_greedily
    instruction_length: int = 50

    def act(self, observations: Observations, memory: VnlaMemory | None, *, rngs: Rngs) -> tuple[Actions, VnlaMemory]:
        """One step of every running episode; see embodied.interface.Policy."""
        return self.play(observations, [None] * len(observations), memory, rngs=rngs)

    def play(
        self,
        observations: Observations,
        situations: Situations,
        memory: VnlaMemory | None,
        *,
        rngs: Rngs,
        as_teacher: bool = False,
        teacher: VnlaTeacher | None = None,
    ) -> tuple[Actions, VnlaMemory]:
        """One step of every running episode.

        Args:
          situations: of the episodes, for 'random' and for the teacher; None without.
          as_teacher: the learned asker asks when the asking teacher would, as in training.
          teacher: whose labels are kept with what was said, with its gradients.
        """
        running = [(i, o) for i, o in enumerate(observations) if o is not None]
        positions, seen = tuple(i for i, _ in running), [o for _, o in running]
        now = [situations[p] for p in positions]
        memory = self.start(positions, seen, now, rngs) if memory is None else memory.keep(positions)
        actions: Actions = [None] * len(observations)
        if not positions:
            return actions, memory
        with torch.set_grad_enabled(teacher is not None and torch.is_grad_enabled()):
            memory = self._listen(memory, seen)
            percept = self._percept(memory, seen)
            able = [row for row, o in enumerate(seen) if o.can_ask]
            thoughts, asks = self._consider(memory, percept, able)
            asking = []
            for row in able:
                place = positions[row]
                if self._wants(seen[row], now[row], thoughts[row], memory.times[row], as_teacher):
                    actions[place] = Ask(seen[row].can_ask[0], thoughts[row])
                    asking.append(row)
            acting = [row for row in range(len(seen)) if row not in asking]
            memory, moves = self._navigate(memory, percept, seen, acting)
        chances = moves.detach().softmax(-1).cpu().numpy()  # (n, 6)
        for chance, row in zip(chances, acting, strict=True):
            place = positions[row]
            asked = thoughts[row].asks if row in thoughts else None
            if teacher is None:
                chance = _decided(chance, None if memory.before[row] is None else int(memory.previous_move[row]))
            number, thought = self.choose(chance, rngs[place]), Thought(chance, asked)
            actions[place] = Stop(thought) if number == networks.STOP else Move(number, thought)
        if teacher is not None:
            moment = _moment(teacher, now, thoughts, asks, able, moves, acting)
            memory = dataclasses.replace(memory, moments=(*memory.moments, moment))
        rows_asking = torch.tensor(asking, dtype=torch.long, device=moves.device)
        before = tuple(None if row in asking else o for row, o in enumerate(seen))  # who moved will see what came of it
        previous_ask = memory.previous_ask.index_fill(0, rows_asking, networks.ASK)
        return actions, dataclasses.replace(memory, previous_ask=previous_ask, before=before)

    def _wants(
        self, o: Observation, s: Situation | None, thought: Thought, times: frozenset[int], as_teacher: bool
    ) -> bool:
        """True to ask now, where that is possible."""
        if self.asker == "random":
            return o.time in times
        if as_teacher and s is not None and self.asker in ("teacher", "learned"):
            return ask_reason(s, thought) is not None
        return self.asker == "first" or (self.asker == "learned" and (thought.asks or {})["help"] > self.ask_threshold)

    def start(
        self, positions: tuple[int, ...], seen: Sequence[Observation], situations: Situations, rngs: Rngs
    ) -> VnlaMemory:
        """Memory before the first step of the episodes at `positions`."""
        k, device = len(positions), next(self.network.parameters()).device
        return VnlaMemory(
            positions=positions,
            state=torch.zeros(k, 2, self.network.hidden_size, device=device),
            text=self.network.blank(k),
            previous_move=torch.full((k,), networks.NO_MOVE, device=device),
            previous_ask=torch.full((k,), networks.NO_ASK, device=device),
            before=(None,) * k,
            times=asking_times(self.asker, situations, [rngs[p] for p in positions]),
            request=torch.from_numpy(self.vocabulary.batch([o.instruction for o in seen], REQUEST)).to(device),
            read=torch.zeros(k, networks.READ, device=device),
            came=torch.full((k,), -1, device=device),
        )

    def _listen(self, memory: VnlaMemory, seen: Sequence[Observation]) -> VnlaMemory:
        """Read the texts that are new, and notice what was carried out: an advisor may have acted in its place."""
        device = memory.previous_move.device
        new = [row for row, o in enumerate(seen) if o.time_on_task == 0]
        text = memory.text
        if new:
            say = lambda row: self.vocabulary.encode(seen[row].instruction, self.instruction_length, backwards=True)
            tokens = torch.from_numpy(np.stack([say(row) for row in new])).to(device)  # backwards, as in the program
            text = text.put(torch.tensor(new, device=device), self.network.read(tokens))
        done = [
            int(kept) if b is None else carried_out(b, o)
            for b, o, kept in zip(memory.before, seen, memory.previous_move.tolist(), strict=True)
        ]
        new = [row for row, o in enumerate(seen) if o.moved or o.time == 0]
        rows, read, came = torch.tensor(new, dtype=torch.long, device=device), memory.read, memory.came
        if new:
            around = self.bank.gather([seen[row].sight for row in new]).float()  # (n, 36, D)
            read = read.index_copy(0, rows, self.network.looker.read(around, memory.request[rows]))
            back = [(seen[row].turn + TURNS // 2) % TURNS if seen[row].moved else -1 for row in new]
            came = came.index_copy(0, rows, torch.tensor(back, device=device))
        previous = torch.tensor(done, device=device)
        return dataclasses.replace(memory, text=text, previous_move=previous, read=read, came=came)

    def _percept(self, memory: VnlaMemory, seen: Sequence[Observation]) -> networks.VnlaPercept:
        device = memory.previous_move.device
        turns = torch.tensor([o.turn for o in seen], device=device)
        allowed = torch.from_numpy(np.stack([o.candidates.allowed for o in seen])).to(device)
        left = [networks.MOST_LEFT if o.requests_left is None else o.requests_left for o in seen]
        return networks.VnlaPercept(
            reading=networks.turned(memory.read, turns, memory.came, allowed[:, 0]),
            previous_move=memory.previous_move,
            previous_ask=memory.previous_ask,
            left=torch.tensor(left, device=device),
            allowed=F.pad(allowed, (0, 1), value=True),  # stopping is always possible
        )

    def _consider(
        self, memory: VnlaMemory, percept: networks.VnlaPercept, rows: Sequence[int]
    ) -> tuple[dict[int, Thought], Tensor]:
        """The first pass: what each of `rows` was about to do and whether it would ask, and logits (m, 2)."""
        if not rows:
            return {}, percept.reading.new_zeros(0, 2)
        state, text = memory.state, memory.text
        if len(rows) < len(memory.positions):
            index = torch.tensor(rows, device=percept.reading.device)
            percept, state, text = percept.select(index), state[index], text.select(index)
        moves, asks = self.network.consider(percept, state, text)
        chances, help_ = moves.cpu().numpy(), asks.detach().softmax(-1)[:, networks.ASK].tolist()
        thoughts = {
            row: Thought(chance, {"help": h, "nothing": 1 - h})
            for row, chance, h in zip(rows, chances, help_, strict=True)
        }
        return thoughts, asks

    def _navigate(
        self, memory: VnlaMemory, percept: networks.VnlaPercept, seen: Sequence[Observation], rows: Sequence[int]
    ) -> tuple[VnlaMemory, Tensor]:
        """The second pass: memory after it and logits (n, 6)."""
        if not rows:
            return memory, percept.reading.new_zeros(0, networks.STOP + 1)
        device = percept.reading.device
        index = torch.tensor(rows, device=device)
        acts = torch.zeros(len(seen), dtype=torch.bool, device=device).index_fill(0, index, True)
        just_asked = [b is None and not o.can_ask for b, o in zip(memory.before, seen, strict=True)]
        just_told = torch.tensor(just_asked, device=device) & (percept.previous_ask == networks.ASK)
        asked = torch.where(acts, torch.where(just_told, networks.ASK, networks.DONT), percept.previous_ask)
        now = dataclasses.replace(percept, previous_ask=asked)
        moves, state, _ = self.network.navigate(now, memory.state, memory.text)
        state = state.where(acts[:, None, None], memory.state)  # who asks acts later
        return dataclasses.replace(memory, state=state, previous_ask=asked), moves[index]


def for_training(policy: VnlaPolicy, teacher: VnlaTeacher) -> Supervised:
    """The networks as they learn: moves are sampled, the learned asker asks when its teacher would."""
    return Supervised(dataclasses.replace(policy, choose=choose_sampled), {"as_teacher": True, "teacher": teacher})


def carried_out(before: Observation, now: Observation) -> int:
    """The action that led from one observation to the next, as an agent knows it itself; stop where it stood still."""
    if now.moved:
        return WORDS.index("forward")
    if now.turn != before.turn:
        return WORDS.index("left" if (now.turn - before.turn) % TURNS == 1 else "right")
    if now.tilt != before.tilt:
        return WORDS.index("up" if now.tilt > before.tilt else "down")
    return networks.STOP


def _arrived(s: Situation) -> bool:
    """True where to stop is to succeed: the program's teacher goes on to the goal's node (docs/sources.md, S191)."""
    near = np.asarray(s.world.graph.distance)[s.pose.node, list(s.targets)].min() <= s.task.radius
    return bool(near) and s.mode is Mode.MAIN


def _decided(chances: np.ndarray, previous: int | None) -> np.ndarray:
    """(6,) chances of moves in evaluation: none undoes the move before it, and who is unsure does not stop; greedy
    decoding would turn to and fro (docs/sources.md, S193)."""
    kept = chances.copy()
    if previous in UNDOES:
        kept[UNDOES[previous]] = 0
    if chances[networks.STOP] < SURE:
        kept[networks.STOP] = 0
    return kept / kept.sum() if kept.any() else chances


def _moment(
    teacher: VnlaTeacher,
    situations: Situations,
    thoughts: dict[int, Thought],
    asks: Tensor,
    able: Sequence[int],
    moves: Tensor,
    acting: Sequence[int],
) -> VnlaMoment:
    """Decisions beside the teacher's: whether to ask by the first pass, where to go by the second."""
    there = [s for s in situations if s is not None]
    assert len(there) == len(situations), "a teacher sees situations"
    wished = [int(ask_reason(there[row], thoughts[row]) is not None) for row in able]
    wanted = [
        networks.STOP if _arrived(s := there[row]) or isinstance(a := teacher.reference(s), Stop) else a.candidate
        for row in acting
    ]
    whole = functools.partial(torch.tensor, dtype=torch.long, device=moves.device)
    return VnlaMoment(asks, whole(wished), moves, whole(wanted))
