// Which distances a template asks for, and which are there.
import type { DistanceView, PointView, Template } from "../api/types";

export interface Pair {
  a: string;
  b: string;
  typed: DistanceView | null;
}

function joins(d: DistanceView, a: string, b: string): boolean {
  return (d.a === a && d.b === b) || (d.a === b && d.b === a);
}

/** Pairs of marks that are there, in the order in which their distances are typed. */
export function pairs(template: Template, points: PointView[], distances: DistanceView[]): Pair[] {
  const names = points.map((point) => point.name);
  const wanted = asked(template, names);
  const all = wanted.map(([a, b]) => ({ a, b, typed: distances.find((d) => joins(d, a, b)) ?? null }));
  const further = distances.filter((d) => !wanted.some(([a, b]) => joins(d, a, b)));
  return [...all, ...further.map((typed) => ({ a: typed.a, b: typed.b, typed }))];
}

function asked(template: Template, names: string[]): [string, string][] {
  const [a, b, c] = names;
  const both = (name: string, one: string, other: string): [string, string][] => [[name, one], [name, other]];
  switch (template) {
    case "line_and_post":
      if (!a || !b) return [];
      if (!c) return [[a, b]];
      return [[a, b], [b, c], ...names.slice(3).flatMap((name) => both(name, a, c))];
    case "four_points":
      if (!a || !b) return [];
      return [[a, b], ...names.slice(2).flatMap((name) => both(name, a, b))];
    case "rectangle":
      return [...(a && b ? [[a, b] as [string, string]] : []), ...(b && c ? [[b, c] as [string, string]] : [])];
    default:
      return [];
  }
}

/** A number as a person types it: a comma serves as the point. */
export function number(text: string): number {
  const plain = text.trim().replace(",", ".");
  return plain === "" ? NaN : Number(plain);
}
