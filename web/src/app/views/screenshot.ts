// Renders an image of any size piece by piece, after everything that the view requests has been loaded.
import { download, fileName } from '../page/page-files';
import { element } from '../page/element';
import type { Toolbar } from '../page/toolbar';
import type { Viewer } from '../viewer';

const kPiece = 512; // pixels along an edge
const kLargest = 16384; // limit on the size of canvases
const kWait = 60000; // time-out in ms without any new tile

export interface Progress {
  piece: number; // from 0
  pieces: number;
  pending: number; // tiles that this piece waits for
}

// Splits an image into pieces (left, top, width, height), none of them larger than `edge`.
export function splitPicture(width: number, height: number, edge = kPiece): [number, number, number, number][] {
  const pieces: [number, number, number, number][] = [];
  for (let top = 0; top < height; top += edge) {
    for (let left = 0; left < width; left += edge) {
      pieces.push([left, top, Math.min(edge, width - left), Math.min(edge, height - top)]);
    }
  }
  return pieces;
}

// Renders the current view with the given size in pixels; another aspect ratio widens or narrows the view about its
// centre. Tiles that cannot be loaded are missing, as on the screen. Rejects if the image cannot be drawn, and when
// `signal` aborts.
export function takePicture(
  viewer: Viewer, width: number, height: number, tell: (progress: Progress) => void, signal: AbortSignal,
): Promise<Blob> {
  return viewer.whileHeld(async () => {
    const { renderer, camera } = viewer;
    const picture = document.createElement('canvas');
    picture.width = width;
    picture.height = height;
    const context = picture.getContext('2d')!;
    const { aspect } = camera;
    camera.aspect = width / height;
    viewer.resolutionScale = 1;
    renderer.setPixelRatio(1);
    try {
      const pieces = splitPicture(width, height);
      for (const [piece, [left, top, wide, high]] of pieces.entries()) {
        camera.setViewOffset(width, height, left, top, wide, high);
        renderer.setSize(wide, high, false);
        do {
          await allTiles(viewer, signal, (pending) => tell({ piece, pieces: pieces.length, pending }));
          for (viewer.draw(); viewer.loaded && !viewer.idle; viewer.draw()) {
            await new Promise((resolve) => setTimeout(resolve));
            signal.throwIfAborted();
          }
        } while (!viewer.idle); // drawing takes GPU memory itself, which may evict tiles; frames of some scenes are blended
        context.drawImage(renderer.domElement, left, top);
      }
    } finally {
      camera.clearViewOffset();
      camera.aspect = aspect;
      camera.updateProjectionMatrix();
    }
    const blob = await new Promise<Blob | null>((resolve) => picture.toBlob(resolve, 'image/png'));
    signal.throwIfAborted();
    if (!blob) throw new Error(`the browser has no memory for an image of ${width} by ${height}`);
    return blob;
  });
}

// Waits until everything that the camera requests is loaded.
async function allTiles(viewer: Viewer, signal: AbortSignal, tell: (pending: number) => void): Promise<void> {
  let loads = -1;
  let lastLoad = 0;
  for (;;) {
    viewer.prefetch();
    tell(viewer.statistics?.pending ?? 0);
    await new Promise((resolve) => setTimeout(resolve, 10));
    signal.throwIfAborted();
    if (viewer.renderer.getContext().isContextLost()) throw new Error('the WebGL context was lost; try again');
    if (viewer.loaded) return;
    const now = performance.now();
    if (viewer.statistics?.loads !== loads) lastLoad = now;
    else if (now - lastLoad > kWait) throw new Error('no tiles arrive; try again later');
    loads = viewer.statistics?.loads ?? 0;
  }
}

export function addScreenshot(viewer: Viewer, toolbar: Toolbar): void {
  const side = (name: string) => {
    const input = element('input');
    Object.assign(input, { type: 'number', min: '16', max: String(kLargest), step: '1', required: true });
    input.setAttribute('aria-label', name);
    return input;
  };
  const [width, height] = [side('Width'), side('Height')];
  const take = element('button', '', 'Save image');
  const cancel = element('button', '', 'Cancel');
  const isTaking = (is: boolean) => {
    take.hidden = is;
    cancel.hidden = !is;
    // All pieces must show the same view and world.
    for (const other of document.querySelectorAll<HTMLElement>('.toolbar, .side')) other.inert = is && !other.contains(cancel);
  };
  isTaking(false);
  const said = element('p', 'faint');
  said.setAttribute('role', 'status');
  const presets = element('div', 'row');
  const choose = (w: number, h: number) => {
    width.valueAsNumber = w;
    height.valueAsNumber = h;
  };
  for (const [name, w, h] of [['Window', 0, 0], ['Full HD', 1920, 1080], ['4K', 3840, 2160], ['8K', 7680, 4320]] as const) {
    const button = element('button', '', name);
    button.addEventListener('click', () => (w > 0 ? choose(w, h) : choose(innerWidth, innerHeight)));
    presets.append(button);
  }
  choose(1920, 1080);
  addEventListener('keydown', ({ key }) => {
    if (key === 'Escape' && !cancel.hidden) cancel.click();
  });
  take.addEventListener('click', async () => {
    if (!width.reportValidity() || !height.reportValidity()) return;
    const ending = new AbortController();
    // Ignores the second half of the double click that started it.
    cancel.onclick = ({ detail }) => detail < 2 && ending.abort();
    isTaking(true);
    cancel.focus();
    try {
      const picture = await takePicture(viewer, width.valueAsNumber, height.valueAsNumber, ({ piece, pieces, pending }) => {
        said.textContent = `Part ${piece + 1} of ${pieces}${pending > 0 ? `, ${pending} blocks to come` : ''}`;
      }, ending.signal);
      download(fileName(viewer.city.name, 'png'), picture);
      said.textContent = '';
    } catch (error) {
      said.textContent = ending.signal.aborted ? '' : String(error instanceof Error ? error.message : error);
    } finally {
      const hadFocus = document.activeElement === cancel;
      isTaking(false);
      if (hadFocus) take.focus();
    }
  });
  const panel = element('div', '', presets, element('div', 'row', width, '×', height), element('div', 'row', take, cancel), said);
  toolbar.add({ name: 'Image', key: 'p', icon: 'camera', panel });
}
