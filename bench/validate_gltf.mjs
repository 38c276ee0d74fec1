// node validate_gltf.mjs SCENE: prints how many errors and warnings glTF-Validator finds in the contents of a scene; details go
// to stderr. See mesh.sh.
import { readFileSync, readdirSync, statSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';

const { validateBytes } = createRequire(new URL('../web/package.json', import.meta.url))('gltf-validator');

const contents = (folder) =>
  readdirSync(folder).flatMap((name) => {
    const path = join(folder, name);
    return statSync(path).isDirectory() ? contents(path) : path.endsWith('.glb') ? [path] : [];
  });

let problems = 0;
for (const path of contents(process.argv[2])) {
  const report = await validateBytes(new Uint8Array(readFileSync(path)), {
    externalResourceFunction: async (uri) => new Uint8Array(readFileSync(resolve(dirname(path), uri))),
  });
  for (const message of report.issues.messages.filter((message) => message.severity <= 1)) {
    console.error(path, JSON.stringify(message));
    ++problems;
  }
}
console.log(problems);
