// Views to come back to, kept by the browser for each scene and in worlds; and a camera path along them.
import { cameraPath } from './camera-path';
import { download, fileName } from '../page/page-files';
import { element } from '../page/element';
import { icon } from '../page/icons';
import type { Toolbar } from '../page/toolbar';
import { formatView, parseView, type View } from './view-address';
import type { Viewer } from '../viewer';
import { kMost } from '../world/world-file';

export interface Bookmark {
  name: string;
  view: View;
}

// What was kept: text of this program, or of nobody knows whom.
export function readBookmarks(text: string | null): Bookmark[] {
  try {
    const kept = JSON.parse(text ?? '[]') as unknown;
    if (!Array.isArray(kept)) return [];
    return kept.slice(0, kMost.bookmarks).flatMap((one: unknown) => {
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

// The views of this browser, for this scene, and those of the world that is open.
export class Bookmarks {
  readonly onChange = new Set<() => void>();
  private kept: Bookmark[];
  private ofWorld: Bookmark[] = [];

  constructor(private readonly key: string) {
    this.kept = readBookmarks(read(key));
  }

  // Those of the world first; none twice.
  get list(): Bookmark[] {
    const texts = new Set(this.ofWorld.map(textOf));
    return [...this.ofWorld, ...this.kept.filter((one) => !texts.has(textOf(one)))];
  }

  isOfWorld(bookmark: Bookmark): boolean {
    return this.ofWorld.includes(bookmark);
  }

  keep(view: View): void {
    const last = this.list.map(({ name }) => Number(/^View (\d+)$/.exec(name)?.[1] ?? 0));
    this.change([...this.kept, { name: `View ${Math.max(0, ...last) + 1}`, view }].slice(-kMost.bookmarks), this.ofWorld);
  }

  remove(bookmark: Bookmark): void {
    const others = (all: Bookmark[]) => all.filter((one) => textOf(one) !== textOf(bookmark));
    this.change(others(this.kept), others(this.ofWorld));
  }

  // In place of those of another world.
  showWorld(bookmarks: Bookmark[]): void {
    this.change(this.kept, bookmarks);
  }

  private change(kept: Bookmark[], ofWorld: Bookmark[]): void {
    this.kept = kept;
    this.ofWorld = ofWorld;
    write(this.key, writeBookmarks(kept));
    for (const tell of this.onChange) tell();
  }
}

function textOf(bookmark: Bookmark): string {
  return writeBookmarks([bookmark]);
}

export function bookmarksOf({ city }: Viewer): Bookmarks {
  return new Bookmarks(`tessera bookmarks ${city.files.name} ${city.name}`);
}

export function addBookmarks(viewer: Viewer, bookmarks: Bookmarks, toolbar: Toolbar): void {
  const { city } = viewer;
  const list = element('ul');
  const keep = element('button', '', 'Keep this view');
  const path = element('button', '', 'Save camera path');
  path.title = 'A flight through these views, for tessera render --path or nerfstudio';
  const hint = element('p', 'faint', 'Kept in this browser, and in a world that is saved.');
  const panel = element('div', 'views', list, element('div', 'row', keep, path), hint);

  const show = () => {
    path.disabled = bookmarks.list.length < 2;
    list.replaceChildren(...bookmarks.list.map((bookmark) => {
      const go = element('button', 'link', bookmark.name);
      go.addEventListener('click', () => viewer.flyTo(bookmark.view));
      const remove = element('button', 'plain', icon('close'));
      remove.setAttribute('aria-label', `Remove ${bookmark.name}`);
      remove.addEventListener('click', () => bookmarks.remove(bookmark));
      const ofWorld = bookmarks.isOfWorld(bookmark) ? [element('span', 'faint', 'world')] : [];
      return element('li', '', go, ...ofWorld, remove);
    }));
  };
  bookmarks.onChange.add(show);
  keep.addEventListener('click', () => bookmarks.keep(viewer.view));
  path.addEventListener('click', () =>
    download(fileName(`${city.name}-camera-path`, 'json'), cameraPath(bookmarks.list.map(({ view }) => view), city.tileset)));
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
