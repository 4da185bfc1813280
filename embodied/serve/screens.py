"""Messages to a browser: everything on somebody's screen as one JSON object, so that a reload loses nothing."""

from typing import Any

import numpy as np

from embodied.interface import Ask, Mode, Move, Observation, Place, Pose, Situation, Step, viewpoint
from embodied.language.plain_language import detokenized
from embodied.serve.driving import ACTIONS, EncodedPanoramas
from embodied.serve.game import Game
from embodied.serve.sessions import STARS, Person, Sessions
from embodied.serve.study import StudyPart
from embodied.serve.talk import way_to_goal

Screen = dict[str, Any]


def screen_of(sessions: Sessions, person: Person, pictures: EncodedPanoramas, code: str) -> Screen:
    """Everything that `person` sees now."""
    study = sessions.study
    base: Screen = {"title": study.title, "contact": study.contact, "progress": progress(sessions, person)}
    if person.ended:
        done = person.ended == "done" or (person.ended == "left" and sum(person.done.values()) > 0)
        return {**base, "screen": "done", "why": person.ended, "thanks": study.thanks, "code": code if done else None}
    if not person.consented:
        return {**base, "screen": "consent", "text": study.consent}
    if person.game is not None:
        game = sessions.games[person.game]
        role = next(r for r, p in game.people.items() if p == person.id)
        there = [sessions.people[p].connected > 0 for r, p in game.people.items() if r != role]
        common = game_of(game, role, pictures) | {"partnerThere": all(there)}
        return {**base, **common, **(agent_of(game, pictures) if role == "agent" else assistant_of(game))}
    if person.viewing is not None:
        return {**base, **judge_of(sessions, person, pictures)}
    if person.waiting is not None:
        return {**base, "screen": "wait"}
    return {**base, "screen": "ready", "last": person.last, **coming(sessions, person)}


def progress(sessions: Sessions, person: Person) -> Screen:
    """How much of the study is done."""
    total = 0
    for part in sessions.study.parts:
        units = len(sessions.tables[part.name].tasks) if part.kind == "play" else len(sessions.episodes(part))
        left = 0 if part.name in person.without else min(part.per_person, units)
        total += max(left, person.done[part.name])
    return {"done": sum(person.done.values()), "total": total}


def coming(sessions: Sessions, person: Person) -> Screen:
    """The next part's request, to be read before it begins."""
    part = next_part(sessions, person)
    if part is None:
        return {"advice": "", "role": None, "practise": False}
    role = person.roles.get(part.name) or (part.roles[0] if len(part.roles) == 1 else None)
    practise = sessions.study.practice and part.kind == "play" and role not in person.practised
    shown = "alone" if role == "agent" and part.assistant == "none" else role
    return {"advice": part.advice, "role": shown, "practise": practise}


def next_part(sessions: Sessions, person: Person) -> StudyPart | None:
    """The part that `person` does next; None where they have done all."""
    todo = (p for p in sessions.study.parts if person.done[p.name] < p.per_person and p.name not in person.without)
    return next(todo, None)


def game_of(game: Game, role: str, pictures: EncodedPanoramas) -> Screen:
    """The view of both roles of a game."""
    world = game.task.world
    shown = lambda node: None if node is None else pictures.name(world, node)
    conversation = [{"who": s["who"], "text": detokenized(s["text"]), "pano": shown(s["picture"])} for s in game.said]
    pose, request = game.situation.pose, detokenized(game.task.request)
    play = {"game": game.id, "turn": game.turn, "practice": game.practice, "yours": game.mover == role}
    words = {"advice": game.table.part.advice, "request": request, "said": conversation, "question": game.question}
    seen = {"pano": pictures.name(game.env.seen_from(pose.node), pose.node), "yaw": pose.yaw, "pitch": pose.pitch}
    sees = game.drive is not None and (role == "agent" or game.table.part.figure)
    return {"screen": role, **play, **words, **seen, "live": live_name(game, pictures) if sees else None}


def agent_of(game: Game, pictures: EncodedPanoramas) -> Screen:
    """The agent's view of a game, and nothing that an agent may not know."""
    part, seen = game.table.part, game.observation
    assert seen is not None
    aim = None if seen.target is None else viewpoint(seen.target)
    target = None if aim is None else pictures.name(aim.world, aim.node)
    drives = [{"candidate": k} for k in range(len(ACTIONS))]
    return {
        "moves": moves_of(seen, game, pictures) if game.drive is None else drives,
        "doors": doors_of(seen, game.situation),
        "words": list(seen.candidates.words if game.drive is None else ACTIONS),
        "instruction": detokenized(seen.instruction),
        "subtask": seen.mode is Mode.SUB,
        "target": target,
        "canAsk": bool(seen.can_ask) and game.question is None,
        "questions": [{"text": q.text, "price": q.price} for q in part.questions if part.assistant != "none"],
        "free": (part.free_question or game.practice) and part.assistant != "none",
        "left": seen.requests_left,
        "time": seen.time,
        "horizon": game.task.horizon,
    }


def live_name(game: Game, pictures: EncodedPanoramas) -> str:
    """Under which browsers get what is seen now, of whoever drives, or of who is steered; others cannot guess it."""
    return f"{game.id}/{pictures.name(game.id, game.turn)}"


def doors_of(seen: Observation, s: Situation) -> list[Screen]:
    """Doors and parts of furniture that can be opened and closed, and where they are seen."""
    things, parts, doors = s.world.house.placement_by_id, s.extras if isinstance(s.extras, dict) else {}, []
    for event, k in (*(("opened", k) for k in seen.can_open), *(("closed", k) for k in seen.can_close)):
        thing, _, part = parts.get(k, "").partition("/")
        words = part.rstrip("_0123456789").replace("_", " ")
        what = f"{words} of the {things[thing].object_class}" if part else "door"
        yaw = round(float(s.pose.yaw + seen.candidates.bearing[k]), 4)
        doors.append({"candidate": k, "event": event, "what": what, "yaw": yaw})
    return doors


def moves_of(seen: Observation, game: Game, pictures: EncodedPanoramas) -> list[Screen]:
    """The moves that are allowed: where they are seen, and the panorama to fetch in advance."""
    c, at, pose = seen.candidates, game.situation.world.graph.positions, game.situation.pose
    moves = []
    for i, node in enumerate(game.situation.candidate_nodes):
        if c.allowed[i]:
            direction = {"yaw": round(float(pose.yaw + c.bearing[i]), 4), "pitch": round(float(c.slope[i]), 4)}
            metres = round(float(np.linalg.norm(at[node] - at[pose.node])), 2)
            pano = pictures.name(game.env.seen_from(node), node)
            moves.append({"candidate": i, **direction, "distance": metres, "pano": pano})
    return moves


def assistant_of(game: Game) -> Screen:
    """The assistant's view of a game."""
    part, s = game.table.part, game.situation
    goals = list(s.task.goal_nodes) if part.show_goal or game.practice else []
    way = list(way_to_goal(s, part.way)) if part.show_way or game.practice else []
    here = {"house": s.task.world, "node": s.pose.node, "trail": list(s.trail)}
    return {**here, "goals": goals, "way": way, "sendPictures": part.send_pictures}


def judge_of(sessions: Sessions, person: Person, pictures: EncodedPanoramas) -> Screen:
    """An episode to be watched, with what is asked about it."""
    assert person.viewing is not None
    part, episode = sessions.part(person.viewing[0]), sessions.episode_of(*person.viewing)
    return {
        "screen": "judge",
        "kind": part.kind,
        "advice": part.advice,
        "ask": part.ask or DEFAULT_QUESTIONS[part.kind],
        "stars": STARS if part.kind == "rate" else 0,
        "unit": f"{part.name}/{person.viewing[1]}",
        "request": detokenized(episode.task.request) if part.kind == "rate" else None,
        "frames": frames(episode.task.world, episode.task.start, episode.steps, part, pictures),
    }


DEFAULT_QUESTIONS = {
    "rate": "How well did the agent do what it was asked?",
    "describe": "What should one say to somebody who is to walk exactly this way?",
}


def frames(
    world: str, start: Pose, steps: tuple[Step, ...], part: StudyPart, pictures: EncodedPanoramas
) -> list[Screen]:
    """The pictures of an episode, one per step and one of where it ended."""
    shown: list[Screen] = []
    for step in steps:
        text = ""
        if part.kind == "rate" and isinstance(step.action, Ask):
            asked = step.action.question or "Can you help me?"
            text = f"Question: {asked}"
            if step.reply and step.reply.text:
                text += f"\nAnswer: {detokenized(step.reply.text)}"
        if isinstance(step.action, Move) or text:
            pose = step.next_pose if isinstance(step.action, Move) else step.pose
            shown.append({"pano": pictures.name(world, step.pose.node), "yaw": pose.yaw, "pitch": 0, "text": text})
    last = steps[-1].next_pose if steps else start
    return [*shown, {"pano": pictures.name(world, last.node), "yaw": last.yaw, "pitch": 0, "text": "The end."}]


def plan_of(place: Place, pictures: EncodedPanoramas) -> Screen:
    """A house as a plan: rooms and viewpoints, metres."""
    house, graph = place.house, place.graph
    floor = {r.id: r.storey for r in house.rooms}
    inner = [o for o in house.openings if o.kind not in ("window", "roof_window")]
    plain = lambda points: np.round(points, 2).tolist()
    room = lambda r: {"kind": r.kind.replace("_", " "), "outline": plain(r.polygon), "floor": floor[r.id]}
    doors = [{"line": plain([o.a, o.b]), "floor": floor[o.rooms[0]]} for o in inner]
    panos = [pictures.name(house.name, n) for n in range(len(graph.positions))]
    rooms, nodes = [room(r) for r in house.rooms], plain(graph.positions[:, :2])
    about = {"name": house.name, "rooms": rooms, "doors": doors, "nodes": nodes, "panos": panos}
    return {**about, "floors": [floor[r] for r in graph.room_of_node], "edges": graph.edges.tolist()}
