import { defineConfig } from "vite";

// Three files with fixed names, which crates/ringlight-view/src/page.rs embeds.
export default defineConfig({
  base: "./",
  build: {
    target: "es2022",
    emptyOutDir: false,
    assetsDir: "",
    cssCodeSplit: false,
    modulePreload: false,
    chunkSizeWarningLimit: 1000,
    rollupOptions: {
      output: { entryFileNames: "viewer.js", assetFileNames: "viewer.[ext]", inlineDynamicImports: true },
    },
  },
});
