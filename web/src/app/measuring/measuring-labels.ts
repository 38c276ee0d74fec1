// Labels beside measurements, and the rubber band from the last place to the pointer. They are part of the page, over
// the canvas, so that moving the pointer needs no new frame.
import * as THREE from 'three';
import type { Vec3 } from '../../tiles/tileset';
import { element } from '../page/element';
import type { Label } from './measurement-text';

const kSvg = 'http://www.w3.org/2000/svg';

const kStands = { on: '-50%, -50%', above: '-50%, calc(-100% - 9px)', beside: '10px, -50%' };

export interface Band {
  from: readonly Vec3[]; // a line is drawn from each of these
  x: number; // end of the lines, in pixels of the canvas
  y: number;
  text: string;
}

export class MeasuringLabels {
  readonly layer = element('div', 'measure-labels');
  private readonly lines = document.createElementNS(kSvg, 'svg');
  private readonly bandText = element('span', 'minor');
  private placed: (Label & { node: HTMLElement })[] = [];
  private band?: Band;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: THREE.Camera,
  ) {
    this.bandText.hidden = true;
    this.layer.append(this.lines, this.bandText);
    canvas.after(this.layer);
  }

  show(labels: readonly Label[]): void {
    for (const { node } of this.placed) node.remove();
    this.placed = labels.map((label) => ({ ...label, node: element('span', label.isMinor ? 'minor' : '', label.text) }));
    this.layer.append(...this.placed.map(({ node }) => node));
    this.place();
  }

  showBand(band: Band | undefined): void {
    this.band = band;
    this.placeBand();
  }

  // Must be called after the camera has moved.
  place(): void {
    for (const { at, node, stands } of this.placed) {
      const pixel = this.projectToPixel(at);
      node.hidden = !pixel;
      if (!pixel) continue;
      node.style.transform = `translate(${pixel.x.toFixed(1)}px, ${pixel.y.toFixed(1)}px) translate(${kStands[stands ?? 'on']})`;
    }
    this.placeBand();
  }

  // Returns where a place of the world is on the canvas, or undefined if it is behind the camera.
  projectToPixel(place: Vec3): { x: number; y: number } | undefined {
    const inCamera = new THREE.Vector3(...place).applyMatrix4(this.camera.matrixWorldInverse);
    if (inCamera.z >= 0) return undefined;
    const { x, y } = inCamera.applyMatrix4(this.camera.projectionMatrix);
    return { x: (0.5 + 0.5 * x) * this.canvas.clientWidth, y: (0.5 - 0.5 * y) * this.canvas.clientHeight };
  }

  private placeBand(): void {
    const { band } = this;
    const begins = band?.from.map((place) => this.projectToPixel(place)).filter((pixel) => pixel !== undefined) ?? [];
    this.lines.replaceChildren(...begins.map(({ x, y }) => {
      const line = document.createElementNS(kSvg, 'line');
      const ends = { x1: x, y1: y, x2: band!.x, y2: band!.y };
      for (const [name, value] of Object.entries(ends)) line.setAttribute(name, value.toFixed(1));
      return line;
    }));
    this.bandText.hidden = begins.length === 0 || !band?.text;
    if (!band) return;
    this.bandText.textContent = band.text;
    // Below and to the right of the pointer, if that is on the canvas.
    const { offsetWidth: width, offsetHeight: height } = this.bandText;
    const x = Math.min(band.x + 14, this.canvas.clientWidth - width - 4);
    const y = band.y + 12 + height > this.canvas.clientHeight - 4 ? band.y - 12 - height : band.y + 12;
    this.bandText.style.transform = `translate(${x}px, ${y}px)`;
  }
}
