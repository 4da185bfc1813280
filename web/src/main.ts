// The page: shows the screen that the server says, and nothing else.

import { button, h, paragraphs, say } from "./dom";
import { JudgeView } from "./judge";
import { AgentView, AssistantView, type View } from "./play";
import { Connection } from "./socket";
import "./style.css";
import type { AgentScreen, AssistantScreen, Game, House, JudgeScreen, Plain, Screen } from "./types";

const app = document.getElementById("app")!;
const hash = new URLSearchParams(location.hash.slice(1));
const word = { join: hash.get("join") ?? undefined, results: hash.get("results") ?? undefined };
if (word.join) history.replaceState(null, "", location.pathname); // the word of a link stays out of screenshots

let current: { key: string; view: View<never> } | null = null;
const connection = new Connection(show, (house: House) => {
  if (current?.view instanceof AssistantView) current.view.setHouse(house);
}, word);

function show(screen: Screen): void {
  document.title = screen.title ?? document.title;
  const key = keyOf(screen);
  if (current?.key !== key) {
    current = { key, view: viewOf(screen) as View<never> };
    app.replaceChildren(...frame(screen, current.view.root));
    window.scrollTo(0, 0);
    if (!("game" in screen)) app.querySelector<HTMLElement>("h1")?.focus();
  } else if (screen.progress) {
    app.querySelector("header")?.replaceWith(header(screen));
  }
  current.view.update(screen as never);
}

function keyOf(screen: Screen): string {
  if (screen.screen === "agent" || screen.screen === "assistant") return `${screen.screen} ${(screen as Game).game}`;
  if (screen.screen === "judge") return (screen as JudgeScreen).unit;
  return screen.screen;
}

function viewOf(screen: Screen): View<never> | View<Plain> | View<AgentScreen> | View<AssistantScreen> {
  switch (screen.screen) {
    case "agent":
      return new AgentView(connection);
    case "assistant":
      return new AssistantView(connection);
    case "judge":
      return new JudgeView(connection, screen as JudgeScreen);
    default:
      return new PlainView();
  }
}

function frame(screen: Screen, root: HTMLElement): HTMLElement[] {
  return [header(screen), h("main", {}, root)];
}

function header(screen: Screen): HTMLElement {
  const p = screen.progress;
  const running = !["done", "refused", "results", "consent"].includes(screen.screen);
  return h(
    "header",
    {},
    h("strong", {}, screen.title ?? ""),
    running && p && p.total > 0
      ? h(
          "div",
          { class: "progress" },
          h("progress", { value: p.done, max: p.total, "aria-label": "Progress" }),
          h("span", {}, `${p.done} of ${p.total} done`),
        )
      : null,
    running && button("Stop taking part", leave, "quiet"),
  );
}

function leave(): void {
  if (confirm("Stop taking part? What you have finished is kept. You cannot come back.")) connection.send({ do: "leave" });
}

const ROLES: Record<string, string> = {
  agent: "You walk through a house and look for something. You can ask for help.",
  alone: "You go through a house and look for something.",
  assistant: "You help somebody who walks through a house. You see the plan; they do not.",
  rater: "You watch how an agent did what it was asked, and give stars.",
  describer: "You watch somebody walk, and describe the way in words.",
};

const ENDS: Record<string, string> = {
  found: "Well done: the goal was reached.",
  missed: "The episode is over. The goal was not reached this time.",
  broken: "The episode was broken off. That is not your fault; it does not count.",
  judged: "Thank you, your answer is stored.",
};

class PlainView implements View<Plain> {
  readonly root = h("div", { class: "sheet" });

  update(screen: Plain): void {
    const title = (text: string): HTMLElement => h("h1", { tabindex: -1 }, text);
    switch (screen.screen) {
      case "consent":
        this.put(
          title(screen.title),
          paragraphs(screen.text ?? ""),
          screen.contact ? h("p", { class: "hint" }, `Contact: ${screen.contact}`) : null,
          button("I have read this and take part", () => connection.send({ do: "consent" }), "primary wide"),
        );
        break;
      case "ready":
        this.put(
          title(screen.last ? "Ready for the next one?" : "Before you begin"),
          screen.last ? h("p", { class: "ending-note" }, ENDS[screen.last] ?? "") : null,
          screen.role ? h("p", {}, ROLES[screen.role] ?? "") : null,
          screen.advice ? paragraphs(screen.advice) : null,
          screen.practise ? h("p", {}, "The first episode is for practice and does not count.") : null,
          button(screen.last ? "Go on" : "Begin", () => connection.send({ do: "ready" }), "primary wide"),
        );
        break;
      case "wait":
        this.put(
          title("Waiting for a partner"),
          h("div", { class: "waiting", "aria-hidden": "true" }, h("i"), h("i"), h("i")),
          h("p", {}, "You begin as soon as somebody else is ready. Keep this window open; it does not take longer than a few minutes."),
        );
        break;
      case "done":
        this.put(
          title(screen.why === "nothing" ? "There is nothing to do just now" : "You have finished"),
          paragraphs(screen.why === "nothing" ? "All tasks are taken. Thank you for coming." : (screen.thanks ?? "")),
          screen.code ? h("p", {}, "Your completion code:") : null,
          screen.code ? h("p", { class: "code" }, screen.code) : null,
          screen.contact ? h("p", { class: "hint" }, `Contact: ${screen.contact}`) : null,
        );
        break;
      case "refused":
        this.put(
          title("This page cannot go on"),
          h("p", {}, screen.text ?? ""),
          button(screen.elsewhere ? "Continue here" : "Try again", () => connection.open(true), "primary"),
        );
        break;
      default:
        this.results(screen);
    }
  }

  private put(...children: (HTMLElement | null)[]): void {
    this.root.replaceChildren(...children.filter((c) => c !== null));
  }

  private results(screen: Plain): void {
    const shown = (v: unknown): string =>
      v === null || v === undefined ? "–" : typeof v === "number" && !Number.isInteger(v) ? v.toFixed(2) : String(v);
    const table = (facts: Record<string, unknown>): HTMLElement =>
      h("table", {}, ...Object.entries(facts).map(([k, v]) => h("tr", {}, h("th", { scope: "row" }, k), h("td", {}, shown(v)))));
    this.put(
      h("h1", { tabindex: -1 }, screen.title),
      h("h2", {}, "People"),
      table({ ...screen.people, "drop-out": screen.dropout }),
      ...(screen.parts ?? []).flatMap(({ name, ...facts }) => [h("h2", {}, String(name)), table(facts)]),
    );
  }
}

say("");
