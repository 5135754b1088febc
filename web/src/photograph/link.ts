// Commands to the program, one at a time and in order. While a point is dragged only its newest place waits; what was overtaken is dropped.
import { Problem, transport, type Stream } from "../transport";
import type { Command, View } from "../api/types";

interface Waiting {
  photo: number;
  command: Command;
  done: (view: View | null) => void;
  failed: (problem: Problem) => void;
}

/** Longer commands, which hold files, are posted: the program takes 64 kB by socket. */
const SOCKET_LETTERS = 16_000;

/** What a drag moves; none for a command that is no drag. */
function draggedBy({ photo, command }: Waiting): string | null {
  if (command.kind === "put_point" && command.drag) return `${photo} point ${command.name}`;
  if (command.kind === "move_measurement" && command.drag) return `${photo} measurement ${command.name} ${command.index}`;
  return null;
}

/** What the program says on the socket. */
interface Message {
  seq: number;
  changes?: Partial<View>;
  view?: View;
  error?: { kind: string; message: string };
}

/** What a link tells besides the answers to commands. */
export interface Listener {
  /** What is so now, where it is not the answer to a command: measured meanwhile, or changed by another page. */
  news: (view: View) => void;
  /** The program no longer has the session: it was started again, or let it go. */
  gone: () => void;
}

export class Link {
  private stream: Stream;
  private isConnected = false;
  private isClosed = false;
  private waiting: Waiting[] = [];
  private flying: (Waiting & { seq: number; bySocket: boolean }) | null = null;
  private seq = 0;
  /** The view that the messages of this connection make: each has what differs from the one before. */
  private told: View | null = null;

  constructor(readonly session: string, private readonly listener: Listener) {
    this.stream = transport.stream("/ws/session", { session, changes: "true" }, {
      connected: (is) => this.connected(is),
      text: (message) => this.answered(message as Message),
    });
  }

  close() {
    this.isClosed = true;
    this.stream.close();
  }

  /** Whether nothing is on its way. */
  get isIdle(): boolean {
    return !this.flying && this.waiting.length === 0;
  }

  /** The view after a command; null where a newer one of the same drag overtook it. */
  send(photo: number, command: Command): Promise<View | null> {
    return new Promise((done, failed) => {
      const one = { photo, command, done, failed };
      const key = draggedBy(one);
      const last = this.waiting.at(-1);
      if (key && last && draggedBy(last) === key) {
        last.done(null);
        this.waiting.pop();
      }
      this.waiting.push(one);
      this.next();
    });
  }

  private next() {
    const one = this.flying ? undefined : this.waiting.shift();
    if (!one) return;
    const seq = ++this.seq;
    const { photo, command } = one;
    const bySocket = this.isConnected && JSON.stringify(command).length < SOCKET_LETTERS;
    this.flying = { ...one, seq, bySocket };
    if (bySocket) this.stream.send({ seq, photo, command });
    else transport.command(this.session, photo, command, seq).then(({ view }) => this.finished(seq, view), (problem) => this.finished(seq, problem));
  }

  private answered({ seq, error, changes, view }: Message) {
    if (error) {
      // A program of before does not say which command it refuses: one is on its way at a time.
      return this.finished(seq || (this.flying?.seq ?? 0), new Problem(error.kind, error.message));
    }
    // A program of before sends whole views.
    this.told = view ?? ({ ...this.told, ...changes } as View);
    if (seq === 0) this.listener.news(this.told);
    else this.finished(seq, this.told);
  }

  private finished(seq: number, result: View | Problem) {
    const one = this.flying;
    if (!one || one.seq !== seq) return; // Stale.
    this.flying = null;
    if (result instanceof Problem) one.failed(result);
    else one.done(result);
    this.next();
  }

  /** Nobody knows whether a command on a torn connection was applied: the session says what is so. */
  private connected(is: boolean) {
    this.isConnected = is;
    this.told = null;
    if (is || this.isClosed) return;
    const one = this.flying;
    const photo = one?.bySocket ? one.photo : 0;
    // Also whether there still is a session to connect to.
    transport.view(this.session, photo).then(
      (view) => one?.bySocket && this.finished(one.seq, view),
      (problem: Problem) => {
        if (one?.bySocket) this.finished(one.seq, problem);
        if (problem.kind === "not_found" && !this.isClosed) this.listener.gone();
      },
    );
  }
}
