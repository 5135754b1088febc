// Builds src/space/view.ts for the report of `resight rig`: one readable script without imports, whose names are those of `resightSpace`.
// Use: npm run space [-- FILE]
import { readFileSync, writeFileSync } from "node:fs";
import { build } from "vite";

export const REPORT = "../crates/resight/src/report/rig/view.js";

/** The text of the script. */
export async function reportScript() {
  const [{ output }] = await build({
    configFile: false,
    logLevel: "warn",
    build: {
      write: false,
      minify: false,
      target: "es2022",
      lib: { entry: "src/space/view.ts", formats: ["iife"], name: "resightSpace" },
    },
  });
  const text = output[0].code.replace(/^\s*\/\/#(end)?region.*\n/gm, "").trim();
  return `// Built from web/src/space/view.ts by \`npm run space\` in web/. Do not edit.\n${text}\n`;
}

if (import.meta.url === `file://${process.argv[1]}`) {
  const file = process.argv[2] ?? REPORT;
  writeFileSync(file, await reportScript());
  console.log(`${file}: ${readFileSync(file).length} bytes`);
}
