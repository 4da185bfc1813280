// A panorama to look round in, with ways to go as buttons in it.

import { h } from "./dom";
import { painter, type Painter } from "./paint";
import type { Way } from "./types";

const DEGREES = 180 / Math.PI;
/** A little below the horizon, where the ways are; radians. */
export const LEVEL = -0.12;

/** The address of a panorama, relative to the page's. */
export const address = (pano: string, size: "small" | "large"): string => `pano/${pano}/${size}.jpg`;

const pictures = new Map<string, Promise<HTMLImageElement>>();

/** A picture, fetched once. */
function picture(url: string): Promise<HTMLImageElement> {
  let found = pictures.get(url);
  if (!found) {
    const image = new Image();
    image.src = url;
    found = image.decode().then(() => image);
    found.catch(() => pictures.delete(url));
    pictures.set(url, found);
    if (pictures.size > 60) pictures.delete(pictures.keys().next().value!);
  }
  return found;
}

/** Fetches the small pictures that may be wanted next. */
export function prefetch(panos: string[]): void {
  for (const pano of panos) void picture(address(pano, "small")).catch(() => undefined);
}

const wrap = (a: number): number => Math.atan2(Math.sin(a), Math.cos(a));

/** Where something is, in words, by its direction to the left of the gaze (radians). */
export function side(bearing: number): string {
  const d = Math.round(wrap(bearing) * DEGREES);
  if (Math.abs(d) < 20) return "straight ahead";
  if (Math.abs(d) > 160) return "behind you";
  return `${Math.abs(d)}° to the ${d > 0 ? "left" : "right"}`;
}

type Edge = "left" | "right" | "up" | "down";
const ARROWS: Record<Edge, string> = { left: "‹", right: "›", up: "‹", down: "›" };
const MARGIN = 26; // pixels from an edge within which a way is not seen well enough

export class Panorama {
  readonly root: HTMLElement;
  yaw = 0;
  pitch = 0;
  private shown = "";
  private readonly canvas = h("canvas", { "aria-hidden": "true" });
  private readonly paint: Painter = painter(this.canvas);
  private readonly marks = h("div", { class: "marks" });
  private ways: { way: Way; mark: HTMLButtonElement }[] = [];
  private readonly edges = {} as Record<Edge, HTMLButtonElement>;
  private readonly beyond: Record<Edge, Way[]> = { left: [], right: [], up: [], down: [] };
  private fov = 80 / DEGREES;
  private frame = 0;

  /** `turned` is called whenever somebody looks elsewhere. */
  constructor(private readonly turned: () => void = () => undefined) {
    for (const edge of Object.keys(ARROWS) as Edge[]) {
      const turn = (): void => this.look(this.beyond[edge][0]!.yaw, LEVEL);
      // Tab reaches the ways themselves, so the arrows are for the eye and the hand
      this.edges[edge] = h("button", { type: "button", class: `edge ${edge}`, tabindex: -1, "aria-hidden": "true", click: turn });
    }
    this.root = h(
      "div",
      { class: "panorama", tabindex: 0, role: "application", "aria-label": "Panorama. Arrow keys turn, Enter goes on." },
      this.canvas,
      this.marks,
      ...Object.values(this.edges),
    );
    document.addEventListener("keydown", (e) => {
      if (this.root.isConnected && (e.target === document.body || this.root.contains(e.target as Node))) this.key(e);
    });
    this.drag();
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  /** Shows a panorama, coarse at once and fine when it has come. */
  async show(pano: string): Promise<void> {
    if (this.shown === pano) return;
    this.shown = pano;
    this.root.setAttribute("aria-busy", "true");
    for (const size of ["small", "large"] as const) {
      try {
        const image = await picture(address(pano, size));
        if (this.shown !== pano) return;
        this.paint.take(image);
        this.draw();
      } catch {
        if (size === "large" && this.shown === pano) this.shown = ""; // so that the next update tries again
      }
    }
    this.root.removeAttribute("aria-busy");
  }

  /** Looks along a direction, radians. */
  look(yaw: number, pitch = 0): void {
    this.yaw = wrap(yaw);
    this.pitch = Math.max(-1.3, Math.min(1.3, pitch));
    this.draw();
  }

  /** Shows ways to go as buttons in the picture. */
  offer(ways: Way[], go: (way: Way) => void): void {
    if (this.marks.contains(document.activeElement)) this.root.focus({ preventScroll: true }); // the next Tab goes on here
    this.marks.replaceChildren();
    this.ways = ways.map((way) => {
      const mark = h("button", { type: "button", class: "mark", click: () => go(way) });
      mark.addEventListener("focus", () => mark.matches(":focus-visible") && this.look(way.yaw, -0.1));
      mark.append(h("span", { "aria-hidden": "true" }));
      this.marks.append(mark);
      return { way, mark };
    });
    this.go = go;
    this.draw();
  }

  private go: (way: Way) => void = () => undefined;

  private draw(): void {
    const { clientWidth: w, clientHeight: tall } = this.root;
    if (!w || !tall) return;
    const eye = Math.max(w, tall) / 2 / Math.tan(this.fov / 2);
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.paint.draw(this.yaw, this.pitch, w / 2 / eye, tall / 2 / eye));
    for (const edge of Object.values(this.beyond)) edge.length = 0;
    for (const { way, mark } of this.ways) {
      const pitch = Math.max(-0.5, way.pitch - Math.atan(1.1 / Math.max(way.distance, 0.5)));
      const [a, cp, sp] = [wrap(way.yaw - this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
      const [x, y, z] = [-Math.sin(a) * Math.cos(pitch), Math.sin(pitch), Math.cos(a) * Math.cos(pitch)];
      const [up, deep] = [y * cp - z * sp, y * sp + z * cp];
      const [across, down] = [w / 2 + (eye * x) / deep, tall / 2 - (eye * up) / deep];
      const aside = deep <= 0.15 || across < MARGIN || across > w - MARGIN;
      const visible = !aside && down > MARGIN && down < tall - MARGIN;
      if (!visible) this.beyond[aside ? (a > 0 ? "left" : "right") : down < tall / 2 ? "up" : "down"].push(way);
      mark.setAttribute("aria-label", `Go ${side(way.yaw - this.yaw)}`);
      const scale = Math.max(0.55, Math.min(1.15, 2.6 / (way.distance + 0.6)));
      mark.style.transform = visible
        ? `translate(${across}px, ${down}px) scale(${scale})`
        : "translate(-200px, -200px)";
    }
    for (const [edge, button] of Object.entries(this.edges) as [Edge, HTMLButtonElement][]) {
      const some = this.beyond[edge].sort((a, b) => this.off(a) - this.off(b));
      button.hidden = !some.length;
      button.replaceChildren(h("i", {}, ARROWS[edge]), `${some.length} ${some.length > 1 ? "ways" : "way"}`);
    }
    this.turned();
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const step = 15 / DEGREES;
    const turn: Record<string, [number, number]> = {
      ArrowLeft: [step, 0],
      ArrowRight: [-step, 0],
      ArrowUp: [0, step],
      ArrowDown: [0, -step],
    };
    if (turn[e.key]) this.look(this.yaw + turn[e.key]![0], this.pitch + turn[e.key]![1]);
    else if ((e.key === "Enter" || e.key === " ") && !(e.target as Element).closest("button")) {
      const ahead = [...this.ways].sort((a, b) => this.off(a.way) - this.off(b.way))[0];
      if (ahead && this.off(ahead.way) < 40 / DEGREES) this.go(ahead.way);
    } else return;
    e.preventDefault();
  }

  private off(way: Way): number {
    return Math.abs(wrap(way.yaw - this.yaw));
  }

  private drag(): void {
    let from: [number, number, number, number] | null = null;
    this.root.addEventListener("pointerdown", (e) => {
      if ((e.target as Element).closest("button")) return;
      from = [e.clientX, e.clientY, this.yaw, this.pitch];
      this.root.setPointerCapture(e.pointerId);
      this.root.classList.add("dragged");
    });
    this.root.addEventListener("pointermove", (e) => {
      if (!from) return;
      const scale = this.fov / Math.max(this.root.clientWidth, this.root.clientHeight);
      this.look(from[2] + (e.clientX - from[0]) * scale, from[3] + (e.clientY - from[1]) * scale);
    });
    const end = (): void => {
      from = null;
      this.root.classList.remove("dragged");
    };
    this.root.addEventListener("pointerup", end);
    this.root.addEventListener("pointercancel", end);
    this.root.addEventListener(
      "wheel",
      (e) => {
        e.preventDefault();
        this.fov = Math.max(0.6, Math.min(1.9, this.fov * (e.deltaY > 0 ? 1.08 : 0.93)));
        this.draw();
      },
      { passive: false },
    );
  }
}
