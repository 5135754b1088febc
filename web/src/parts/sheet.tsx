// The panel beside what is shown. On narrow screens it is a sheet with a handle: a press steps through its heights, a pull sets one.
import { signal, type Signal } from "@preact/signals";
import { useMemo, useRef } from "preact/hooks";
import { sheetTexts } from "../texts/common";

export type Pull = "low" | "middle" | "high";
const ORDER: Pull[] = ["low", "middle", "high"];

export interface SheetProps {
  label: string;
  children: preact.ComponentChildren;
  pull?: Signal<Pull>;
  /** What is seen of it beside the handle, even where it is low. */
  summary?: preact.ComponentChildren;
  /** What waits for an answer: it stays in view however far the sheet is scrolled, and where it is low. */
  asks?: preact.ComponentChildren;
}

export function Sheet({ label, children, pull, summary, asks }: SheetProps) {
  const height = useMemo(() => pull ?? signal<Pull>("middle"), [pull]);
  const from = useRef<number | null>(null);
  const step = (by: number) => {
    const at = ORDER.indexOf(height.value) + by;
    height.value = ORDER[Math.max(0, Math.min(ORDER.length - 1, at))]!;
  };
  const released = (event: PointerEvent) => {
    const by = from.current === null ? 0 : from.current - event.clientY;
    from.current = null;
    if (24 < Math.abs(by)) step(Math.sign(by) * (200 < Math.abs(by) ? 2 : 1));
    else height.value = height.value === "high" ? "low" : ORDER[ORDER.indexOf(height.value) + 1]!;
  };
  return (
    <aside class="sheet" aria-label={label} data-pull={height.value} tabIndex={0}>
      <button
        class="handle"
        title={sheetTexts.handle}
        aria-expanded={height.value !== "low"}
        onPointerDown={(event) => {
          from.current = event.clientY;
          (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
        }}
        onPointerUp={released}
        onPointerCancel={() => (from.current = null)}
        onKeyDown={(event) => {
          if (event.key === "ArrowUp") step(1);
          else if (event.key === "ArrowDown") step(-1);
          else if (event.key === "Enter" || event.key === " ") height.value = height.value === "high" ? "low" : ORDER[ORDER.indexOf(height.value) + 1]!;
          else return;
          event.preventDefault();
        }}
      >
        <span class="grip" aria-hidden="true" />
        <span class="visually-hidden">{sheetTexts.handle}</span>
        {summary}
      </button>
      <div class="body">{children}</div>
      <div class="asks">{asks}</div>
    </aside>
  );
}
