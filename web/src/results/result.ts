// A result from files: asked of the program, kept while tabs change. A refusal leaves the last good one where it is.
import { signal } from "@preact/signals";
import { Problem, transport } from "../transport";
import { common } from "../texts/common";

/** Largest request of these routes, bytes, and the most files. */
const MOST_BYTES = 32 * 2 ** 20;
const MOST_FILES = 16;

export interface ResultTexts {
  tooLarge: (mb: number) => string;
  tooMany: (n: number) => string;
}

export class Result<T> {
  readonly value = signal<T | null>(null);
  readonly problem = signal<string | null>(null);
  readonly busy = signal(false);
  private asked = 0;

  constructor(private readonly path: string, private readonly texts: ResultTexts) {}

  async take(files: File[]) {
    const bytes = files.reduce((sum, file) => sum + file.size, 0);
    if (MOST_FILES < files.length) this.problem.value = this.texts.tooMany(files.length);
    else if (MOST_BYTES < bytes) this.problem.value = this.texts.tooLarge(Math.ceil(bytes / 2 ** 20));
    else await this.ask(async () => ({ files: await Promise.all(files.map(async (file) => ({ name: file.name, text: await file.text() }))) }));
  }

  example() {
    return this.ask(async () => ({ example: true }));
  }

  close() {
    this.asked += 1;
    this.value.value = null;
    this.problem.value = null;
  }

  /** The newest question wins. */
  private async ask(body: () => Promise<object>) {
    const mine = ++this.asked;
    this.busy.value = true;
    try {
      const value = await transport.post<T>(this.path, await body());
      if (mine !== this.asked) return;
      this.value.value = value;
      this.problem.value = null;
    } catch (fault) {
      if (mine === this.asked) this.problem.value = fault instanceof Problem ? fault.message : `${common.problem}.`;
    } finally {
      if (mine === this.asked) this.busy.value = false;
    }
  }
}
