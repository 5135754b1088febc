// The session as the browser keeps it, so that a program that was started again, a closed laptop or a crash costs nothing: the last one, and the
// photographs it shows, each by its hash. Whatever is written is written as a whole or not at all.

export interface KeptSession {
  /** As the program saves it, with hashes instead of the photographs' files. */
  text: string;
  kept_ms: number;
  names: string[];
  hashes: string[];
}

const NAME = "resight";
const LAST = "last";

let opened: Promise<IDBDatabase> | null = null;

function database(): Promise<IDBDatabase> {
  opened ??= new Promise((done, failed) => {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => {
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

/** Keeps a session in place of the one before, and of the photographs those that it shows. */
export async function keep(session: KeptSession) {
  const transaction = (await database()).transaction(["sessions", "photographs"], "readwrite");
  transaction.objectStore("sessions").put(session, LAST);
  const photographs = transaction.objectStore("photographs");
  for (const sha256 of session.hashes) {
    const file = files.get(sha256);
    if (file) photographs.put(file, sha256);
  }
  const all = photographs.getAllKeys();
  all.onsuccess = () => all.result.filter((key) => !session.hashes.includes(String(key))).forEach((key) => photographs.delete(key));
  await finished(transaction);
  [...files.keys()].filter((key) => !session.hashes.includes(key)).forEach((key) => files.delete(key));
}

/** The session that was kept last, if all of its photographs are there. */
export async function lastKept(): Promise<(KeptSession & { photographs: Map<string, string> }) | null> {
  try {
    const transaction = (await database()).transaction(["sessions", "photographs"]);
    const session = await got<KeptSession | undefined>(transaction.objectStore("sessions").get(LAST));
    if (!session) return null;
    const store = transaction.objectStore("photographs");
    const blobs = await Promise.all(session.hashes.map((sha256) => got<Blob | undefined>(store.get(sha256))));
    const photographs = new Map<string, string>();
    for (const [i, blob] of blobs.entries()) {
      const file = blob ?? files.get(session.hashes[i]!);
      if (!file) return null;
      photographs.set(session.hashes[i]!, await base64(file));
    }
    return { ...session, photographs };
  } catch {
    return null;
  }
}

/** Forgets everything. */
export async function forget() {
  const transaction = (await database()).transaction(["sessions", "photographs"], "readwrite");
  transaction.objectStore("sessions").clear();
  transaction.objectStore("photographs").clear();
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
export function wholeSession(session: KeptSession & { photographs?: Map<string, string> }): string {
  let sha256 = "";
  return session.text.split("\n").map((line) => {
    sha256 = /^sha256 = "([0-9a-f]{64})"$/.exec(line)?.[1] ?? sha256;
    return line === 'image_base64 = ""' ? `image_base64 = "${session.photographs?.get(sha256) ?? ""}"` : line;
  }).join("\n");
}
