// Whether the committed page and the committed types are those that the sources give. The types need a program: RESIGHT_PROGRAM.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { REPORT, reportScript } from "./space.mjs";
import { descriptionOf, typesOf } from "./types.mjs";

const COMMITTED = "../crates/serve/page";
const LARGEST_BYTES = 1 << 20;
const faults = [];

const fresh = mkdtempSync(join(tmpdir(), "resight-page-"));
try {
  execFileSync("npx", ["vite", "build", "--logLevel", "warn"], { stdio: "inherit", env: { ...process.env, PAGE_DIR: fresh } });
  let compressed = 0;
  for (const name of ["index.html", "app.js", "app.css"]) {
    const built = readFileSync(join(fresh, name));
    compressed += gzipSync(built).length;
    if (!built.equals(readFileSync(join(COMMITTED, name)))) {
      faults.push(`crates/serve/page/${name} is not what the sources give; run \`npm run build\` in web/.`);
    }
  }
  console.log(`page: ${(compressed / 1024).toFixed(1)} kB compressed`);
  if (LARGEST_BYTES < compressed) faults.push(`The page has ${compressed} bytes compressed; at most ${LARGEST_BYTES} are allowed.`);
} finally {
  rmSync(fresh, { recursive: true });
}

if ((await reportScript()) !== readFileSync(REPORT, "utf8")) {
  faults.push(`${REPORT} is not what src/space/view.ts gives; run \`npm run space\` in web/.`);
}

const program = process.env.RESIGHT_PROGRAM;
if (!program) {
  console.log("types: not compared, for RESIGHT_PROGRAM names no program");
} else if (typesOf(await descriptionOf(program)) !== readFileSync("src/api/types.ts", "utf8")) {
  faults.push("src/api/types.ts is not what /openapi.json gives; run `npm run types` in web/.");
}

faults.forEach((fault) => console.error(fault));
process.exitCode = faults.length;
