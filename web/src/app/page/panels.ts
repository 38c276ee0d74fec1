// The overlays of the canvas: loading progress, errors and statistics.
import type { SceneError } from '../../scene-error';
import type { SceneStatistics } from '../../scene';
import type { Frame } from '../viewer';
import { element } from './element';
import { FrameRate, inDigits } from './frame-rate';

export function megabytes(bytes: number): string {
  return bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;
}

export class LoadingPanel {
  private readonly name = element('span');
  private readonly bytes = element('span', 'bytes');
  private readonly bar = element('i');
  private readonly panel = element(
    'div', 'glass loading', element('div', 'name', this.name, this.bytes), element('div', 'bar', this.bar));
  private maximum = 1; // largest number of pending tiles since the last rest

  constructor(parent: HTMLElement) {
    this.name.textContent = 'Opening the scene';
    this.panel.setAttribute('role', 'status');
    parent.append(this.panel);
  }

  show(name: string, { fetchedBytes, pending }: SceneStatistics, idle: boolean): void {
    this.maximum = idle ? 1 : Math.max(this.maximum, pending);
    this.name.textContent = name === '' ? 'Loading' : name;
    this.bytes.textContent = megabytes(fetchedBytes);
    this.bar.style.width = `${idle ? 100 : Math.round(100 * (1 - pending / (this.maximum + 1)))}%`;
    this.panel.classList.toggle('done', idle);
  }

  hide(): void {
    this.panel.classList.add('done');
  }
}

export class ErrorPanel {
  private readonly what = element('h2');
  private readonly reason = element('p');
  private readonly remedy = element('p');
  private readonly count = element('summary');
  private readonly others = element('ul');
  private readonly more = element('details', '', this.count, this.others);
  private shown: SceneError[] = []; // errors since the panel was closed, the latest first
  private readonly panel: HTMLElement;

  constructor(parent: HTMLElement) {
    const close = element('button', '', 'Close');
    close.addEventListener('click', () => (this.panel.hidden = true));
    this.panel = element('div', 'glass error', close, this.what, this.reason, this.remedy, this.more);
    this.panel.setAttribute('role', 'alert');
    this.panel.hidden = true;
    parent.append(this.panel);
  }

  hide(): void {
    this.panel.hidden = true;
  }

  // Shows the latest error, and those before it since the panel was closed.
  show(error: SceneError): void {
    const kMax = 50;
    this.shown = [error, ...(this.panel.hidden ? [] : this.shown)].slice(0, kMax);
    const sentence = (text: string) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
    this.what.textContent = errorTitle(error);
    this.reason.textContent = sentence(error.reason);
    this.remedy.textContent = sentence(error.remedy);
    const others = this.shown.slice(1);
    this.more.hidden = others.length === 0;
    this.count.textContent = `And ${others.length} more`;
    this.others.replaceChildren(...others.map((one) => element('li', '', `${errorTitle(one)}: ${one.reason}`)));
    this.panel.hidden = false;
  }
}

function errorTitle({ what, place }: SceneError): string {
  return place === '' ? what : `${what}, ${place}`;
}

export class StatisticsPanel {
  private readonly list = element('dl');
  private readonly frame = element('dd', '', 'at rest');
  private readonly rate = new FrameRate((text) => (this.frame.textContent = text));
  private readonly panel = element('div', 'glass statistics', this.list);

  constructor(parent: HTMLElement) {
    this.panel.hidden = true;
    parent.append(this.panel);
    document.addEventListener('visibilitychange', () => this.rate.rest()); // there are no animation frames out of sight
  }

  toggle(): void {
    this.panel.hidden = !this.panel.hidden;
  }

  show(statistics: SceneStatistics, { milliseconds, gpuMilliseconds, resolutionScale }: Frame): void {
    if (this.panel.hidden) return;
    this.rate.drew(milliseconds);
    const rows: [string, string][] = [
      ['Drawing', gpuMilliseconds === undefined ? 'not told' : `${inDigits(gpuMilliseconds)} ms`],
      ['Resolution', `${Math.round(100 * resolutionScale)} %`],
      ['GPU', megabytes(statistics.gpuBytes + statistics.targetBytes)],
      ['Page', megabytes(statistics.pageBytes)],
      ['Fetched', megabytes(statistics.fetchedBytes)],
      ['Loading', String(statistics.pending)],
      ...(statistics.refused > 0 ? [['Over the budget', `${statistics.refused} blocks`] satisfies [string, string]] : []),
      ...statistics.drawn.map((count, level): [string, string] => [`Blocks of level ${level}`, String(count)]),
    ];
    const list = rows.flatMap(([name, value]) => [element('dt', '', name), element('dd', '', value)]);
    this.list.replaceChildren(element('dt', '', 'Frame'), this.frame, ...list);
  }
}
