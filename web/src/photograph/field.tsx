// A field that keeps what is typed until it is stated: Enter or leaving it states it, Esc takes it back. An answer that comes meanwhile does
// not overwrite it.
import { useSignal } from "@preact/signals";

export interface FieldProps {
  label?: string;
  /** What is known. */
  value: string;
  /** How it is written where it is not being edited, if shorter. */
  brief?: string;
  /** States it; false keeps the text, for it is wrong. */
  onState: (text: string) => boolean | void;
  isWrong?: (text: string) => boolean;
  class?: string;
  placeholder?: string;
  /** Of numbers by default. */
  mode?: "decimal" | "text";
}

export function Field({ label, value, brief, onState, isWrong, mode = "decimal", ...rest }: FieldProps) {
  const text = useSignal<string | null>(null);
  const isEdited = useSignal(false);
  const state = () => {
    isEdited.value = false;
    const typed = text.value;
    text.value = null;
    if (typed !== null && typed.trim() !== value && onState(typed.trim()) === false) text.value = typed;
  };
  return (
    <input
      {...rest}
      inputMode={mode}
      autocomplete="off"
      aria-label={label}
      aria-invalid={!!isWrong && text.value !== null && text.value.trim() !== "" && isWrong(text.value)}
      value={text.value ?? (isEdited.value ? value : brief ?? value)}
      onFocus={(event) => {
        isEdited.value = true;
        event.currentTarget.value = text.value ?? value;
        event.currentTarget.select();
      }}
      onInput={(event) => (text.value = event.currentTarget.value)}
      onBlur={state}
      onKeyDown={(event) => {
        if (event.key === "Escape") text.value = null;
        if (event.key === "Enter" || event.key === "Escape") event.currentTarget.blur();
        event.stopPropagation();
      }}
    />
  );
}
