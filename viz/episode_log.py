"""Facts for a viewer at a step that the step alone does not say, who said what and what is being aimed at; episodes as
text."""

from dataclasses import dataclass
from pathlib import Path

from embodied.assets.json_file import read_toml
from embodied.assistants.descriptions import described
from embodied.interface import Ask, Episode, Intention, Mode, Place, Pose, Reply, Step, Task, Viewpoint
from embodied.kinds.task_kind import kind_named
from embodied.language.plain_language import detokenized
from embodied.records import load_lines

LOOKS = read_toml(Path(__file__).with_name("looks.toml"))
QUESTIONS = {Intention(name): words for name, words in LOOKS["questions"].items()}
DIALOGUE_ROWS, DIALOGUE_COLUMNS = 11, 95
"""Lines of text that there is room for, a gap between two speakers being one, and their letters."""


def question_of(ask: Ask) -> str:
    """A question in words: the agent's own, or those of its intention."""
    return ask.question or QUESTIONS[ask.intention]


class EpisodeLog:
    """The episode so far: dialogue, path, goals, the route spoken about and the image looked for.

    Call `before` when a step is about to be taken and `after` when it was.
    """

    def __init__(self, task: Task, budget: int | None = None) -> None:
        """`budget`: requests that the episode allows; None where they are not counted."""
        self.task, self.budget = task, budget
        self.dialogue = [f"**Requester:** {detokenized(task.request)}"]
        self.nodes = [task.start.node]
        self.goals = [task.goal_nodes[0]]
        """HARI's stack of goals, the top last."""
        self.route: tuple[int, ...] = ()
        """Nodes of the route that the agent was told and has not left."""
        self.image: Viewpoint | None = None
        """The view that the agent looks for: where to leave a route and, after leaving it, the goal (HANNA)."""
        self.count = 0
        self.requests = 0
        self.cost = 0.0
        """Of all steps so far (HARI)."""
        self.last: Step | None = None

    @property
    def left(self) -> int | None:
        """Requests that remain; None where they are not counted."""
        return None if self.budget is None else max(self.budget - self.requests, 0)

    def before(self, step: Step) -> None:
        """Forget what no longer holds at the beginning of `step`."""
        if step.subtask == "none":
            self.route = ()
        while len(self.goals) > 1 and (step.mode is Mode.MAIN or self.goals[-1] not in step.targets):
            self.goals.pop()
        left = self.last is not None and self.last.mode is Mode.SUB and step.mode is Mode.MAIN
        leaving = kind_named(self.task.kind).story.leaving
        if left and leaving:
            self.image = Viewpoint(self.task.world, step.targets[0])
            self.dialogue.append(f"**Agent** (step {self.count}): *{leaving}*")

    def after(self, step: Step) -> None:
        """Take in the action of `step` and the reply to it."""
        if isinstance(step.action, Ask):
            self.requests += 1
            self.dialogue.append(f"**Agent** (step {self.count}): {question_of(step.action)}")
            if step.reply is not None:
                self._heard(step.reply, step.pose)
        elif step.reply is not None:  # nobody asked: a teacher describes what was done (ILIAD)
            self.dialogue.append(f"**Teacher:** {detokenized(step.reply.text or '')}")
        if step.next_pose.node != self.nodes[-1]:
            self.nodes.append(step.next_pose.node)
        self.last = step
        self.cost += step.cost
        self.count += 1

    def _heard(self, reply: Reply, pose: Pose) -> None:
        words = reply.text or described(reply.description or (), pose if reply.intention is Intention.CUR else None)
        self.dialogue.append(f"**Assistant:** {detokenized(words)}")
        self.image = reply.image or self.image
        if reply.subtask is not None:
            self.route = reply.subtask.path
            if reply.intention is Intention.SUB:
                self.goals.append(reply.subtask.target)

    def dialogue_text(self) -> str:
        """The dialogue as Markdown; only its end when it is long, because the viewer does not scroll by itself."""
        height = lambda line: 2 + len(line) // DIALOGUE_COLUMNS
        kept: list[str] = []
        left = DIALOGUE_ROWS + 1 - height(self.dialogue[0])
        for line in reversed(self.dialogue[1:]):
            more = 0 if len(kept) + 2 == len(self.dialogue) else height("…")
            if kept and left < height(line) + more:
                kept.append("…")
                break
            left -= height(line)
            kept.append(line)
        return "\n\n".join([self.dialogue[0], *reversed(kept)])

    def stack(self, world: Place, step: Step) -> str:
        """HARI's goals as Markdown, the one that counts now first."""
        here, lines = step.pose.node, []
        for depth, goal in reversed(list(enumerate(self.goals))):
            room = world.graph.room_of_node[goal].replace("_", " ")
            name = f"the task: “{detokenized(self.task.request)}”" if depth == 0 else "sub-goal from the assistant"
            text = f"{depth + 1}. {name}, in the {room}, {world.graph.distance[here, goal]:.1f} m from here"
            lines.append(f"**{text}**  ← now" if depth == len(self.goals) - 1 else text)
        return "\n\n".join(lines)


@dataclass(frozen=True)
class Listed:
    """One episode of a run folder."""

    agent: str
    """From the name of its file: 'shortest path'."""
    episode: Episode

    @property
    def arrived(self) -> bool:
        """Tells whether it stopped at a goal node; the tables judge by distance, this is for orientation."""
        return self.episode.nodes[-1] in self.episode.task.goal_nodes


def load_run(folder: Path) -> list[Listed]:
    """All episodes of a run, file by file in the order of their names.

    Raises:
      FileNotFoundError: no episodes there.
    """
    folder = Path(folder)
    files = sorted(folder.glob("episodes*.jsonl"))
    if not files:
        raise FileNotFoundError(
            f"{folder} holds no episodes*.jsonl; make a run with `embodied evaluate --out {folder}`; `rerun FILE.rrd` "
            "opens recordings"
        )
    episodes = []
    for path in files:  # 'val seen learned' of episodes_val_seen_learned.jsonl
        name = path.stem.removeprefix("episodes").strip("_").replace("_", " ") or "agent"
        episodes += [Listed(name, e) for e in load_lines(path, Episode)]
    return episodes


def summary_line(number: int, listed: Listed) -> str:
    """One line of the list."""
    e = listed.episode
    end = "at a goal" if listed.arrived else e.ended
    counts = f"{len(e.steps):3} steps {e.requests:2} requests"
    return f"{number:4}  {end:<10} {counts}  {listed.agent:<28} {e.task.id:<28} {detokenized(e.task.request)}"
