// A picture as the program sends it: the length of its header (4 bytes, the least significant first), the header (JSON), a JPEG.

/** Its header, and its pixels decoded. */
export async function pictured<Header>(message: ArrayBuffer): Promise<Header & { bitmap: ImageBitmap }> {
  const length = new DataView(message).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length))) as Header;
  const bitmap = await createImageBitmap(new Blob([new Uint8Array(message, 4 + length)], { type: "image/jpeg" }));
  return { ...header, bitmap };
}
