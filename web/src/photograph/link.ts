// Commands to the program, one at a time and in order. While a point is dragged only its newest place waits; what was overtaken is dropped.
import { Problem, transport, type Stream } from "../transport";
import type { Command, NumberedView, View } from "../api/types";

interface Waiting {
  photo: number;
  command: Command;
  done: (view: View | null) => void;
  failed: (problem: Problem) => void;
}

/** What a drag moves; none for a command that is no drag. */
function draggedBy({ photo, command }: Waiting): string | null {
  if (command.kind === "put_point" && command.drag) return `${photo} point ${command.name}`;
  if (command.kind === "move_measurement" && command.drag) return `${photo} measurement ${command.name} ${command.index}`;
  return null;
}

export class Link {
  private stream: Stream;
  private isConnected = false;
  private waiting: Waiting[] = [];
  private flying: (Waiting & { seq: number; bySocket: boolean }) | null = null;
  private seq = 0;

  constructor(readonly session: string) {
    this.stream = transport.stream("/ws/session", { session }, {
      connected: (is) => this.connected(is),
      text: (message) => this.answered(message as NumberedView & { error?: { kind: string; message: string } }),
    });
  }

  close() {
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
    this.flying = { ...one, seq, bySocket: this.isConnected };
    const { photo, command } = one;
    if (this.isConnected) this.stream.send({ seq, photo, command });
    else transport.command(this.session, photo, command, seq).then(({ view }) => this.finished(seq, view), (problem) => this.finished(seq, problem));
  }

  private answered(message: NumberedView & { error?: { kind: string; message: string } }) {
    if (!this.flying?.bySocket) return;
    if (message.error) this.finished(this.flying.seq, new Problem(message.error.kind, message.error.message));
    else this.finished(message.seq, message.view);
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
    const one = this.flying;
    if (is || !one?.bySocket) return;
    transport.view(this.session, one.photo).then((view) => this.finished(one.seq, view), (problem) => this.finished(one.seq, problem));
  }
}
