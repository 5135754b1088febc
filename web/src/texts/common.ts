// Every word that more than one part of the page uses.
export const tabTexts = {
  photograph: "Photograph",
  live: "Live",
  rig: "Rig",
  whisker: "Whisker",
  label: "What to do",
};

/** Status words as people read them. */
export const statusWords: Record<string, string> = {
  ok: "ok",
  ambiguous: "ambiguous",
  inconsistent: "inconsistent",
  degenerate: "degenerate",
  implausible: "implausible",
  not_found: "not found",
  undecided: "undecided",
  steady: "steady",
  tracking: "tracking",
  checking: "checking",
  learning: "learning",
  drifted: "moved",
  stale: "stale",
  old: "old",
};

export const sheetTexts = { handle: "Make the panel higher or lower" };

export const common = {
  cancel: "Cancel",
  close: "Close",
  save: "Save",
  undo: "Undo",
  redo: "Redo",
  loading: "One moment …",
  problem: "This could not be done",
  noConnection: "The program does not answer. Start `resight serve` again; the page connects by itself.",
};

export const tokenTexts = {
  title: "A token is needed",
  explain: "Whoever started the program has it: the first line of the file named by --token-file.",
  label: "Token",
  use: "Use it",
  wrong: "The program does not know this token.",
};

/** Address of a page of the book. */
export function book(page: string): string {
  return `https://github.com/resight/resight/blob/main/docs/${page}`;
}

/** A sentence of the program as one of the page: capital letter and full stop. */
export function sentence(text: string): string {
  const first = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(first) ? first : `${first}.`;
}

export function helpOn(title: string): string {
  return `What is ${title.toLowerCase()}?`;
}
