import { defineConfig } from 'vitest/config';

export default defineConfig({
  base: './', // works from any folder of any server
  worker: { format: 'es' },
  build: {
    target: 'es2022',
    chunkSizeWarningLimit: 1000,
    rollupOptions: { input: ['index.html', 'headless.html'] },
  },
  server: { fs: { allow: ['..'] } }, // ../shaders
  test: { testTimeout: 60000, hookTimeout: 60000 },
});
