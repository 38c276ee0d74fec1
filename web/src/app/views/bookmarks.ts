// Views to come back to, kept by the browser for each scene and in worlds; and a camera path along them.
import { cameraPath } from './camera-path';
import { download, fileName } from '../page/page-files';
import { element } from '../page/element';
import { iconButton, nameField, replaceRows } from '../page/fields';
import type { Toolbar } from '../page/toolbar';
import { formatView, parseView, type View } from './view-address';
import type { Viewer } from '../viewer';
import { kMost } from '../world/world-file';

const kLetters = 80; // of a name

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
      return found ? [{ name: typeof name === 'string' ? name.slice(0, kLetters) : 'View', view: found }] : [];
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
  readonly onChange = new Set<() => void>(); // of the list, of what is selected
  private kept: Bookmark[];
  private ofWorld: Bookmark[] = [];
  private chosen: Bookmark[] = []; // and what is the same of this browser, which is not listed

  constructor(private readonly key: string) {
    this.kept = readBookmarks(read(key));
  }

  // Those of the world first; none twice, but for one that becomes the same while its name is typed.
  get list(): Bookmark[] {
    const texts = new Set(this.ofWorld.map(textOf));
    return [...this.ofWorld, ...this.kept.filter((one) => one === this.chosen[0] || !texts.has(textOf(one)))];
  }

  isOfWorld(bookmark: Bookmark): boolean {
    return this.ofWorld.includes(bookmark);
  }

  get selected(): Bookmark | undefined {
    return this.list.find((one) => this.chosen.includes(one));
  }

  select(bookmark: Bookmark | undefined): void {
    const same = this.kept.filter((one) => bookmark && this.isOfWorld(bookmark) && textOf(one) === textOf(bookmark));
    this.chosen = bookmark ? [bookmark, ...same] : [];
    this.changed();
  }

  // The selected one.
  rename(name: string): void {
    for (const one of this.chosen) one.name = name.slice(0, kLetters);
    this.change(this.kept, this.ofWorld);
  }

  // And selects it.
  keep(view: View): void {
    const last = this.list.map(({ name }) => Number(/^View (\d+)$/.exec(name)?.[1] ?? 0));
    const bookmark = { name: `View ${Math.max(0, ...last) + 1}`, view };
    this.chosen = [bookmark];
    this.change([...this.kept, bookmark].slice(-kMost.bookmarks), this.ofWorld);
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
    this.changed();
  }

  private changed(): void {
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
  const name = nameField(kLetters, (to) => bookmarks.rename(to), () => showName());
  const details = element('div', 'details', name.label);
  const panel = element('div', 'views listed', element('div', 'row', keep, path), list, details, hint);

  const row = (bookmark: Bookmark) => {
    const isSelected = bookmark === bookmarks.selected;
    const go = element('button', 'plain name', bookmark.name);
    go.setAttribute('aria-current', String(isSelected));
    go.addEventListener('click', () => {
      bookmarks.select(bookmark);
      viewer.flyTo(bookmark.view);
    });
    const ofWorld = bookmarks.isOfWorld(bookmark) ? [element('span', 'faint', 'world')] : [];
    const remove = iconButton('Remove', bookmark.name, 'close', () => bookmarks.remove(bookmark));
    return element('li', isSelected ? 'on' : '', go, ...ofWorld, remove);
  };
  const showName = () => name.set(bookmarks.selected?.name ?? '');
  const show = () => {
    path.disabled = bookmarks.list.length < 2;
    replaceRows(list, bookmarks.list.map(row));
    details.hidden = !bookmarks.selected;
    showName();
  };
  bookmarks.onChange.add(show);
  keep.addEventListener('click', () => bookmarks.keep(viewer.view));
  path.addEventListener('click', () =>
    download(fileName(`${city.name}-camera-path`, 'json'), cameraPath(bookmarks.list.map(({ view }) => view), city.tileset)));
  show();
  toolbar.add({ name: 'Views', key: 'b', icon: 'bookmark', panel, closed: () => bookmarks.select(undefined) });
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
