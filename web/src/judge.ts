// Watching an episode: to give it stars, or to describe it.

import { button, h, s, stored } from "./dom";
import type { Connection } from "./socket";
import { Panorama, prefetch } from "./panorama";
import type { JudgeScreen } from "./types";
import type { View } from "./play";

const SECONDS = 1600; // each picture is shown so long, ms

export class JudgeView implements View<JudgeScreen> {
  readonly root: HTMLElement;
  private at = 0;
  private furthest = 0;
  private timer = 0;
  private stars = 0;
  private readonly begun = performance.now();
  private readonly view = new Panorama();
  private readonly caption = h("div", { class: "banner", role: "status" });
  private readonly slider: HTMLInputElement;
  private readonly player: HTMLButtonElement;
  private readonly sender: HTMLButtonElement;
  private readonly field: HTMLTextAreaElement;

  constructor(
    connection: Connection,
    private readonly state: JudgeScreen,
  ) {
    const last = state.frames.length - 1;
    this.slider = h("input", { type: "range", min: 0, max: last, value: 0, "aria-label": "Step", input: () => this.seek(Number(this.slider.value)) });
    this.player = button("Play", () => this.play(!this.timer), "player");
    this.field = h("textarea", { id: "judgement", rows: 4, maxlength: 2000 });
    this.field.value = sessionStorage.getItem(stored(`draft.${state.unit}`)) ?? "";
    this.field.addEventListener("input", () => {
      sessionStorage.setItem(stored(`draft.${state.unit}`), this.field.value);
      this.check();
    });
    this.sender = button("Send", () => {
      const seconds = (performance.now() - this.begun) / 1000;
      connection.send({ do: "judge", unit: state.unit, stars: this.stars || null, text: this.field.value.trim(), seconds });
      this.sender.disabled = true;
    }, "primary");
    this.root = h(
      "div",
      { class: "play judge" },
      h(
        "div",
        { class: "stage" },
        this.view.root,
        this.caption,
        h("div", { class: "controls" }, this.player, this.slider),
      ),
      h(
        "div",
        { class: "side" },
        h(
          "section",
          { class: "card" },
          state.request && h("p", {}, h("span", { class: "who" }, "The agent was asked to"), state.request),
          h("h2", { id: "ask" }, state.ask),
          state.stars ? this.rating(state.stars) : null,
          h("label", { for: "judgement" }, state.kind === "rate" ? "Anything to add? (not needed)" : "Your description"),
          this.field,
          this.sender,
          h("p", { class: "hint" }, "Watch to the end first; you can go back with the slider."),
        ),
      ),
    );
    this.seek(0);
    this.play(true);
  }

  update(): void {
    this.check();
  }

  private rating(many: number): HTMLElement {
    const group = h("div", { class: "stars", role: "radiogroup", "aria-labelledby": "ask" });
    for (let n = 1; n <= many; n++) {
      const input = h("input", { type: "radio", name: "stars", value: n, "aria-label": `${n} of ${many} stars` });
      input.addEventListener("change", () => {
        this.stars = n;
        [...group.children].forEach((c, k) => c.classList.toggle("on", k < n));
        this.check();
      });
      const star = s("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" }, s("path", { d: "M12 2l3 6.6 7.2.8-5.3 4.9 1.4 7.1L12 17.8 5.7 21.4l1.4-7.1L1.8 9.4 9 8.6z" }));
      group.append(h("label", {}, input, star));
    }
    return group;
  }

  private seek(at: number): void {
    const { frames } = this.state;
    this.at = Math.max(0, Math.min(frames.length - 1, at));
    this.furthest = Math.max(this.furthest, this.at);
    const frame = frames[this.at]!;
    this.view.look(frame.yaw, frame.pitch);
    void this.view.show(frame.pano);
    prefetch(frames.slice(this.at + 1, this.at + 4).map((f) => f.pano));
    this.slider.value = String(this.at);
    this.caption.textContent = frame.text;
    this.check();
  }

  private play(on: boolean): void {
    clearInterval(this.timer);
    this.timer = 0;
    const last = this.state.frames.length - 1;
    if (on) {
      if (this.at === last) this.seek(0);
      this.timer = window.setInterval(() => {
        if (!this.root.isConnected || this.at >= last) return this.play(false);
        this.seek(this.at + 1);
      }, SECONDS);
    }
    this.player.textContent = on ? "Pause" : this.at === last ? "Again" : "Play";
  }

  private check(): void {
    const watched = this.furthest === this.state.frames.length - 1;
    const said = this.state.kind === "rate" ? this.stars > 0 : this.field.value.trim().length > 0;
    this.sender.disabled = !(watched && said);
  }
}
