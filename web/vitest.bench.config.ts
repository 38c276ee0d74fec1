import { defineConfig } from 'vitest/config';

// Measurements, not tests: bench/viewer.sh, bench/merf_viewer.sh, bench/hash.sh, bench/mesh.sh and bench/same_speed.sh run them.
export default defineConfig({
  test: { include: ['bench/viewer.ts', 'bench/merf.ts', 'bench/hash.ts', 'bench/mesh.ts', 'bench/mobilenerf.ts', 'bench/same-speed.ts'], testTimeout: 3600000, hookTimeout: 60000, fileParallelism: false },
});
