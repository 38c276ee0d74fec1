// The viewer as one file, dist/offline.html, which works without a server: browsers load no modules, workers or other
// files beside a page that was opened from a disk.
import { mergeConfig, type Plugin, type UserConfig } from 'vite';
import { inlined } from './vite.inline';

// Scripts and styles go into the page, the script as an ordinary one at its end.
const asOneFile: Plugin = {
  name: 'one-file',
  enforce: 'post',
  generateBundle(_, bundle) {
    const page = bundle['index.html'];
    if (page?.type !== 'asset') throw new Error('there is no page');
    let html = String(page.source).replace(/\s*<(script|link)[^>]*assets[^>]*>(<\/script>)?/g, '');
    for (const [name, file] of Object.entries(bundle)) {
      if (name === 'index.html') continue;
      const isScript = file.type === 'chunk';
      const text = isScript ? file.code : String(file.source);
      if (!isScript && !name.endsWith('.css')) throw new Error(`${name} cannot be part of the page`);
      const element = isScript ? `<script>${text.replaceAll('</script', '<\\/script')}</script>\n` : `<style>${text}</style>\n`;
      const before = isScript ? '</body>' : '</head>';
      html = html.replace(before, () => `${element}${before}`);
      delete bundle[name];
    }
    page.source = html;
    page.fileName = 'offline.html';
  },
};

export default mergeConfig<UserConfig, UserConfig>(inlined, {
  base: './',
  plugins: [asOneFile],
  build: {
    chunkSizeWarningLimit: 4000,
    rollupOptions: { input: 'index.html', output: { format: 'iife', inlineDynamicImports: true } },
  },
});
