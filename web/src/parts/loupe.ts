// A loupe: the picture eight times as large, beside a pointer and never under a finger.
import { type Picture } from "./picture";
import { type Point, type Transform } from "./transform";

const TIMES = 8;
const RADIUS = 64;
/** Side of the piece of the picture that is kept at hand, px: drawing from a picture of 12 megapixels takes 50 ms, from a piece nothing. */
const PIECE = 512;

interface Piece {
  canvas: OffscreenCanvas;
  left: number;
  top: number;
}

const pieces = new WeakMap<Picture, Piece>();

/** A piece of the picture that holds a square, cut anew only where the last one does not. */
function pieceWith(picture: Picture, left: number, top: number, side: number): Piece {
  const known = pieces.get(picture);
  const holds = (from: number, at: number) => from <= at && at + side <= from + PIECE;
  if (known && holds(known.left, left) && holds(known.top, top)) return known;
  const middle = Math.round((PIECE - side) / 2);
  const piece = { canvas: known?.canvas ?? new OffscreenCanvas(PIECE, PIECE), left: left - middle, top: top - middle };
  const context = piece.canvas.getContext("2d")!;
  context.clearRect(0, 0, PIECE, PIECE);
  context.drawImage(picture.levels[0]!, -piece.left, -piece.top);
  pieces.set(picture, piece);
  return piece;
}

/** Draws the loupe for a pixel of the picture that lies at `screen`. */
export function drawLoupe(
  context: CanvasRenderingContext2D,
  picture: Picture,
  t: Transform,
  at: Point,
  screen: Point,
  size: { width: number; height: number },
  colour: string,
) {
  const apart = RADIUS + 48;
  const above = screen[1] - apart - RADIUS < 0;
  const x = Math.max(RADIUS + 8, Math.min(size.width - RADIUS - 8, screen[0] + (screen[0] + apart + RADIUS < size.width ? apart : -apart)));
  const y = Math.max(RADIUS + 8, Math.min(size.height - RADIUS - 8, screen[1] + (above ? apart : -apart)));
  // Eight times as the file has it, or as it is shown where that is more.
  const scale = TIMES * Math.max(1, Math.min(t.scale, 2));
  context.save();
  context.beginPath();
  context.arc(x, y, RADIUS, 0, 2 * Math.PI);
  context.fillStyle = "#000";
  context.fill();
  context.clip();
  context.translate(x, y);
  context.rotate((t.turns * Math.PI) / 2);
  context.scale(scale, scale);
  context.translate(-at[0], -at[1]);
  context.imageSmoothingEnabled = false;
  const half = (1.5 * RADIUS) / scale + 1;
  const [left, top] = [Math.floor(at[0] + 0.5 - half), Math.floor(at[1] + 0.5 - half)];
  const side = Math.ceil(2 * half) + 1;
  const piece = pieceWith(picture, left, top, side);
  context.drawImage(piece.canvas, left - piece.left, top - piece.top, side, side, left - 0.5, top - 0.5, side, side);
  context.restore();
  context.save();
  context.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as const) {
    context.moveTo(x + 5 * dx, y + 5 * dy);
    context.lineTo(x + RADIUS * dx, y + RADIUS * dy);
  }
  context.strokeStyle = "rgb(0 0 0 / 60%)";
  context.lineWidth = 3;
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.stroke();
  context.beginPath();
  context.arc(x, y, RADIUS, 0, 2 * Math.PI);
  context.lineWidth = 2;
  context.strokeStyle = "#fff";
  context.stroke();
  context.restore();
}
