// Sessions as the browser keeps them, so that a program that was started again, a closed laptop or a crash costs nothing: the last few, and the
// photographs they show, each by its hash. Whatever is written is written as a whole or not at all.

export interface KeptSession {
  /** Of the session in the program. */
  id: string;
  /** As the program saves it, with hashes instead of the photographs' files. */
  text: string;
  kept_ms: number;
  names: string[];
  hashes: string[];
  /** The session that took its place, where it was opened anew; it then has neither text nor photographs. */
  next?: string;
}

export type WholeSession = KeptSession & { photographs: Map<string, string> };

const NAME = "resight";
/** How many are kept: windows of one browser may work on several. */
const MOST_KEPT = 8;

let opened: Promise<IDBDatabase> | null = null;

function database(): Promise<IDBDatabase> {
  opened ??= new Promise((done, failed) => {
    const request = indexedDB.open(NAME, 2);
    request.onupgradeneeded = () => {
      [...request.result.objectStoreNames].forEach((name) => request.result.deleteObjectStore(name));
      request.result.createObjectStore("sessions");
      request.result.createObjectStore("photographs");
    };
    request.onsuccess = () => done(request.result);
    request.onerror = () => failed(request.error);
  });
  return opened;
}

function finished(transaction: IDBTransaction): Promise<void> {
  return new Promise((done, failed) => {
    transaction.oncomplete = () => done();
    transaction.onerror = transaction.onabort = () => failed(transaction.error);
  });
}

function got<T>(request: IDBRequest<T>): Promise<T> {
  return new Promise((done, failed) => {
    request.onsuccess = () => done(request.result);
    request.onerror = () => failed(request.error);
  });
}

/** Photographs of this page: what a session needs again is not asked of the program twice. */
const files = new Map<string, Blob>();

export async function hasPhotograph(sha256: string): Promise<boolean> {
  if (files.has(sha256)) return true;
  const store = (await database()).transaction("photographs").objectStore("photographs");
  return 0 < (await got(store.count(sha256)));
}

export async function keepPhotograph(sha256: string, file: Blob) {
  files.set(sha256, file);
  try {
    const transaction = (await database()).transaction("photographs", "readwrite");
    transaction.objectStore("photographs").put(file, sha256);
    await finished(transaction);
  } catch {
    // Private windows and full disks keep nothing: the session is then the program's alone.
  }
}

/** Keeps a session in place of an earlier state of it; of the others the newest stay, with the photographs that they show. */
export async function keep(session: KeptSession) {
  const transaction = (await database()).transaction(["sessions", "photographs"], "readwrite", { durability: "strict" });
  const photographs = transaction.objectStore("photographs");
  for (const sha256 of session.hashes) {
    const file = files.get(sha256);
    if (file) photographs.put(file, sha256);
  }
  transaction.objectStore("sessions").put(session, session.id);
  prune(transaction);
  await finished(transaction);
  [...files.keys()].filter((key) => !session.hashes.includes(key)).forEach((key) => files.delete(key));
}

/** Deletes all but the newest sessions, and photographs that none of those shows. */
function prune(transaction: IDBTransaction) {
  const [sessions, photographs] = [transaction.objectStore("sessions"), transaction.objectStore("photographs")];
  const all: IDBRequest<KeptSession[]> = sessions.getAll();
  all.onsuccess = () => {
    const newest = byAge(all.result);
    newest.splice(MOST_KEPT).forEach(({ id }) => sessions.delete(id));
    const shown = new Set(newest.flatMap(({ hashes }) => hashes));
    const keys = photographs.getAllKeys();
    keys.onsuccess = () => keys.result.filter((key) => !shown.has(String(key))).forEach((key) => photographs.delete(key));
  };
}

const byAge = (all: KeptSession[]) => all.sort((a, b) => b.kept_ms - a.kept_ms);

/** The session of this id, or else the newest, of which every photograph is there. */
export async function lastKept(id?: string): Promise<WholeSession | null> {
  try {
    const transaction = (await database()).transaction(["sessions", "photographs"]);
    const all = byAge(await got<KeptSession[]>(transaction.objectStore("sessions").getAll())).filter(({ next }) => !next);
    const own = all.filter((session) => session.id === id);
    for (const session of [...own, ...all]) {
      const photographs = await photographsOf(session);
      if (photographs) return { ...session, photographs };
    }
  } catch {
    // Private windows keep nothing.
  }
  return null;
}

/** Photographs of a session by their hashes, in base64; null where one is missing. */
async function photographsOf({ hashes }: KeptSession): Promise<Map<string, string> | null> {
  const store = (await database()).transaction("photographs").objectStore("photographs");
  const kept = await Promise.all(hashes.map((sha256) => got<Blob | undefined>(store.get(sha256))));
  const found = kept.map((blob, i) => blob ?? files.get(hashes[i]!));
  if (!found.every((file) => file)) return null;
  const encoded = await Promise.all(found.map(async (file, i) => [hashes[i]!, await base64(file!)] as const));
  return new Map(encoded);
}

/** The session that took the place of another one, where it was opened anew. */
export async function successorOf(id: string): Promise<string | null> {
  try {
    const store = (await database()).transaction("sessions").objectStore("sessions");
    return (await got<KeptSession | undefined>(store.get(id)))?.next ?? null;
  } catch {
    return null;
  }
}

/** Keeps a session under the id with which it was opened anew. */
export async function succeed({ id, text, names, hashes }: KeptSession, next: string) {
  try {
    const kept_ms = Date.now();
    const transaction = (await database()).transaction(["sessions", "photographs"], "readwrite");
    const sessions = transaction.objectStore("sessions");
    sessions.put({ id: next, text, kept_ms, names, hashes }, next);
    sessions.put({ id, text: "", kept_ms, names: [], hashes: [], next }, id);
    prune(transaction);
    await finished(transaction);
  } catch {
    // Private windows keep nothing.
  }
}

/** Forgets a session. */
export async function forget(id: string) {
  const transaction = (await database()).transaction(["sessions", "photographs"], "readwrite");
  transaction.objectStore("sessions").delete(id);
  prune(transaction);
  await finished(transaction);
}

function base64(blob: Blob): Promise<string> {
  return new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(String(reader.result).split(",", 2)[1] ?? "");
    reader.onerror = () => failed(reader.error);
    reader.readAsDataURL(blob);
  });
}

/** The session as one file: each photograph in the place of its hash. */
export function wholeSession(session: WholeSession): string {
  let sha256 = "";
  return session.text.split("\n").map((line) => {
    sha256 = /^sha256 = "([0-9a-f]{64})"$/.exec(line)?.[1] ?? sha256;
    return line === 'image_base64 = ""' ? `image_base64 = "${session.photographs.get(sha256) ?? ""}"` : line;
  }).join("\n");
}
