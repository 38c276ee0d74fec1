import { defineConfig } from 'vitest/config';

// Measurements, not tests: bench/viewer.sh and bench/merf_viewer.sh run them.
export default defineConfig({
  test: { include: ['bench/viewer.ts', 'bench/merf.ts'], testTimeout: 3600000, hookTimeout: 60000, fileParallelism: false },
});
