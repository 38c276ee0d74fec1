// For outputs of one file: workers, the decoder and all that is loaded later stand within it.
import { fileURLToPath } from 'node:url';
import type { UserConfig } from 'vite';

export const inlined: UserConfig = {
  resolve: {
    alias: [{ find: './make-worker', replacement: fileURLToPath(new URL('src/make-worker-inline.ts', import.meta.url)) }],
  },
  worker: { format: 'iife' },
  build: { target: 'es2022', assetsInlineLimit: Number.MAX_SAFE_INTEGER, emptyOutDir: false },
};
