// The measuring tool: the user clicks places, lines and figures appear in the scene, and finished measurements are
// listed.
import type { Vec3 } from '../../tiles/tileset';
import { GroundFrame } from './geodesy';
import { kMinPlaces, kMaxPlaces, type Kind, type Measurement } from './measurement';
import { exportMeasurements, headline, hintText, kKindNames, measurementLabels, placeNumbers, placeRows, measurementRows } from './measurement-text';
import { MeasuringLabels } from './measuring-labels';
import { MeasuringMarks } from './measuring-marks';
import { MeasuringPanel } from './measuring-panel';
import { copyText, download, fileName } from '../page/page-files';
import { pointsByTouch } from '../page/pointing';
import { isTyping, type Shortcuts } from '../page/shortcuts';
import type { Toolbar } from '../page/toolbar';
import type { Viewer } from '../viewer';

const kNear = 7; // a click within this many pixels of a place selects it
const kAgain = 400; // ms within which a second click on the same pixels makes a double click

interface Pointer {
  clientX: number;
  clientY: number;
}

export function addMeasuring(viewer: Viewer, toolbar: Toolbar, shortcuts: Shortcuts): Measuring {
  const measuring = new Measuring(viewer);
  const { element: panel } = measuring.panel;
  toolbar.add({
    name: 'Measure', key: 'm', icon: 'ruler', panel,
    opened: () => measuring.open(),
    closed: () => measuring.close(),
  });
  shortcuts.describe('Backspace', 'Undo the last place of a measurement');
  shortcuts.describe('Enter', 'Finish the measurement');
  return measuring;
}

export class Measuring {
  readonly panel: MeasuringPanel;
  private readonly frame: GroundFrame;
  private readonly marks = new MeasuringMarks();
  private readonly labels: MeasuringLabels;
  private readonly finished: Measurement[] = [];
  private chosen?: Measurement; // its figures are shown while no measurement is in progress
  private kind: Kind = 'distance';
  private places: Vec3[] = []; // of the measurement in progress
  private lastPlace?: Vec3;
  private lastClick = { time: -Infinity, clientX: 0, clientY: 0 };
  private pointer?: Pointer; // over the canvas while a measurement is in progress
  private awaited = 0; // id of the animation frame that will pick under the pointer
  private isOpen = false;

  constructor(private readonly viewer: Viewer) {
    this.frame = new GroundFrame(viewer.city.tileset.georeference);
    this.labels = new MeasuringLabels(viewer.canvas, viewer.camera);
    this.panel = new MeasuringPanel(
      this.frame.isGeoreferenced ? '' : 'This capture has no scale: lengths are in its own units, not in metres.');
    this.panel.onKind = (kind) => this.choose(kind);
    this.panel.onDone = () => this.end();
    this.panel.onUndo = () => this.takeBack();
    this.panel.onCopy = () => void this.copy();
    this.panel.onChoose = (index) => {
      this.chosen = this.finished[index];
      this.show();
    };
    this.panel.onDelete = (index) => {
      const [gone] = this.finished.splice(index, 1);
      if (this.chosen === gone) this.chosen = undefined;
      this.show();
    };
    this.panel.onDeleteAll = () => {
      this.finished.length = 0;
      this.chosen = undefined;
      this.show();
    };
    this.panel.onDownload = () => this.download();
    this.labels.layer.hidden = true;
    viewer.onClick.push((event) => this.isOpen && this.take(event));
    viewer.onFrame.add(() => this.isOpen && this.labels.place());
    this.listen();
    this.show();
  }

  open(): void {
    this.isOpen = true;
    this.viewer.navigation.isPointing = true;
    if (document.pointerLockElement === this.viewer.canvas) document.exitPointerLock();
    this.viewer.canvas.classList.add('pointing');
    this.labels.layer.hidden = false;
    this.viewer.world.add(this.marks.group);
    this.show();
  }

  // Finished measurements reappear when the tool is opened again.
  close(): void {
    this.endOrDrop();
    this.isOpen = false;
    this.pointer = undefined;
    this.viewer.navigation.isPointing = false;
    this.viewer.canvas.classList.remove('pointing');
    this.labels.layer.hidden = true;
    this.viewer.world.remove(this.marks.group);
    this.viewer.needPicture();
  }

  private choose(kind: Kind): void {
    this.endOrDrop();
    this.kind = kind;
    this.show();
  }

  // Returns true always: no other tool handles the click.
  private take(event: PointerEvent): true {
    const before = this.lastClick;
    this.lastClick = { time: event.timeStamp, clientX: event.clientX, clientY: event.clientY };
    const isAgain = event.timeStamp - before.time < kAgain && isNear(event, before);
    if (isAgain || this.isOnAnEnd(event)) {
      this.end();
      return true;
    }
    const place = this.viewer.pickAt(event)?.toArray();
    if (!place) return true;
    this.lastPlace = place;
    this.panel.showPlace(placeRows(place, this.frame));
    this.places.push(place);
    if (this.places.length === kMaxPlaces[this.kind]) this.end();
    else this.show();
    return true;
  }

  // Returns whether a click on the last place, or on the first place of an area, finishes the measurement.
  private isOnAnEnd({ clientX, clientY }: Pointer): boolean {
    if (!this.isEnough) return false;
    const { left, top } = this.viewer.canvas.getBoundingClientRect();
    const ends = this.kind === 'area' ? [this.places[0], this.places.at(-1)!] : [this.places.at(-1)!];
    return ends.some((place) => {
      const pixel = this.labels.projectToPixel(place);
      return pixel !== undefined && Math.hypot(clientX - left - pixel.x, clientY - top - pixel.y) < kNear;
    });
  }

  // True when the measurement in progress can be finished.
  private get isEnough(): boolean {
    return this.places.length >= kMinPlaces[this.kind];
  }

  // Finishes the measurement in progress if it has enough places.
  private end(): void {
    if (!this.isEnough) return;
    this.chosen = { kind: this.kind, places: this.places };
    this.finished.push(this.chosen);
    this.places = [];
    this.show();
  }

  private endOrDrop(): void {
    this.end();
    this.places = [];
  }

  private takeBack(): void {
    this.places.pop();
    this.show();
  }

  private show(): void {
    const begun: Measurement[] = this.places.length > 0 ? [{ kind: this.kind, places: this.places }] : [];
    // An area is open until it is finished; the rubber band closes it.
    const open: Measurement[] = begun.map(({ places }) => ({ kind: this.kind === 'area' ? 'distance' : this.kind, places }));
    this.marks.show([...this.finished, ...open], this.frame);
    const labels = this.finished.flatMap((one) => measurementLabels(one, this.frame));
    // The figure of the measurement in progress is at the pointer.
    const segments = begun.flatMap((one) => measurementLabels(one, this.frame)).filter(({ isMinor }) => isMinor);
    this.labels.show([...labels, ...segments]);
    this.panel.showTask(this.kind, hintText(this.kind, pointsByTouch()), begun.length > 0, this.isEnough);
    this.panel.showMeasurements(this.finished.map((one) => ({
      name: kKindNames[one.kind], figure: headline(one, this.frame), isChosen: one === this.chosen && begun.length === 0,
    })));
    this.pointer = undefined; // until it moves
    this.showBand();
    this.viewer.needPicture();
  }

  // Draws the rubber band from the last place to the pointer, with the figures that a click would give; picks the place
  // in the scene.
  private showBand(): void {
    const { pointer, places, kind } = this;
    const under = pointer && this.viewer.pickAt(pointer)?.toArray();
    const wouldBe: Measurement = { kind, places: under ? [...places, under] : places };
    if (places.length > 0) this.panel.showFigures(measurementRows(wouldBe, this.frame));
    else this.panel.showFigures(this.chosen ? measurementRows(this.chosen, this.frame) : []);
    if (!under) {
      this.labels.showBand(undefined);
      return;
    }
    const { left, top } = this.viewer.canvas.getBoundingClientRect();
    const from = [places[places.length - 1], ...(kind === 'area' && places.length > 1 ? [places[0]] : [])];
    this.labels.showBand({ from, x: pointer.clientX - left, y: pointer.clientY - top, text: headline(wouldBe, this.frame) });
  }

  private listen(): void {
    addEventListener('keydown', (event) => {
      if (!this.isOpen || this.viewer.isPaused || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      if (event.key === 'Backspace') this.takeBack();
      else if (event.key === 'Enter' && !(event.target instanceof HTMLButtonElement)) this.end();
      else return;
      event.preventDefault();
    });
    const { canvas } = this.viewer;
    canvas.addEventListener('pointermove', ({ clientX, clientY, buttons, pointerType }) => {
      if (this.places.length === 0) return;
      // There is no rubber band while the view is dragged, nor with touch input.
      this.follow(buttons !== 0 || pointerType === 'touch' ? undefined : { clientX, clientY });
    });
    canvas.addEventListener('pointerleave', () => this.follow(undefined));
  }

  private follow(pointer: Pointer | undefined): void {
    this.pointer = pointer;
    // The image is read back at most once a frame.
    this.awaited ||= requestAnimationFrame(() => {
      this.awaited = 0;
      this.showBand();
    });
  }

  private async copy(): Promise<void> {
    if (this.lastPlace) this.panel.showCopied(await copyText(placeNumbers(this.lastPlace, this.frame)));
  }

  private download(): void {
    const { extension, text } = exportMeasurements(this.finished, this.frame);
    download(fileName(`${this.viewer.city.name}-measurements`, extension), text);
  }
}

function isNear(a: Pointer, b: Pointer): boolean {
  return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) < kNear;
}
