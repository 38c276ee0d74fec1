import { defineConfig } from 'vitest/config';

// Measurements, not tests: bench/viewer.sh, bench/merf_viewer.sh and bench/hash.sh run them.
export default defineConfig({
  test: { include: ['bench/viewer.ts', 'bench/merf.ts', 'bench/hash.ts'], testTimeout: 3600000, hookTimeout: 60000, fileParallelism: false },
});
