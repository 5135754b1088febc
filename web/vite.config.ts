// Three files with fixed names, which the program embeds. PAGE_DIR builds elsewhere; `npm run dev` shows the page of a program that runs at
// RESIGHT (http://127.0.0.1:8600 where it is not stated) and reloads it as sources change.
import { defineConfig } from "vite";

const program = process.env.RESIGHT ?? "http://127.0.0.1:8600";
const proxy = {
  target: program,
  changeOrigin: true,
  ws: true,
  headers: { origin: program, "sec-fetch-site": "same-origin" },
};

export default defineConfig({
  build: {
    outDir: process.env.PAGE_DIR ?? "../crates/serve/page",
    emptyOutDir: false,
    assetsInlineLimit: 0,
    modulePreload: false,
    cssCodeSplit: false,
    target: "es2022",
    reportCompressedSize: true,
    rollupOptions: {
      output: {
        entryFileNames: "app.js",
        assetFileNames: (asset) => (asset.names.some((name) => name.endsWith(".css")) ? "app.css" : "[name][extname]"),
        codeSplitting: false,
      },
    },
  },
  server: { proxy: { "/api": proxy, "/ws": proxy, "/cameras.mjpg": proxy, "/openapi.json": proxy } },
});
