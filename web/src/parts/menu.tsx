// A button that opens a list of buttons; Esc and a press elsewhere close it. A closed list stays: a file dialogue may hang on it.
import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";

export function Menu({ label, children, disabled }: { label: string; children: preact.ComponentChildren; disabled?: boolean }) {
  const open = useSignal(false);
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const close = (event: Event) => {
      if (!box.current?.contains(event.target as Node)) open.value = false;
    };
    document.addEventListener("pointerdown", close);
    return () => document.removeEventListener("pointerdown", close);
  }, []);
  const keys = (event: KeyboardEvent) => {
    const all = [...(box.current?.querySelectorAll<HTMLElement>(".list button:not(:disabled), .list a") ?? [])];
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape" && open.value) {
      open.value = false;
      box.current?.querySelector("button")?.focus();
    } else if (by && open.value) {
      all[(all.indexOf(document.activeElement as HTMLElement) + by + all.length) % all.length]?.focus();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div class="menu" ref={box} onKeyDown={keys}>
      <button aria-expanded={open.value} disabled={disabled} onClick={() => (open.value = !open.value)}>{label} <span aria-hidden="true">▾</span></button>
      <div class="list" hidden={!open.value} onClick={() => (open.value = false)}>{children}</div>
    </div>
  );
}
