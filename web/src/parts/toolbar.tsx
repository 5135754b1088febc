// A row of buttons through which the arrow keys go.
export function Toolbar({ label, children }: { label: string; children: preact.ComponentChildren }) {
  const keys = (event: KeyboardEvent) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const bar = event.currentTarget as HTMLElement;
    if (!by || !(event.target instanceof HTMLButtonElement)) return;
    const all = [...bar.querySelectorAll<HTMLButtonElement>("button:not(:disabled)")];
    all[(all.indexOf(event.target) + by + all.length) % all.length]?.focus();
    event.preventDefault();
    event.stopPropagation();
  };
  return <div class="toolbar" role="toolbar" aria-label={label} onKeyDown={keys}>{children}</div>;
}
