import { defineConfig } from 'vitest/config';

export default defineConfig({
  base: './', // works from any folder of any server
  worker: { format: 'es' },
  build: {
    target: 'es2022',
    chunkSizeWarningLimit: 1000,
    rollupOptions: { input: ['index.html', 'plain.html'] },
  },
  server: { fs: { allow: ['..'] } }, // ../shaders
  // Vitest leaves one processor idle by default, which is half of a small machine.
  test: { testTimeout: 60000, hookTimeout: 60000, maxWorkers: '100%', minWorkers: 1 },
});
