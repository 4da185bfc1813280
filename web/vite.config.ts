// The built page is committed and ships in the wheel, so it has fixed names and no source maps.
import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  experimental: { renderBuiltUrl: (file) => `static/${file}` }, // beside the page, under whatever path it is served
  build: {
    outDir: "../embodied/serve/static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    rollupOptions: { output: { entryFileNames: "app.js", assetFileNames: "app.[ext]" } },
  },
});
