// Bookmarks of views, which the browser stores for each scene and which worlds contain, and a camera path along them.
import { cameraPath } from './camera-path';
import { download, fileName } from '../page/page-files';
import { element } from '../page/element';
import { iconButton, nameField, replaceRows } from '../page/fields';
import type { Toolbar } from '../page/toolbar';
import { formatView, parseView, type View } from './view-address';
import type { Viewer } from '../viewer';
import { kMax } from '../world/world-file';

const kLetters = 80; // limit on the length of a name

export interface Bookmark {
  name: string;
  view: View;
}

// Parses the stored text, which may not have been written by this program.
export function readBookmarks(text: string | null): Bookmark[] {
  try {
    const stored = JSON.parse(text ?? '[]') as unknown;
    if (!Array.isArray(stored)) return [];
    return stored.slice(0, kMax.bookmarks).flatMap((one: unknown) => {
      const { name, view } = (one ?? {}) as { name?: unknown; view?: unknown };
      const parsedView = typeof view === 'string' ? parseView(view) : undefined;
      return parsedView ? [{ name: typeof name === 'string' ? name.slice(0, kLetters) : 'View', view: parsedView }] : [];
    });
  } catch {
    return [];
  }
}

export function writeBookmarks(bookmarks: Bookmark[]): string {
  return JSON.stringify(bookmarks.map(({ name, view }) => ({ name, view: formatView(view) })));
}

// The views that this browser has stored for this scene, and those of the open world.
export class Bookmarks {
  readonly onChange = new Set<() => void>(); // called when the list or the selection changes
  private saved: Bookmark[];
  private ofWorld: Bookmark[] = [];
  private chosen: Bookmark[] = []; // also contains the equal view of this browser, which is not listed

  constructor(private readonly key: string) {
    this.saved = readBookmarks(read(key));
  }

  // The views of the world come first. Equal views are listed once, except for one that becomes equal while its name is
  // typed.
  get list(): Bookmark[] {
    const texts = new Set(this.ofWorld.map(serializeBookmark));
    return [...this.ofWorld, ...this.saved.filter((one) => one === this.chosen[0] || !texts.has(serializeBookmark(one)))];
  }

  isOfWorld(bookmark: Bookmark): boolean {
    return this.ofWorld.includes(bookmark);
  }

  get selected(): Bookmark | undefined {
    return this.list.find((one) => this.chosen.includes(one));
  }

  select(bookmark: Bookmark | undefined): void {
    const same = this.saved.filter((one) => bookmark && this.isOfWorld(bookmark) && serializeBookmark(one) === serializeBookmark(bookmark));
    this.chosen = bookmark ? [bookmark, ...same] : [];
    this.changed();
  }

  // Renames the selected view.
  rename(name: string): void {
    for (const one of this.chosen) one.name = name.slice(0, kLetters);
    this.change(this.saved, this.ofWorld);
  }

  // Adds a view and selects it.
  keep(view: View): void {
    const last = this.list.map(({ name }) => Number(/^View (\d+)$/.exec(name)?.[1] ?? 0));
    const bookmark = { name: `View ${Math.max(0, ...last) + 1}`, view };
    this.chosen = [bookmark];
    this.change([...this.saved, bookmark].slice(-kMax.bookmarks), this.ofWorld);
  }

  remove(bookmark: Bookmark): void {
    const others = (all: Bookmark[]) => all.filter((one) => serializeBookmark(one) !== serializeBookmark(bookmark));
    this.change(others(this.saved), others(this.ofWorld));
  }

  // Replaces the views of the previous world.
  showWorld(bookmarks: Bookmark[]): void {
    this.change(this.saved, bookmarks);
  }

  private change(saved: Bookmark[], ofWorld: Bookmark[]): void {
    this.saved = saved;
    this.ofWorld = ofWorld;
    write(this.key, writeBookmarks(saved));
    this.changed();
  }

  private changed(): void {
    for (const tell of this.onChange) tell();
  }
}

function serializeBookmark(bookmark: Bookmark): string {
  return writeBookmarks([bookmark]);
}

export function makeBookmarks({ city }: Viewer): Bookmarks {
  return new Bookmarks(`tessera bookmarks ${city.files.name} ${city.name}`);
}

export function addBookmarks(viewer: Viewer, bookmarks: Bookmarks, toolbar: Toolbar): void {
  const { city } = viewer;
  const list = element('ul');
  const keep = element('button', '', 'Keep this view');
  const path = element('button', '', 'Save camera path');
  path.title = 'A flight through these views, for tessera render --path or nerfstudio';
  const hint = element('p', 'faint', 'Stored in this browser, and in saved worlds.');
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

// The browser may store nothing for pages (private windows, full disks).
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
    // The views then last as long as the page.
  }
}
