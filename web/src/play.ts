// Playing an episode: as the agent, and as the assistant.

import { button, h, s, say, stored } from "./dom";
import type { Connection } from "./socket";
import { address, LEVEL, Panorama, prefetch, side } from "./panorama";
import { Plan } from "./plan";
import type { AgentScreen, AssistantScreen, Door, House, Said, Way } from "./types";

const LONGEST = 2000;
const SLOW = 1000; // milliseconds for a live picture, from which on the page says so
const LOOK = touched() ? "Swipe to look around." : "Drag, or press ← → ↑ ↓, to look around.";
const GO = touched() ? "Tap a ring on the floor to go there." : "Click a ring on the floor to go there; Enter takes the one ahead.";
const DRIVE = touched() ? "Tap a button to move." : "Press ↑ to go ahead, ← → to turn; or W, A, D.";
const DRIVING: Record<string, number> = { ArrowUp: 0, ArrowLeft: 1, ArrowRight: 2, w: 0, a: 1, d: 2 };

/** Tells whether people here point with fingers, and have no keys. */
function touched(): boolean {
  return matchMedia("(hover: none)").matches;
}

/** What stays on the page while an episode goes on. */
export interface View<S> {
  root: HTMLElement;
  update(screen: S): void;
}

/** A field for words that survives a reload, with a button that sends them. */
class Words {
  readonly root: HTMLElement;
  private readonly field: HTMLTextAreaElement;
  private readonly sender: HTMLButtonElement;
  private readonly key: string;

  constructor(label: string, action: string, name: string, send: (text: string) => void) {
    this.key = stored(`draft.${name}`);
    this.field = h("textarea", { id: name, rows: 2, maxlength: LONGEST, enterkeyhint: "send", autocomplete: "off" });
    this.field.value = sessionStorage.getItem(this.key) ?? "";
    this.field.addEventListener("input", () => sessionStorage.setItem(this.key, this.field.value));
    this.field.addEventListener("keydown", (e) => {
      if (e.key === "Enter" && !e.shiftKey && !e.isComposing) {
        e.preventDefault();
        this.sender.click();
      }
    });
    this.sender = button(action, () => {
      const text = this.field.value.trim();
      if (!text) return this.field.focus();
      this.field.value = "";
      sessionStorage.removeItem(this.key);
      send(text);
    }, "primary");
    this.root = h("div", { class: "words" }, h("label", { for: name }, label), this.field, this.sender);
  }

  set enabled(can: boolean) {
    this.field.disabled = this.sender.disabled = !can;
  }

  focus(): void {
    if (matchMedia("(hover: hover)").matches) this.field.focus({ preventScroll: true });
  }
}

/** What was said so far. */
function conversation(said: Said[], you: string, names: Record<string, string>, look?: (pano: string) => void): HTMLElement[] {
  return said.map((x) =>
    h(
      "li",
      { class: x.who === you ? "mine" : "theirs" },
      h("span", { class: "who" }, x.who === you ? "You" : names[x.who]),
      h("p", {}, x.text),
      x.pano && thumbnail(x.pano, look),
    ),
  );
}

/** A small picture of a panorama; a click shows it whole. */
function thumbnail(pano: string, look?: (pano: string) => void): HTMLElement {
  const image = h("img", { src: address(pano, "small"), alt: "View that was sent", loading: "lazy" });
  if (!look) return h("span", { class: "thumb" }, image);
  return h("button", { type: "button", class: "thumb", click: () => look(pano), "aria-label": "Look at this view" }, image);
}

function card(title: string, ...children: (Node | string | null | false)[]): HTMLElement {
  return h("section", { class: "card" }, h("h2", {}, title), ...children);
}

/** A picture of this moment. */
class LivePicture {
  readonly root = h("img", { class: "live", alt: "What is seen now", hidden: true });
  private name: string | null = null;

  /** Shows a live picture, then calls `seen`; says so where that takes long. */
  async show(name: string, seen?: () => void): Promise<void> {
    if (this.name === name) return;
    const [next, begun] = [new Image(), performance.now()];
    next.src = `live/${name}.jpg`;
    this.name = name;
    try {
      await next.decode();
      if (this.name !== name) return;
      this.root.src = next.src;
      const took = performance.now() - begun;
      if (took > SLOW && seen) say(`Each picture takes ${(took / 1000).toFixed(1)} s: the server is slow. Press a key, then wait.`);
    } catch {
      if (this.name !== name) return;
      this.name = null; // so that the next update tries again
    }
    seen?.();
  }
}

/** Directions of the ways round the agent, as a small compass. */
function compass(ways: Way[], view: Panorama): SVGElement {
  const turn = (a: number): string => `rotate(${(-(a - view.yaw) * 180) / Math.PI})`;
  return s(
    "svg",
    { class: "compass", viewBox: "-50 -50 100 100", "aria-hidden": "true" },
    s("circle", { r: 46, class: "rim" }),
    s("path", { d: "M0 0 L-27 -35 A44 44 0 0 1 27 -35 Z", class: "gaze" }),
    ...ways.map((w) => s("circle", { cy: -34, r: 7, class: "dot", transform: turn(w.yaw) })),
  );
}

export class AgentView implements View<AgentScreen> {
  readonly root: HTMLElement;
  private state!: AgentScreen;
  private node = "";
  private going = false;
  private elsewhere: string | null = null;
  private readonly view = new Panorama(() => this.turned());
  private readonly live = new LivePicture();
  private readonly corner = h("div", { class: "corner top" });
  private readonly banner = h("div", { class: "banner", role: "status" });
  private readonly keys = h("p", { class: "keys-hint" });
  private readonly talk = h("ol", { class: "talk", "aria-live": "polite", "aria-label": "Conversation" });
  private readonly request = h("p", { class: "request" });
  private readonly told = h("div", {});
  private readonly asking = h("div", { class: "asking" });
  private readonly doors = h("div", { class: "asking", role: "group", "aria-label": "Doors" });
  private readonly ending = h("div", { class: "ending" });
  private readonly words = new Words("Ask in your own words", "Ask", "ask", (text) => this.ask(text));

  constructor(private readonly connection: Connection) {
    this.root = h(
      "div",
      { class: "play" },
      h("div", { class: "stage" }, this.view.root, this.live.root, this.banner, this.corner, this.keys),
      h(
        "div",
        { class: "side" },
        card("Your task", this.request, this.told, this.doors),
        card("Help", this.talk, this.asking),
        this.ending,
      ),
    );
    document.addEventListener("keydown", (e) => this.key(e));
  }

  update(screen: AgentScreen): void {
    const jumped = !this.going || (screen.subtask && screen.subtask !== this.state?.subtask);
    if (this.node !== screen.pano) {
      if (jumped) this.view.look(screen.yaw, LEVEL);
      this.elsewhere = null;
    } else if (screen.words.length) this.view.look(screen.yaw, screen.pitch);
    this.node = screen.pano;
    this.state = screen;
    this.going = screen.live !== null && this.going; // whoever drives goes on when they see where they are
    this.request.textContent = screen.request;
    const sub = screen.subtask || (screen.instruction !== screen.request && screen.said.length > 0);
    this.told.replaceChildren(
      ...(sub ? [h("p", { class: "told" }, h("span", { class: "who" }, "You were told"), screen.instruction)] : []),
      ...(screen.target ? [h("p", { class: "told" }, h("span", { class: "who" }, "Look for this view"), thumbnail(screen.target, (p) => this.visit(p)))] : []),
    );
    this.talk.replaceChildren(...conversation(screen.said, "agent", { assistant: "Assistant" }, (p) => this.visit(p)));
    this.talk.lastElementChild?.scrollIntoView({ block: "nearest" });
    const waiting = screen.question !== null;
    this.banner.textContent = waiting
      ? screen.partnerThere
        ? "Your question was sent. Wait for the answer; you can look around meanwhile."
        : "Your partner lost the connection. Please wait a moment."
      : screen.practice
        ? "Practice: this does not count yet."
        : "";
    this.questions(screen);
    this.moves(screen, waiting);
    this.keys.textContent = this.elsewhere || waiting ? LOOK : screen.live ? DRIVE : screen.words.length ? "" : `${LOOK} ${GO}`;
    const left = screen.horizon - screen.time;
    const stop = button(screen.subtask ? "I have followed this advice" : "I am there: stop here", () => this.stop(), "primary stop");
    stop.disabled = waiting;
    this.ending.replaceChildren(stop, h("p", { class: "hint" }, `${left} ${left === 1 ? "step" : "steps"} left.`));
    this.live.root.hidden = !screen.live || this.elsewhere !== null;
    if (screen.live) void this.live.show(screen.live, () => (this.going = false));
    if (this.live.root.hidden) void this.view.show(this.elsewhere ?? screen.pano);
    if (!screen.live) prefetch(screen.moves.map((m) => m.pano));
  }

  private key(e: KeyboardEvent): void {
    const plain = !e.ctrlKey && !e.metaKey && !e.altKey && !(e.target instanceof HTMLTextAreaElement);
    if (plain && e.key === "o" && this.root.isConnected) this.doors.querySelector("button")?.click();
    const way = this.state?.live && this.root.isConnected ? this.state.moves[DRIVING[e.key] ?? -1] : undefined;
    if (!way || !plain) return;
    e.preventDefault();
    if (this.state.question === null) this.go(way);
  }

  private questions(screen: AgentScreen): void {
    const left = screen.left === null ? "" : `${screen.left} ${screen.left === 1 ? "question" : "questions"} left. `;
    const can = screen.canAsk;
    this.words.enabled = can;
    const typed = screen.questions.map((q) =>
      button(q.price ? `${q.text} (costs ${q.price})` : q.text, () => this.ask(q.text), "question", { disabled: !can }),
    );
    const none = !can && screen.question === null && "Nobody can be asked here. ";
    const hint = h("p", { class: "hint" }, none || null, left);
    if (!this.words.root.isConnected || !screen.free || typed.length)
      this.asking.replaceChildren(...typed, ...(screen.free ? [this.words.root] : []), hint);
    else this.asking.lastElementChild!.replaceWith(hint);
  }

  private moves(screen: AgentScreen, waiting: boolean): void {
    const ways = waiting || this.elsewhere ? [] : screen.moves;
    if (screen.words.length) {
      const buttons = ways.map((m) => button(screen.words[m.candidate]!, () => this.go(m)));
      if (this.elsewhere) buttons.push(this.back());
      this.corner.replaceChildren(h("div", { class: "keys", role: "group", "aria-label": "Moves" }, ...buttons));
      return;
    }
    this.view.offer(ways, (way) => this.go(way));
    this.offerDoors();
  }

  /** Doors and furniture that can be opened or closed here; O takes the first, which is the nearest to the gaze. */
  private offerDoors(): void {
    const away = (d: Door): number => Math.abs(Math.atan2(Math.sin(d.yaw - this.view.yaw), Math.cos(d.yaw - this.view.yaw)));
    const doors = this.state.question === null && !this.elsewhere ? [...this.state.doors] : [];
    const buttons = doors.sort((a, b) => away(a) - away(b)).map((d, k) => {
      const does = d.event === "opened" ? "Open" : "Close";
      const act = (): void => this.act(d.event, { candidate: d.candidate });
      return button(`${does} the ${d.what}, ${side(d.yaw - this.view.yaw)}${k || touched() ? "" : " (O)"}`, act, "question");
    });
    this.doors.replaceChildren(...buttons);
  }

  private turned(): void {
    if (!this.state || this.state.words.length) return;
    this.offerDoors();
    const ways = this.state.question === null ? this.state.moves : [];
    this.corner.replaceChildren(this.elsewhere ? this.back() : compass(ways, this.view));
  }

  private back(): HTMLButtonElement {
    return button("Back to where you are", () => this.visit(null), "primary");
  }

  private visit(pano: string | null): void {
    this.elsewhere = pano;
    this.update(this.state);
    this.turned();
  }

  private act(what: "moved" | "opened" | "closed" | "stopped" | "asked", more: object = {}): void {
    this.connection.send({ do: what, game: this.state.game, turn: this.state.turn, ...more });
  }

  private go(way: Way): void {
    if (this.going) return;
    this.going = true;
    setTimeout(() => (this.going = false), this.state.live ? 10_000 : 1500);
    if (!this.state.words.length) {
      this.view.look(way.yaw, LEVEL);
      void this.view.show(way.pano);
    }
    this.act("moved", { candidate: way.candidate });
  }

  private stop(): void {
    if (this.state.subtask || confirm("Stop here and end this episode?")) this.act("stopped");
  }

  private ask(text: string): void {
    this.act("asked", { text });
    say("Your question was sent.");
  }
}

export class AssistantView implements View<AssistantScreen> {
  readonly root: HTMLElement;
  private state!: AssistantScreen;
  private plan: Plan | null = null;
  private house: House | null = null;
  private node = -1;
  private looking = -1;
  private answered = true;
  private readonly view = new Panorama();
  private readonly live = new LivePicture();
  private readonly keys = h("p", { class: "keys-hint" });
  private readonly banner = h("div", { class: "banner", role: "status" });
  private readonly corner = h("div", { class: "corner" });
  private readonly map = h("div", { class: "map" }, h("p", { class: "hint" }, "Loading the plan …"));
  private readonly talk = h("ol", { class: "talk", "aria-live": "polite", "aria-label": "Conversation" });
  private readonly request = h("p", { class: "request" });
  private readonly attach = h("div", { class: "attach" });
  private readonly words = new Words("Your answer", "Send answer", "answer", (text) => this.answer(text));

  constructor(private readonly connection: Connection) {
    this.root = h(
      "div",
      { class: "play assist" },
      h("div", { class: "stage" }, this.view.root, this.live.root, this.banner, this.corner, this.keys),
      h(
        "div",
        { class: "side" },
        card("The agent was asked to", this.request),
        card("Plan", this.map, legend()),
        card("Conversation", this.talk, this.words.root, this.attach),
      ),
    );
    connection.send({ do: "house" });
  }

  /** The plan has come. */
  setHouse(house: House): void {
    this.house = house;
    this.plan = new Plan(house, (n) => this.visit(n));
    this.map.replaceChildren(this.plan.root);
    if (this.state) this.update(this.state);
  }

  update(screen: AssistantScreen): void {
    if (this.node !== screen.node || this.state?.yaw !== screen.yaw) {
      if (this.looking === this.node || this.looking < 0) this.looking = screen.node;
      if (this.looking === screen.node) this.view.look(screen.yaw, screen.pitch);
    }
    this.node = screen.node;
    this.state = screen;
    this.request.textContent = screen.request;
    this.talk.replaceChildren(
      ...conversation(screen.said, "assistant", { agent: "Agent" }, (p) => this.visit(this.house?.panos.indexOf(p) ?? -1)),
    );
    this.talk.lastElementChild?.scrollIntoView({ block: "nearest" });
    const asked = screen.question !== null;
    this.words.enabled = asked;
    if (asked && this.answered) this.words.focus();
    this.answered = !asked;
    this.banner.textContent = !screen.partnerThere
      ? "Your partner lost the connection. Please wait a moment."
      : asked
        ? "The agent asks you something."
        : screen.practice
          ? "Practice: watch the agent. It will ask you."
          : "Watch the agent. It will ask you when it needs help.";
    this.banner.classList.toggle("urgent", asked);
    this.draw();
  }

  private draw(): void {
    const away = this.looking !== this.node;
    const pano = away && this.house ? this.house.panos[this.looking]! : this.state.pano;
    this.live.root.hidden = !this.state.live || away;
    if (this.state.live) void this.live.show(this.state.live);
    if (this.live.root.hidden) void this.view.show(pano);
    this.keys.textContent = this.live.root.hidden ? LOOK : "";
    this.plan?.update(this.state, this.looking);
    this.corner.replaceChildren(...(away ? [button("Back to the agent", () => this.visit(this.node), "primary")] : []));
    this.attach.replaceChildren(
      ...(!this.state.sendPictures
        ? []
        : away
          ? [h("p", { class: "hint" }, "The view you look at goes with your answer. ", thumbnail(pano))]
          : [h("p", { class: "hint" }, "To send a view with your answer, choose a viewpoint on the plan.")]),
    );
  }

  private visit(node: number): void {
    if (node < 0) return;
    this.looking = node;
    if (node === this.node) this.view.look(this.state.yaw, this.state.pitch);
    else this.view.look(this.openSide(node));
    this.draw();
  }

  /** Towards the farthest neighbour of a viewpoint: where there is something to see. */
  private openSide(node: number): number {
    const { nodes, edges } = this.house!;
    const [x, y] = nodes[node]!;
    const off = edges.flatMap(([a, b]) => (a === node ? [nodes[b]!] : b === node ? [nodes[a]!] : [])).map(([u, v]) => [u - x, v - y]);
    const [dx, dy] = off.sort((a, b) => Math.hypot(b[0]!, b[1]!) - Math.hypot(a[0]!, a[1]!))[0] ?? [1, 0];
    return Math.atan2(dy!, dx!);
  }

  private answer(text: string): void {
    const picture = this.state.sendPictures && this.looking !== this.node ? this.looking : null;
    this.connection.send({ do: "answered", game: this.state.game, turn: this.state.turn, text, picture });
    say("Your answer was sent.");
    this.visit(this.node);
  }
}

function legend(): HTMLElement {
  const entry = (kind: string, text: string): HTMLElement => h("li", {}, h("i", { class: kind, "aria-hidden": "true" }), text);
  return h("ul", { class: "legend" }, entry("agent", "agent"), entry("goal", "goal"), entry("way", "shortest way"), entry("trail", "walked"));
}
