// The frame around everything: name, tabs, and the actions that the open tab puts beside them.
import { useEffect, useRef, useState } from "preact/hooks";
import { Dialog } from "./parts/dialog";
import { Note } from "./parts/status";
import { tabTexts, tokenTexts } from "./texts/common";
import { TAB_NAMES, actionsPlace, tab } from "./tabs";
import { needsToken, useToken } from "./transport";
import { Photograph } from "./photograph";
import { Live } from "./live";
import { Rig } from "./rig";
import { Whisker } from "./whisker";

const TABS = { photograph: Photograph, live: Live, rig: Rig, whisker: Whisker };

export function Shell() {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    actionsPlace.value = place.current;
  }, []);
  const Tab = TABS[tab.value];
  return (
    <>
      <header class="bar">
        <span class="brand">Resight</span>
        <nav class="tabs" role="tablist" aria-label={tabTexts.label} onKeyDown={arrows}>
          {TAB_NAMES.map((name) => (
            <button
              key={name}
              role="tab"
              id={`tab-${name}`}
              aria-selected={tab.value === name}
              aria-controls="content"
              tabIndex={tab.value === name ? 0 : -1}
              onClick={() => (tab.value = name)}
            >
              {tabTexts[name]}
            </button>
          ))}
        </nav>
        <span class="spring" />
        <div class="row tight" ref={place} />
      </header>
      <main>
        <div id="content" class="content" role="tabpanel" aria-labelledby={`tab-${tab.value}`}>
          <Tab />
        </div>
      </main>
      {needsToken.value && <TokenDialog />}
    </>
  );
}

function arrows(event: KeyboardEvent) {
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (!by) return;
  const at = TAB_NAMES.indexOf(tab.value);
  tab.value = TAB_NAMES[(at + by + TAB_NAMES.length) % TAB_NAMES.length]!;
  document.getElementById(`tab-${tab.value}`)?.focus();
  event.preventDefault();
}

function TokenDialog() {
  const [token, set] = useState("");
  return (
    <Dialog title={tokenTexts.title} onClose={() => {}}>
      <form
        class="column"
        onSubmit={(event) => {
          event.preventDefault();
          useToken(token.trim());
        }}
      >
        <p>{tokenTexts.explain}</p>
        {needsToken.value === "wrong" && <Note tone="bad" live>{tokenTexts.wrong}</Note>}
        <label>
          {tokenTexts.label}
          <input type="password" autocomplete="off" value={token} onInput={(event) => set(event.currentTarget.value)} />
        </label>
        <button class="main" disabled={!token.trim()}>{tokenTexts.use}</button>
      </form>
    </Dialog>
  );
}
