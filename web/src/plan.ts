// The plan of a house: rooms, doors, viewpoints, where the agent is and looks, the goal, the way.

import { h, s } from "./dom";
import type { AssistantScreen, House } from "./types";

const COLOURS: Record<string, string> = {
  kitchen: "#f6ead9",
  bathroom: "#dcebf3",
  toilet: "#dcebf3",
  bedroom: "#e9e4f3",
  "living room": "#e6f0e2",
  hall: "#efefec",
};

export class Plan {
  readonly root = h("div", { class: "plan" });
  private floor = -1;
  private seen: AssistantScreen | null = null;

  /** `chosen` is called with a viewpoint that somebody clicked. */
  constructor(
    private readonly house: House,
    private readonly chosen: (node: number) => void,
  ) {}

  /** Draws what the assistant may see; `looking` is the viewpoint whose view is shown. */
  update(screen: AssistantScreen, looking: number): void {
    const { house } = this;
    const here = house.floors[screen.node]!;
    if (this.seen?.node !== screen.node || this.floor < 0) this.floor = here;
    this.seen = screen;
    const floors = [...new Set(house.floors)].sort((a, b) => a - b);
    const on = (node: number): boolean => house.floors[node] === this.floor;
    const rooms = house.rooms.filter((r) => r.floor === this.floor);
    const [xs, ys] = [0, 1].map((k) => rooms.flatMap((r) => r.outline.map((p) => p[k]!)));
    const [x0, x1, y0, y1] = [Math.min(...xs!), Math.max(...xs!), Math.min(...ys!), Math.max(...ys!)];
    const at = (p: [number, number]): string => `${(p[0] - x0).toFixed(2)},${(y1 - p[1]).toFixed(2)}`;
    const spot = (n: number): [string, string] => at(house.nodes[n]!).split(",") as [string, string];
    const line = (nodes: number[], kind: string): SVGElement =>
      s("polyline", { class: kind, points: nodes.filter(on).map((n) => at(house.nodes[n]!)).join(" ") });
    const [ax, ay] = spot(screen.node);
    const svg = s(
      "svg",
      {
        viewBox: `-0.4 -0.4 ${x1 - x0 + 0.8} ${y1 - y0 + 0.8}`,
        role: "group",
        "aria-label": "Plan of the house",
      },
      ...rooms.map((r) =>
        s("polygon", { class: "room", points: r.outline.map(at).join(" "), fill: COLOURS[r.kind] ?? "#f1f1ee" }),
      ),
      ...house.doors
        .filter((d) => d.floor === this.floor)
        .map((d) => s("polyline", { class: "door", points: d.line.map(at).join(" ") })),
      ...rooms.map((r) => {
        const [cx, cy] = [0, 1].map((k) => r.outline.reduce((sum, p) => sum + p[k]!, 0) / r.outline.length);
        const [x, y] = at([cx!, cy!]).split(",");
        return s("text", { class: "label", x, y }, r.kind);
      }),
      line(screen.trail, "trail"),
      line(screen.way, "way"),
      ...screen.goals.filter(on).map((n) => {
        const [x, y] = spot(n);
        return s("g", { class: "goal", transform: `translate(${x} ${y})` }, s("circle", { r: 0.42 }), s("circle", { r: 0.2 }));
      }),
      ...house.nodes.map((_, n) => {
        if (!on(n)) return null;
        const [cx, cy] = spot(n);
        const choose = (): void => this.chosen(n);
        return s("circle", {
          class: n === looking ? "node looking" : "node",
          cx,
          cy,
          r: n === looking ? 0.24 : 0.15,
          tabindex: screen.sendPictures ? 0 : null,
          role: "button",
          "aria-label": `Viewpoint ${n}${n === screen.node ? ", where the agent is" : ""}`,
          click: choose,
          keydown: ((e: KeyboardEvent) => {
            if (e.key === "Enter" || e.key === " ") {
              e.preventDefault();
              choose();
            }
          }) as EventListener,
        });
      }),
      on(screen.node) &&
        s(
          "g",
          { class: "agent", transform: `translate(${ax} ${ay}) rotate(${(-screen.yaw * 180) / Math.PI})` },
          s("path", { d: "M0.62 0 L-0.36 0.38 L-0.16 0 L-0.36 -0.38 Z" }),
        ),
    );
    const tabs = floors.length < 2 ? null : h("div", { class: "floors", role: "group", "aria-label": "Storey" });
    for (const floor of floors) {
      tabs?.append(
        h(
          "button",
          {
            type: "button",
            "aria-pressed": String(floor === this.floor),
            click: () => {
              this.floor = floor;
              this.update(screen, looking);
            },
          },
          floor === here ? `Storey ${floor} (agent)` : `Storey ${floor}`,
        ),
      );
    }
    this.root.replaceChildren(...(tabs ? [tabs] : []), svg);
  }
}
