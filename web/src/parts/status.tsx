// A status is always colour, symbol and word.
import { statusWords } from "../texts/common";

export type Tone = "good" | "warn" | "bad" | "grey";

const KINDS: Record<string, { tone: Tone; symbol: string }> = {
  ok: { tone: "good", symbol: "✓" },
  ambiguous: { tone: "warn", symbol: "⇄" },
  inconsistent: { tone: "bad", symbol: "!" },
  degenerate: { tone: "grey", symbol: "∅" },
  implausible: { tone: "warn", symbol: "!" },
  not_found: { tone: "grey", symbol: "∅" },
  steady: { tone: "good", symbol: "✓" },
  tracking: { tone: "good", symbol: "✓" },
  checking: { tone: "warn", symbol: "…" },
  learning: { tone: "warn", symbol: "…" },
  drifted: { tone: "bad", symbol: "!" },
  undecided: { tone: "warn", symbol: "…" },
  stale: { tone: "grey", symbol: "▨" },
  old: { tone: "grey", symbol: "↺" },
};

/** The tone of a status word, for what is drawn in its colour. */
export function toneOf(word: string): Tone {
  return KINDS[word]?.tone ?? "grey";
}

export function Status({ word, text }: { word: string; text?: string }) {
  const { tone, symbol } = KINDS[word] ?? { tone: "grey", symbol: "∅" };
  return (
    <span class={`status ${tone}`} data-status={word}>
      <span class="symbol" aria-hidden="true">{symbol}</span>
      {text ?? statusWords[word] ?? word}
    </span>
  );
}

/** A sentence in the colour of what it means. `live` reads it aloud as it changes. */
export function Note({ tone, children, live }: { tone: Tone; children: preact.ComponentChildren; live?: boolean }) {
  return <p class={`note ${tone}`} role={live ? (tone === "bad" ? "alert" : "status") : undefined}>{children}</p>;
}
