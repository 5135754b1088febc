// Small pictures of what the marks may be.
import type { Template } from "../api/types";

const dot = (x: number, y: number) => <circle key={`${x} ${y}`} cx={x} cy={y} r="3.5" class="mark" />;

const PICTURES: Record<Template, preact.ComponentChildren> = {
  line_and_post: (
    <>
      <path d="M6 44 L24 8 M58 44 L40 8" class="soft" />
      <path d="M12 34 l6 -1 M29 30 l7 -1.2 M47 26.5 l8 -1.3" class="wide" />
      <path d="M40 16 v-12" class="line" />
      {[dot(13, 33.8), dot(32, 30), dot(51, 26.4), dot(40, 16)]}
    </>
  ),
  four_points: (
    <>
      <path d="M4 40 L20 12 H46 L60 40 Z" class="soft" />
      {[dot(14, 34), dot(23, 17), dot(43, 18), dot(49, 35)]}
    </>
  ),
  rectangle: (
    <>
      <path d="M4 44 H60" class="soft" />
      <path d="M20 44 V6 H44 V44 Z" class="line" />
      <circle cx="39" cy="26" r="1.5" class="fill" />
      {[dot(20, 6), dot(44, 6), dot(44, 44), dot(20, 44)]}
    </>
  ),
  target: (
    <>
      <rect x="16" y="8" width="32" height="32" class="fill" />
      <path d="M21 13 h8 v8 h-8 z M35 13 h8 v8 h-8 z M29 21 h6 v6 h-6 z M21 29 h8 v6 h-8 z M37 27 h6 v8 h-6 z" class="paper" />
      {[dot(16, 8), dot(48, 8), dot(48, 40), dot(16, 40)]}
    </>
  ),
  own: (
    <>
      <path d="M12 40 V8 M12 40 H56 M12 40 L26 28" class="line" />
      {[dot(22, 16), dot(38, 32), dot(50, 14), dot(34, 22)]}
    </>
  ),
};

export function Pictogram({ of }: { of: Template }) {
  return <svg class="pictogram" viewBox="0 0 64 48" width="64" height="48" aria-hidden="true">{PICTURES[of]}</svg>;
}
