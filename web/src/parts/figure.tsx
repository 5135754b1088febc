// A number with its ± and a "?" that explains it in a sentence and names the page of the book.
import { useSignal } from "@preact/signals";
import { useId } from "preact/hooks";
import { book, helpOn } from "../texts/common";

export interface FigureProps {
  title: string;
  /** `6.21 ± 0.04 m` */
  words: string;
  help?: string;
  /** Page of the book, such as `measuring.md`. */
  link?: string;
  name?: string;
}

export function Figure({ title, words, help, link, name }: FigureProps) {
  const open = useSignal(false);
  const id = useId();
  return (
    <div class="figure" data-figure={name}>
      <span class="title">{title}</span>
      <span class="value"><PlusMinus words={words} /></span>
      {help ? (
        <button class="question" aria-label={helpOn(title)} aria-expanded={open.value} aria-controls={id} onClick={() => (open.value = !open.value)}>
          <span aria-hidden="true">?</span>
        </button>
      ) : <span />}
      {help && (
        <p class="help" id={id} hidden={!open.value}>
          {help} {link && <a href={book(link)} target="_blank" rel="noreferrer">{link.replace(".md", "")}</a>}
        </p>
      )}
    </div>
  );
}

/** A number in bold, and its ± not. */
export function PlusMinus({ words }: { words: string }) {
  const [value, more] = words.split(" ± ");
  return <>{value}{more && <span class="more"> ± {more}</span>}</>;
}
