// What the server says: embodied/serve/screens.py.

export interface Message {
  id: string;
  do: "consent" | "ready" | "leave" | "house" | "judge" | "moved" | "opened" | "closed" | "stopped" | "asked" | "answered";
  [name: string]: unknown;
}

export interface Base {
  screen: string;
  title: string;
  contact: string;
  progress: { done: number; total: number };
}

export interface Said {
  who: "agent" | "assistant";
  text: string;
  pano: string | null;
}

export interface Game extends Base {
  game: string;
  turn: number;
  practice: boolean;
  advice: string;
  request: string;
  said: Said[];
  question: string | null;
  yours: boolean;
  pano: string;
  yaw: number;
  pitch: number;
  partnerThere: boolean;
  live: string | null; // address of what is seen now, of somebody who drives
}

export interface Way {
  candidate: number; // of somebody who drives, all there is
  yaw: number;
  pitch: number;
  distance: number;
  pano: string;
}

export interface Door {
  candidate: number;
  event: "opened" | "closed"; // what a press does
  what: string;
  yaw: number;
}

export interface AgentScreen extends Game {
  screen: "agent";
  moves: Way[];
  doors: Door[];
  words: string[];
  instruction: string;
  subtask: boolean;
  target: string | null;
  canAsk: boolean;
  questions: { text: string; price: number }[];
  free: boolean;
  left: number | null;
  time: number;
  horizon: number;
}

export interface AssistantScreen extends Game {
  screen: "assistant";
  house: string;
  node: number;
  trail: number[];
  goals: number[];
  way: number[];
  sendPictures: boolean;
}

export interface House {
  name: string;
  rooms: { kind: string; outline: [number, number][]; floor: number }[];
  doors: { line: [[number, number], [number, number]]; floor: number }[];
  nodes: [number, number][];
  floors: number[];
  edges: [number, number][];
  panos: string[];
}

export interface JudgeScreen extends Base {
  screen: "judge";
  kind: "rate" | "describe";
  advice: string;
  ask: string;
  stars: number;
  unit: string;
  request: string | null;
  frames: { pano: string; yaw: number; pitch: number; text: string }[];
}

export interface Plain extends Base {
  screen: "consent" | "ready" | "wait" | "done" | "refused" | "results";
  text?: string;
  last?: string | null;
  advice?: string;
  role?: string | null;
  practise?: boolean;
  thanks?: string;
  code?: string | null;
  why?: string;
  elsewhere?: boolean;
  people?: Record<string, number>;
  dropout?: number | null;
  parts?: Record<string, string | number | null>[];
}

export type Screen = AgentScreen | AssistantScreen | JudgeScreen | Plain;
