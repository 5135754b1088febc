// One of the numbered steps, with what is wrong or missing in it.
import { Note } from "../../parts/status";
import { photographTexts as texts } from "../../texts/photograph";
import { error, view } from "../store";

export type StepName = keyof typeof texts.steps;

interface StepProps {
  n: number;
  name: StepName;
  done: boolean;
  summary?: preact.ComponentChildren;
  children?: preact.ComponentChildren;
}

export function Step({ n, name, done, summary, children }: StepProps) {
  const missing = view.value?.missing.filter((one) => one.step === name) ?? [];
  const refusal = view.value?.refusal?.step === name ? view.value.refusal.text : null;
  const wrong = error.value?.step === name ? error.value.text : null;
  return (
    <section class="step" data-step={name} data-done={done} aria-label={texts.steps[name]}>
      <header>
        <span class="n" aria-hidden="true">{done ? "✓" : n}</span>
        <h2>{texts.steps[name]}</h2>
        {summary && <span class="cut">{summary}</span>}
      </header>
      {children}
      {wrong && <Note tone="bad" live>{wrong}</Note>}
      {refusal && refusal !== wrong && <Note tone="warn" live>{refusal}</Note>}
      {!wrong && !refusal && missing.map((one) => <p key={one.text} class="quiet small">{one.text}</p>)}
    </section>
  );
}
