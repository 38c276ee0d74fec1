import { defineConfig } from 'vitest/config';

// Measurements, not tests: bench/viewer.sh runs them.
export default defineConfig({
  test: { include: ['bench/**/*.ts'], testTimeout: 3600000, hookTimeout: 60000, fileParallelism: false },
});
