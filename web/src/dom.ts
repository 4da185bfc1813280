// Elements. Text is only ever set as text, so nothing that people write can become markup.

type Child = Node | string | null | undefined | false;
type Attributes = Record<string, string | number | boolean | null | undefined | EventListener>;

function fill<E extends Element>(element: E, attributes: Attributes, children: Child[]): E {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name, value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children) if (child) element.append(child);
  return element;
}

/** An HTML element with attributes, listeners (functions) and children. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  return fill(document.createElement(tag), attributes, children);
}

/** The same for SVG. */
export function s(tag: string, attributes: Attributes = {}, ...children: Child[]): SVGElement {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag) as SVGElement, attributes, children);
}

/** A button. */
export function button(text: string, click: () => void, kind = "", attributes: Attributes = {}): HTMLButtonElement {
  return h("button", { type: "button", class: kind, click, ...attributes }, text);
}

/** Paragraphs of a text, parted by empty lines. */
export function paragraphs(text: string): HTMLElement {
  return h("div", { class: "prose" }, ...text.trim().split(/\n\s*\n/).map((p) => h("p", {}, p)));
}

/** Says something to screen readers, and to everybody at the lower edge when `visible`. */
export function say(text: string, visible = false): void {
  const status = document.getElementById("status")!;
  status.textContent = text;
  status.className = visible && text ? "shown" : "";
}

/** The name under which this page stores something: studies at one host, under paths of their own, share nothing. */
export const stored = (name: string): string => `embodied${location.pathname}${name}`;
