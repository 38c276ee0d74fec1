// The library as one module, dist/tessera.js; three.js is the user's own.
import { mergeConfig, type UserConfig } from 'vite';
import { inlined } from './vite.inline';

export default mergeConfig<UserConfig, UserConfig>(inlined, {
  build: {
    lib: { entry: 'src/index.ts', formats: ['es'], fileName: 'tessera' },
    rollupOptions: { external: [/^three($|\/)/] },
  },
});
