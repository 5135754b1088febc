// A decoded picture with smaller copies, so that a large photograph is drawn quickly at every zoom. The pixels stay as they are in the file.
import type { Transform, Turns } from "./transform";

export interface Picture {
  width: number;
  height: number;
  /** Each half as large as the one before. */
  levels: ImageBitmap[];
  /** How its EXIF says that the camera was held. */
  turns: Turns;
}

/** Decodes a PNG or JPEG file. */
export async function decodePicture(blob: Blob): Promise<Picture> {
  const bytes = new Uint8Array(await blob.arrayBuffer());
  const turns = upright(bytes);
  const whole = await createImageBitmap(new Blob([bytes], { type: blob.type }));
  const levels = [whole];
  for (let last = whole; 1000 < Math.max(last.width, last.height); levels.push(last)) {
    const half = { resizeWidth: Math.ceil(last.width / 2), resizeHeight: Math.ceil(last.height / 2) };
    last = await createImageBitmap(last, { ...half, resizeQuality: "medium" });
  }
  return { width: whole.width, height: whole.height, levels, turns };
}

/** Draws a picture through a transform, in screen pixels of `ratio` device pixels each. */
export function drawPicture(context: CanvasRenderingContext2D, picture: Picture, t: Transform, ratio: number) {
  const wanted = t.scale * ratio;
  let level = 0;
  while (level + 1 < picture.levels.length && wanted < 0.5 ** (level + 1)) level++;
  const bitmap = picture.levels[level]!;
  const c = [1, 0, -1, 0][t.turns]! * wanted;
  const s = [0, 1, 0, -1][t.turns]! * wanted;
  context.setTransform(c, s, -s, c, t.x * ratio, t.y * ratio);
  context.imageSmoothingEnabled = wanted < 3;
  context.imageSmoothingQuality = "medium";
  context.drawImage(bitmap, -0.5, -0.5, picture.width, picture.height);
}

/** Sets the orientation in a JPEG's EXIF to "as it is", so that no browser turns it, and says what it was. */
export function upright(bytes: Uint8Array): Turns {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 4 || view.getUint16(0) !== 0xffd8) return 0;
  for (let at = 2; at + 10 < bytes.length && bytes[at] === 0xff; at += 2 + view.getUint16(at + 2)) {
    if (bytes[at + 1] === 0xda) return 0;
    if (bytes[at + 1] !== 0xe1 || view.getUint32(at + 4) !== 0x45786966) continue;
    return orientation(view, at + 10, at + 2 + view.getUint16(at + 2));
  }
  return 0;
}

function orientation(view: DataView, tiff: number, end: number): Turns {
  if (Math.min(end, view.byteLength) < tiff + 10) return 0;
  const little = view.getUint16(tiff) === 0x4949;
  const directory = tiff + view.getUint32(tiff + 4, little);
  if (Math.min(end, view.byteLength) < directory + 2) return 0;
  const n = view.getUint16(directory, little);
  for (let i = 0; i < n; i++) {
    const entry = directory + 2 + 12 * i;
    if (Math.min(end, view.byteLength) < entry + 12) return 0;
    if (view.getUint16(entry, little) !== 0x0112) continue;
    const turns = ({ 3: 2, 6: 1, 8: 3 } as Record<number, Turns>)[view.getUint16(entry + 8, little)] ?? 0;
    view.setUint16(entry + 8, 1, little);
    return turns;
  }
  return 0;
}
