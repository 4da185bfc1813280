// The connection: what was sent is kept until the server has it on disk, over reconnects and reloads.

import { say, stored } from "./dom";
import type { Message, Screen } from "./types";

const OUTBOX = stored("outbox");
const TOKEN = stored("token");
const JOIN = stored("join");

export class Connection {
  private socket: WebSocket | null = null;
  private outbox: Message[] = JSON.parse(sessionStorage.getItem(OUTBOX) ?? "[]");
  private tries = 0;
  private stopped = false;

  constructor(
    private readonly show: (screen: Screen) => void,
    private readonly house: (house: never) => void,
    private readonly word: { join?: string; results?: string },
  ) {
    if (word.join) localStorage.setItem(JOIN, word.join);
    window.addEventListener("online", () => this.open());
    document.addEventListener("visibilitychange", () => !document.hidden && this.open());
    this.open();
  }

  /** Sends a message, now or as soon as there is a connection; it counts once however often it is sent. */
  send(message: Omit<Message, "id">): void {
    const whole = { id: crypto.randomUUID?.() ?? String(Math.random()).slice(2), ...message } as Message;
    this.outbox.push(whole);
    this.keep();
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(whole));
  }

  /** Connects, where there is no connection and none was refused. */
  open(again = false): void {
    if (again) this.stopped = false;
    if (this.stopped || (this.socket && this.socket.readyState <= WebSocket.OPEN)) return;
    const address = new URL("ws", location.href); // relative, as all that the page fetches
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    this.socket = socket;
    socket.onopen = () => {
      const hello = this.word.results
        ? { admin: this.word.results }
        : { token: localStorage.getItem(TOKEN), join: localStorage.getItem(JOIN) };
      socket.send(JSON.stringify(hello));
    };
    socket.onmessage = (event) => this.receive(JSON.parse(event.data as string));
    socket.onclose = () => {
      if (this.stopped || this.socket !== socket) return;
      if (this.tries > 0) say("The connection is lost. Trying again; nothing that you sent is lost.", true);
      setTimeout(() => this.open(), Math.min(500 * 2 ** this.tries++, 8000));
    };
  }

  private receive(message: { token?: string; ack?: string; error?: string; plan?: never } & Screen): void {
    if (message.token) {
      localStorage.setItem(TOKEN, message.token);
      if (this.tries > 0) say("Connected again.");
      this.tries = 0;
      for (const waiting of this.outbox) this.socket?.send(JSON.stringify(waiting));
    } else if (message.ack !== undefined) {
      this.outbox = this.outbox.filter((m) => m.id !== message.ack);
      this.keep();
      if (message.error) say(`That did not work: ${message.error}.`, true);
      else say("");
    } else if (message.plan) {
      this.house(message.plan);
    } else {
      if (message.screen === "refused") this.stopped = true;
      this.show(message);
    }
  }

  private keep(): void {
    sessionStorage.setItem(OUTBOX, JSON.stringify(this.outbox));
  }
}
