// The library as one module, dist/tessera.js; three.js is the user's own.
import { defineConfig } from 'vite';
import { fileURLToPath } from 'node:url';

export default defineConfig({
  resolve: {
    alias: [{ find: './make-worker', replacement: fileURLToPath(new URL('src/make-worker-inline.ts', import.meta.url)) }],
  },
  worker: { format: 'iife' },
  build: {
    target: 'es2022',
    assetsInlineLimit: Number.MAX_SAFE_INTEGER,
    emptyOutDir: false,
    lib: { entry: 'src/index.ts', formats: ['es'], fileName: 'tessera' },
    rollupOptions: { external: [/^three($|\/)/] },
  },
});
