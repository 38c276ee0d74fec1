// Views to come back to, kept by the browser for each scene; and a camera path along them.
import { cameraPath } from './camera-path';
import { download, fileName } from '../page/page-files';
import { element } from '../page/element';
import { icon } from '../page/icons';
import type { Toolbar } from '../page/toolbar';
import { formatView, parseView, type View } from './view-address';
import type { Viewer } from '../viewer';

interface Bookmark {
  name: string;
  view: View;
}

const kMost = 200;

// What was kept: text of this program, or of nobody knows whom.
export function readBookmarks(text: string | null): Bookmark[] {
  try {
    const kept = JSON.parse(text ?? '[]') as unknown;
    if (!Array.isArray(kept)) return [];
    return kept.slice(0, kMost).flatMap((one: unknown) => {
      const { name, view } = (one ?? {}) as { name?: unknown; view?: unknown };
      const found = typeof view === 'string' ? parseView(view) : undefined;
      return found ? [{ name: typeof name === 'string' ? name.slice(0, 80) : 'View', view: found }] : [];
    });
  } catch {
    return [];
  }
}

export function writeBookmarks(bookmarks: Bookmark[]): string {
  return JSON.stringify(bookmarks.map(({ name, view }) => ({ name, view: formatView(view) })));
}

export function addBookmarks(viewer: Viewer, toolbar: Toolbar): void {
  const { city } = viewer;
  const key = `tessera bookmarks ${city.files.name} ${city.name}`;
  let bookmarks = readBookmarks(read(key));
  const list = element('ul');
  const keep = element('button', '', 'Keep this view');
  const path = element('button', '', 'Save camera path');
  path.title = 'A flight through these views, for tessera render --path or nerfstudio';
  const hint = element('p', 'faint', 'Kept in this browser.');
  const panel = element('div', '', list, element('div', 'row', keep, path), hint);

  const change = (next: Bookmark[]) => {
    bookmarks = next;
    write(key, writeBookmarks(bookmarks));
    show();
  };
  const show = () => {
    path.disabled = bookmarks.length < 2;
    list.replaceChildren(...bookmarks.map((bookmark) => {
      const go = element('button', 'link', bookmark.name);
      go.addEventListener('click', () => viewer.flyTo(bookmark.view));
      const remove = element('button', 'plain', icon('close'));
      remove.setAttribute('aria-label', `Remove ${bookmark.name}`);
      remove.addEventListener('click', () => change(bookmarks.filter((one) => one !== bookmark)));
      return element('li', '', go, remove);
    }));
  };
  keep.addEventListener('click', () => {
    const last = bookmarks.map(({ name }) => Number(/^View (\d+)$/.exec(name)?.[1] ?? 0));
    change([...bookmarks, { name: `View ${Math.max(0, ...last) + 1}`, view: viewer.view }].slice(-kMost));
  });
  path.addEventListener('click', () =>
    download(fileName(`${city.name}-camera-path`, 'json'), cameraPath(bookmarks.map(({ view }) => view), city.tileset)));
  show();
  toolbar.add({ name: 'Views', key: 'b', icon: 'bookmark', panel });
}

// The browser may keep nothing for pages (private windows, full disks).
function read(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

function write(key: string, text: string): void {
  try {
    localStorage.setItem(key, text);
  } catch {
    // They last as long as the page.
  }
}
