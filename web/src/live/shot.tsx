// A camera's newest picture with the outline of what was found, as wide as there is room.
import { effect, type ReadonlySignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { colours } from "../parts/theme";
import { liveTexts } from "../texts/live";
import type { Shot } from "./store";

export function ShotCanvas({ shot, name }: { shot: ReadonlySignal<Shot | undefined>; name: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => effect(() => {
    if (shot.value && canvas.current) draw(canvas.current, shot.value, colours.value.accent);
  }), [shot]);
  return <canvas ref={canvas} role="img" aria-label={liveTexts.picture(name)} width={640} height={480} />;
}

function draw(canvas: HTMLCanvasElement, shot: Shot, colour: string) {
  const { bitmap } = shot;
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
  const pen = canvas.getContext("2d");
  if (!pen || !bitmap.width) return;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.drawImage(bitmap, 0, 0);
  // Pixel (0, 0) of the frame is the centre of its first.
  const scale = bitmap.width / shot.width_px;
  pen.setTransform(scale, 0, 0, scale, 0.5 * scale, 0.5 * scale);
  outline(pen, shot.outline, (x) => x, colour, 2 / scale);
  canvas.dataset.frame = String(shot.frame);
}

type Place = readonly [number, number];

/** Light under colour, so that it is seen on any picture. */
export function outline(pen: CanvasRenderingContext2D, lines: Place[][], place: (x: Place) => Place, colour: string, width: number) {
  pen.lineJoin = "round";
  for (const [ink, by] of [["#ffffff", 2.4], [colour, 1]] as const) {
    pen.strokeStyle = ink;
    pen.lineWidth = width * by;
    pen.beginPath();
    for (const line of lines) line.forEach((x, i) => (i ? pen.lineTo(...place(x)) : pen.moveTo(...place(x))));
    pen.stroke();
  }
}
