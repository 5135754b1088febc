// Cameras that a test points: images of a tag, drawn by the browser and put into a folder that the program watches, ten a second.
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Browser } from "playwright-core";
import { file } from "./server.js";

const WIDTH = 640;
const HEIGHT = 480;
const FOCAL = 600;
/** Millimetres of the printed tag in a pixel, and where its middle is on its sheet, mm. */
const PX_PER_MM = 1.4;
const VARIANTS = 8;

/** Images of a tag for each angle by which the camera is turned right, degrees; each several times, with a noise of its own. */
export async function drawn(browser: Browser, anglesDeg: number[]): Promise<Map<number, Buffer[]>> {
  const folder = mkdtempSync(join(tmpdir(), "resight-tag-"));
  execFileSync(process.env.RESIGHT_PROGRAM!, ["print", "--kind", "tag", "--id", "3", "--size-m", "0.1", "-o", join(folder, "tag.svg")], { stdio: "ignore" });
  const svg = readFileSync(join(folder, "tag.svg"), "utf8");
  rmSync(folder, { recursive: true });
  const path = /<path fill-rule="evenodd" d="([^"]*)"/.exec(svg)![1]!;
  const page = await browser.newPage();
  const images = new Map<number, Buffer[]>();
  for (const angle of anglesDeg) {
    // A camera turned right sees everything further left.
    const shift = -FOCAL * Math.tan((angle * Math.PI) / 180);
    const urls = await page.evaluate(draw, { path, shift, n: VARIANTS, WIDTH, HEIGHT, PX_PER_MM });
    images.set(angle, urls.map((url) => Buffer.from(url.split(",")[1]!, "base64")));
  }
  await page.close();
  return images;
}

interface Drawing { path: string; shift: number; n: number; WIDTH: number; HEIGHT: number; PX_PER_MM: number }

function draw({ path, shift, n, WIDTH, HEIGHT, PX_PER_MM }: Drawing): string[] {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [WIDTH, HEIGHT];
  const pen = canvas.getContext("2d")!;
  return Array.from({ length: n }, (_, variant) => {
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = "#7c8287";
    pen.fillRect(0, 0, WIDTH, HEIGHT);
    pen.setTransform(PX_PER_MM, 0.12, -0.1, 0.92 * PX_PER_MM, WIDTH / 2 + shift - 113 * PX_PER_MM, HEIGHT / 2 - 138 * 0.92 * PX_PER_MM);
    pen.fillStyle = "#e8e8e8";
    pen.fillRect(45, 70, 136, 136);
    pen.fillStyle = "#202020";
    pen.fill(new Path2D(path), "evenodd");
    const image = pen.getImageData(0, 0, WIDTH, HEIGHT);
    let seed = 1 + variant;
    for (let i = 0; i < image.data.length; i += 4) {
      seed = (seed * 1103515245 + 12345) % 2147483648;
      const noise = ((seed >> 16) % 7) - 3;
      for (let k = 0; k < 3; k++) image.data[i + k]! += noise;
    }
    pen.putImageData(image, 0, 0);
    return canvas.toDataURL("image/png");
  });
}

/** A camera whose folder gets an image every 100 ms, of how it is turned now. */
export class Camera {
  angle = 0;
  private n = 0;
  private timer: NodeJS.Timeout | undefined;
  readonly folder: string;

  constructor(readonly name: string, root: string, private readonly images: Map<number, Buffer[]>, readonly everyMs = 100) {
    this.folder = join(root, `frames-${name.replace(/\W+/g, "-")}`);
    mkdirSync(this.folder);
  }

  start() {
    this.timer ??= setInterval(() => this.shoot(), this.everyMs);
  }

  stop() {
    clearInterval(this.timer);
    this.timer = undefined;
  }

  private shoot() {
    const all = this.images.get(this.angle)!;
    const name = String(this.n++).padStart(8, "0");
    // The program sees whole files only.
    const unfinished = join(this.folder, `${name}.part`);
    writeFileSync(unfinished, all[this.n % all.length]!);
    renameSync(unfinished, join(this.folder, `${name}.png`));
  }
}

/** A folder for a session, its cameras, and its file. */
export class Watch {
  readonly root = mkdtempSync(join(tmpdir(), "resight-live-"));
  readonly cameras: Camera[];

  constructor(names: string[], images: Map<number, Buffer[]>, everyMs?: number) {
    this.cameras = names.map((name) => new Camera(name, this.root, images, everyMs));
  }

  file(name: string) {
    return join(this.root, name);
  }

  /** Writes the session's file; `keys` are further lines of it. */
  session(keys = ""): string {
    writeFileSync(this.file("camera.toml"), [
      'model = "pinhole"', `width_px = ${WIDTH}`, `height_px = ${HEIGHT}`, `fx_px = ${FOCAL}.0`, `fy_px = ${FOCAL}.0`,
      `cx_px = ${(WIDTH - 1) / 2}`, `cy_px = ${(HEIGHT - 1) / 2}`,
    ].join("\n"));
    writeFileSync(this.file("tag.toml"), 'kind = "tag"\nfamily = "tag36h11"\nid = 3\nsize_m = 0.1\n');
    const tables = this.cameras.map(({ name, folder }) => `[camera.${JSON.stringify(name)}]\nfile = ${JSON.stringify(this.file("camera.toml"))}\nsource = ${JSON.stringify(`${folder}/`)}\n`);
    const text = `learn = 20\nstale_after_s = 3\n${keys}\n${tables.join("\n")}\n[target.tag]\nfile = ${JSON.stringify(this.file("tag.toml"))}\n`;
    writeFileSync(this.file("session.toml"), text);
    return this.file("session.toml");
  }

  start() {
    this.cameras.forEach((camera) => camera.start());
  }

  end() {
    this.cameras.forEach((camera) => camera.stop());
    rmSync(this.root, { recursive: true, force: true });
  }
}

export { file };
