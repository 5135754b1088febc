// The only place where the page talks to the program. `Transport` says what it can ask; `Http` asks over HTTP and WebSockets.
import { signal } from "@preact/signals";
import { common } from "./texts/common";
import type { CaptureView, Command, LiveView, NumberedView, Open, Opened, View } from "./api/types";

/** What the program refused, or that it does not answer. `message` is a sentence for the person. */
export class Problem extends Error {
  constructor(readonly kind: string, message: string) {
    super(message);
  }
}

export interface NamedBlob {
  name: string;
  blob: Blob;
}

/** A socket that connects again by itself until it is closed. */
export interface Stream {
  /** Sends, if it is connected. */
  send(message: object): void;
  close(): void;
}

export interface StreamListener {
  /** A message of text, parsed. */
  text?: (message: unknown) => void;
  /** A binary message. */
  binary?: (message: ArrayBuffer) => void;
  /** Whether it is connected. */
  connected?: (is: boolean) => void;
}

export interface Transport {
  /** Any route that answers JSON. */
  get<T>(path: string, query?: Query): Promise<T>;
  post<T>(path: string, body: unknown, query?: Query): Promise<T>;
  /** Any route that answers a file. */
  file(path: string, query?: Query): Promise<NamedBlob>;
  /** A WebSocket of the program, such as `/ws/live`. */
  stream(path: string, query: Query, listener: StreamListener): Stream;

  open(what: Open): Promise<Opened>;
  view(session: string, photo: number): Promise<View>;
  command(session: string, photo: number, command: Command, seq: number): Promise<NumberedView>;
  addPhotograph(session: string, file: Blob, name: string, progress?: (share: number) => void): Promise<View>;
  photograph(session: string, photo: number): Promise<Blob>;
  save(session: string): Promise<NamedBlob>;
  exported(session: string, photo: number, format: string): Promise<NamedBlob>;
  birdseye(session: string, photo: number): Promise<Blob>;
  /** Gives up what is being changed. */
  cancel(session: string): Promise<void>;
  /** Names of the cameras that the program watches. */
  cameras(): Promise<string[]>;
  live(): Promise<LiveView>;
  /** The capture of intrinsics; null where the program runs none. */
  capture(): Promise<CaptureView | null>;
}

/** Keys without a value are left out. */
export type Query = Record<string, string | number | undefined>;

/** How often a stream looks at the clock, and a gap in which the machine must have slept, ms: browsers let pages in the background wait a minute. */
const BEAT_MS = 5000;
const SLEPT_MS = 90_000;

const TOKEN = "resight token";

/** Whether the program wants a token, and whether the one it got was wrong. */
export const needsToken = signal<false | "missing" | "wrong">(false);

/** Uses a token until the browser's tab is closed. */
export function useToken(token: string) {
  sessionStorage.setItem(TOKEN, token);
  needsToken.value = false;
  location.reload();
}

function authorization(): Record<string, string> {
  const token = sessionStorage.getItem(TOKEN);
  return token ? { Authorization: `Bearer ${token}` } : {};
}

function address(path: string, query: Query = {}): string {
  const words = new URLSearchParams(Object.entries(query).filter(([, value]) => value !== undefined).map(([key, value]) => [key, String(value)]));
  return words.size ? `${path}?${words}` : path;
}

function refused(status: number, text: string): Problem {
  if (status === 401) needsToken.value = sessionStorage.getItem(TOKEN) ? "wrong" : "missing";
  try {
    const { kind, message } = JSON.parse(text).error;
    return new Problem(kind, message);
  } catch {
    return new Problem("failed", `${common.problem} (${status}).`);
  }
}

async function ask(path: string, init: RequestInit, query?: Query): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(address(path, query), { ...init, headers: { ...init.headers, ...authorization() } });
  } catch {
    throw new Problem("connection", common.noConnection);
  }
  if (!response.ok) throw refused(response.status, await response.text());
  return response;
}

class Http implements Transport {
  async get<T>(path: string, query?: Query): Promise<T> {
    return (await ask(path, {}, query)).json();
  }

  async post<T>(path: string, body: unknown, query?: Query): Promise<T> {
    const init = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    return (await ask(path, init, query)).json();
  }

  async file(path: string, query?: Query): Promise<NamedBlob> {
    const response = await ask(path, {}, query);
    const name = /filename="([^"]*)"/.exec(response.headers.get("Content-Disposition") ?? "")?.[1] ?? "file";
    return { name, blob: await response.blob() };
  }

  stream(path: string, query: Query, listener: StreamListener): Stream {
    let socket: WebSocket | null = null;
    let wait = 250;
    let timer = 0;
    let isClosed = false;
    let beat = Date.now();
    // A machine that slept does not learn by itself that its connections are gone.
    const watch = window.setInterval(() => {
      if (SLEPT_MS < Date.now() - beat) socket?.close();
      beat = Date.now();
    }, BEAT_MS);
    const connect = () => {
      const token = sessionStorage.getItem(TOKEN);
      socket = new WebSocket(address(path, query), token ? ["resight", `bearer.${token}`] : ["resight"]);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => {
        wait = 250;
        listener.connected?.(true);
      };
      socket.onmessage = ({ data }) => {
        if (typeof data === "string") listener.text?.(JSON.parse(data));
        else listener.binary?.(data);
      };
      socket.onclose = () => {
        listener.connected?.(false);
        if (isClosed) return;
        timer = window.setTimeout(connect, wait);
        wait = Math.min(2 * wait, 8000);
      };
    };
    connect();
    return {
      send: (message) => {
        if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
      },
      close: () => {
        isClosed = true;
        clearTimeout(timer);
        clearInterval(watch);
        socket?.close();
      },
    };
  }

  open(what: Open): Promise<Opened> {
    return this.post("/api/session", what);
  }

  view(session: string, photo: number): Promise<View> {
    return this.get("/api/session/view", { session, photo });
  }

  command(session: string, photo: number, command: Command, seq: number): Promise<NumberedView> {
    return this.post("/api/session/command", { seq, photo, command }, { session });
  }

  /** With XMLHttpRequest: fetch does not say how much has been sent. */
  addPhotograph(session: string, file: Blob, name: string, progress?: (share: number) => void): Promise<View> {
    return new Promise((done, failed) => {
      const request = new XMLHttpRequest();
      request.open("POST", address("/api/session/photograph", { session, name }));
      request.setRequestHeader("Content-Type", file.type === "image/jpeg" ? "image/jpeg" : "image/png");
      Object.entries(authorization()).forEach(([key, value]) => request.setRequestHeader(key, value));
      request.upload.onprogress = (event) => progress?.(event.loaded / event.total);
      request.onload = () => (request.status === 200 ? done(JSON.parse(request.responseText)) : failed(refused(request.status, request.responseText)));
      request.onerror = () => failed(new Problem("connection", common.noConnection));
      request.send(file);
    });
  }

  async photograph(session: string, photo: number): Promise<Blob> {
    return (await this.file("/api/session/photograph", { session, photo })).blob;
  }

  save(session: string): Promise<NamedBlob> {
    return this.file("/api/session/save", { session });
  }

  exported(session: string, photo: number, format: string): Promise<NamedBlob> {
    return this.file("/api/session/export", { session, photo, format });
  }

  async birdseye(session: string, photo: number): Promise<Blob> {
    return (await this.file("/api/session/birdseye", { session, photo })).blob;
  }

  async cancel(session: string): Promise<void> {
    await this.post("/api/session/cancel", {}, { session });
  }

  cameras(): Promise<string[]> {
    return this.get("/api/live/cameras");
  }

  live(): Promise<LiveView> {
    return this.get("/api/live");
  }

  capture(): Promise<CaptureView | null> {
    return this.get("/api/capture");
  }
}

export const transport: Transport = new Http();
